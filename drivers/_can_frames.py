"""Frames on a CAN bus for one device: those that are ours told apart, and our own sent; J1939's addresses."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from pydantic import PositiveFloat

from drivers._address_claim import CLAIM_WAIT_S, AddressClaim
from drivers._can import OnABus, close_bus, gone, heard, open_bus
from drivers._edge import wire_log
from hil.errors import LinkError
from hil.system import system

_ECHOES = 32  # frames that may be on their way back


class BusSettings(OnABus):
    """How a device on CAN is reached, whatever its messages.

    Attributes:
        timeout_s: a message is waited for so long, the first one for its own time-out if that is longer.
        echo: the adapter gives back what is sent, as if it came from the bus.
    """

    timeout_s: PositiveFloat = 0.3
    longest_reply_s: PositiveFloat = 0.6
    echo: bool = False


class CanFrames:
    """A bus, open; our address on it claimed where there is something to command on J1939.

    Args:
        settings: how it is reached.
        take: takes in a frame (identifier, data, whether it has 29 bits); tells whether it was one of ours.
        claim: to our address; None where nothing is sent, and where there are none.
        driver: whose frames they are, for their log.
        key: where our address is set, for errors.
        echo: see `BusSettings`.

    Raises:
        DeviceLostError: the bus cannot be opened.
        LinkError: another controller has our address.
    """

    def __init__(
        self, settings: OnABus, take: Callable[[int, bytes, bool], bool], claim: AddressClaim | None = None, *,
        driver: str, key: str = "", echo: bool = False,
    ) -> None:  # fmt: skip
        self._settings, self._take, self._claim, self._key, self._echo = settings, take, claim, key, echo
        self._echoes: deque[tuple[int, bytes]] = deque(maxlen=_ECHOES)
        self._log = wire_log(driver, settings.address)
        self._bus = open_bus(settings.address, settings.bitrate, settings.timeout_s)
        try:
            self._claim_address()
        except BaseException:
            self.close()
            raise

    def receive(self, wait_s: float) -> None:
        """Take in every message that has come; wait for the first of ours so long if there is none."""
        until_s = system.now_s() + wait_s
        while (mine := self._heard(max(0.0, until_s - system.now_s()))) is not None:
            until_s = 0.0 if mine else until_s

    def send(self, identifier: int, data: bytes, extended: bool = True) -> None:
        """Send a frame; raises `DeviceLostError` when the bus does not take it."""
        import can

        self._log.debug("→ %X %s", identifier, data.hex(" "))
        self._echoes.append((identifier, data))
        try:
            self._bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=extended))
        except Exception as error:
            raise gone(self._bus, self._settings.address, error) from error

    def address_is_ours(self) -> None:
        """Raise `LinkError` when another controller has taken our address."""
        if self._claim is None or self._claim.lost_to is None:
            return
        if self._claim.lost_to == self._claim.name:
            raise LinkError(
                f"our own claim of address {self._claim.address:#04x} came back: the adapter echoes, then say "
                f"echo = true; or another program claims it with our NAME"
            )
        raise LinkError(
            f"address {self._claim.address:#04x} belongs to a controller with NAME {self._claim.lost_to:#018x}, "
            f"which goes before ours: say another {self._key}"
        )

    def close(self) -> None:
        """Leave the bus."""
        close_bus(self._bus, self._settings.timeout_s)

    def _heard(self, wait_s: float) -> bool | None:
        """Take in one message: whether it was one of ours; None when none came."""
        message = heard(self._bus, self._settings.address, wait_s)
        if message is None:
            return None
        identifier, data = message.arbitration_id, bytes(message.data)
        if message.is_error_frame or message.is_remote_frame or not message.is_rx:
            return False
        self._log.debug("← %X %s", identifier, data.hex(" "))
        if self._echo and (identifier, data) in self._echoes:
            self._echoes.remove((identifier, data))
            return False
        if self._claim is not None and message.is_extended_id and (answer := self._claim.answer_to(identifier, data)):
            self.send(*answer)
        return self._take(identifier, data, message.is_extended_id)

    def _claim_address(self) -> None:
        if self._claim is None:
            return
        self.send(*self._claim.claim())
        until_s = system.now_s() + CLAIM_WAIT_S
        while (left_s := until_s - system.now_s()) > 0.0:
            self._heard(left_s)
        self.address_is_ours()
