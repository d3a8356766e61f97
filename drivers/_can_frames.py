"""Frames on a CAN bus for one device: those that are ours told apart, and our own sent; J1939's addresses."""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any

from pydantic import BaseModel, ConfigDict, PositiveFloat, PositiveInt

from drivers._address_claim import CLAIM_WAIT_S, AddressClaim, default_name
from drivers._can import close_bus, gone, heard, open_bus
from drivers._can_messages import Received, group_of
from drivers._edge import wire_log
from hil.description.can import J1939
from hil.errors import LinkError


class BusSettings(BaseModel):
    """How a device on CAN is reached, whatever its messages.

    Attributes:
        address: of the bus: `socketcan:can0`, `pcan:PCAN_USBBUS1`, `socketcand:host:port`, `virtual:name`.
        bitrate: of the bus.
        timeout_s: a message is waited for so long, the first one for its own time-out if that is longer.
        longest_reply_s: after a failure what comes for so long is not believed, as it may have been under way.
        echo: the adapter gives back what is sent, as if it came from the bus.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    address: str
    bitrate: PositiveInt = 250_000
    timeout_s: PositiveFloat = 0.3
    longest_reply_s: PositiveFloat = 0.6
    echo: bool = False


class CanFrames:
    """A bus, open; on J1939 our address claimed where there is something to command.

    Args:
        settings: how it is reached.
        j1939: whose messages are believed there, and who we are; None on plain CAN.
        received: the messages that are read; each takes in what comes of it.
        claims: whether anything is to be sent.

    Raises:
        DeviceLostError: the bus cannot be opened.
        LinkError: another controller has our address.
    """

    def __init__(self, settings: BusSettings, j1939: J1939 | None, received: Iterable[Received], claims: bool) -> None:
        self._settings, self._j1939, self._received = settings, j1939, tuple(received)
        self._echoes: list[tuple[int, bytes]] = []
        self._log = wire_log("can", settings.address)
        self._claim = AddressClaim(j1939.source, default_name()) if j1939 and j1939.claim and claims else None
        self._bus = open_bus(settings.address, settings.bitrate, settings.timeout_s)
        try:
            self._claim_address()
        except BaseException:
            self.close()
            raise

    def receive(self, wait_s: float) -> None:
        """Take in every message that has come; wait for the first of ours so long if there is none."""
        until_s = time.monotonic() + wait_s
        while (mine := self._heard(max(0.0, until_s - time.monotonic()))) is not None:
            until_s = 0.0 if mine else until_s

    def send(self, message: Any, data: bytes) -> None:
        """Send a message of the DBC file with these bytes."""
        self._send(self._identifier(message), data, message.is_extended_frame)

    def address_is_ours(self) -> None:
        """Raise `LinkError` when another controller has taken our address."""
        if self._claim is not None and self._claim.lost_to is not None:
            raise LinkError(
                f"our address belongs to a controller with NAME {self._claim.lost_to:#018x}, which goes before ours: "
                f"say another j1939.source in its description, or echo = true where the adapter gives back what is sent"
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
        if self._settings.echo and (identifier, data) in self._echoes:
            self._echoes.remove((identifier, data))
            return False
        if self._claim is not None and message.is_extended_id and (answer := self._claim.answer_to(identifier, data)):
            self._send(*answer, True)
        mine = [r for r in self._received if self._is(r.message, identifier, message.is_extended_id)]
        for received in mine:
            received.take(data, time.monotonic())
        return bool(mine)

    def _is(self, message: Any, identifier: int, extended: bool) -> bool:
        if self._j1939 is None:
            return bool(message.frame_id == identifier and message.is_extended_frame == extended)
        return (
            extended and group_of(message.frame_id) == group_of(identifier) and identifier & 0xFF == self._j1939.device
        )

    def _identifier(self, message: Any) -> int:
        """Of a message that we send: on J1939 from our address, and to the device where it is for one."""
        if self._j1939 is None:
            return int(message.frame_id)
        identifier = message.frame_id & ~0xFF | self._j1939.source
        to_one = group_of(identifier) != identifier >> 8 & 0x3FFFF or identifier >> 16 & 0xFF < 240
        return int(identifier & ~0xFF00 | self._j1939.device << 8 if to_one else identifier)

    def _send(self, identifier: int, data: bytes, extended: bool) -> None:
        import can

        self._log.debug("→ %X %s", identifier, data.hex(" "))
        self._echoes = [*self._echoes[-31:], (identifier, data)]
        try:
            self._bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=extended))
        except Exception as error:
            raise gone(self._bus, self._settings.address, error) from error

    def _claim_address(self) -> None:
        if self._claim is None:
            return
        self._send(*self._claim.claim(), True)
        until_s = time.monotonic() + CLAIM_WAIT_S
        while (left_s := until_s - time.monotonic()) > 0.0:
            self._heard(left_s)
        self.address_is_ours()
