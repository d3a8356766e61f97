"""Who answers on a line: asked again on every new connection, before anything is written there."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any

from pydantic import Field, PositiveFloat

from drivers._edge import wire_log
from hil.daq.address import Port
from hil.daq.channel import Wiring
from hil.daq.device_link import DeviceLink
from hil.errors import LinkError
from hil.strict import Strict
from hil.system import system


class Meeting:
    """The device with which a line was opened, and who answers since it was connected anew.

    A line says when it is connected (`is_due`), and has this `take_place` before its next request. One that did not
    say what it is at first is not asked.

    Attributes:
        identity: what it said that it is on this connection; empty where it has not said.
    """

    def __init__(self) -> None:
        self.identity = self._met = ""
        self._ask: Callable[[], str] = lambda: ""
        self._due = False

    def met(self, identity: str, ask: Callable[[], str]) -> None:
        """The device of the first connection, and how it is asked."""
        self.identity = self._met = identity
        self._ask = ask

    def is_due(self) -> None:
        """The line was connected; who answers there is not known yet."""
        self._due = bool(self._met)
        self.identity = "" if self._due else self.identity

    def take_place(self) -> None:
        """Ask, where that is due; who does not say what it is, is not believed (see `hil.daq.pin.Pin.doubt`).

        Raises:
            DeviceLostError: another device answers.
            LinkError: nobody does.
        """
        if not self._due:
            return
        self._due = False  # the question itself goes out on this line
        try:
            self.identity = self._ask()
            self.refuse_another()
        except BaseException:
            self._due = True
            raise

    def refuse_another(self) -> None:
        """Raise `DeviceLostError` where who answered last is another device."""
        replace(_NOTHING, known_as=self._met).refuse_another(self.identity)

    def refuse_a_stranger(self) -> None:
        """Raise `LinkError` where something is to be driven, and the device does not say any more what it is."""
        if self._met and not self.identity:
            raise LinkError(f"it does not say what it is; {self._met} was opened before")


_NOTHING = Wiring({}, {})


class RequestSettings(Strict):
    """How a line is reached on which a device is asked.

    Attributes:
        address: of its port.
        timeout_s: an answer that takes longer counts as none.
        longest_reply_s: after a failure nothing is asked for so long, so that a late answer passes and is not taken
            for the next one. No answer may come later than that.
        echo: what is sent on a serial line comes back before the answer, as some RS-485 adapters do.
        pause_s: so long nothing is asked after an answer, for devices and converters that need to turn around.
    """

    address: str
    timeout_s: PositiveFloat = 0.2
    longest_reply_s: PositiveFloat = 1.0
    echo: bool = False
    pause_s: float = Field(0.0, ge=0.0, le=1.0)


class RequestLine(ABC):
    """A line on which a device is asked: nothing goes out while a late answer may still come.

    Args:
        settings: how it is reached.
        driver: whose line it is, for the log of its frames.
    """

    def __init__(self, settings: RequestSettings, driver: str) -> None:
        self._address, self._timeout_s, self._longest_reply_s = (
            settings.address, settings.timeout_s, settings.longest_reply_s
        )  # fmt: skip
        self._pause_s, self._echo = settings.pause_s, settings.echo
        self._quiet_until_s = self._rest_until_s = 0.0
        self._log = wire_log(driver, settings.address)
        self._place = Port(settings.address)
        self._port: Any = None
        self.meeting = Meeting()

    @abstractmethod
    def _opened(self) -> Any:
        """A port of `drivers._ports`, open. Raises `DeviceLostError`."""

    def connect(self) -> None:
        """Open the line if it is not; raises as `_opened`."""
        if self._port is None:
            self._port = self._opened()
            self.meeting.is_due()

    def meet(self) -> None:
        """Open it where it is not, and ask who answers, as soon as the next answer can only be that to this."""
        self._wait()
        self.connect()
        self.meeting.take_place()

    def close(self) -> None:
        """Close it; what was sent goes out, unless an answer is missing."""
        self._leave(in_order=self.is_clean)

    def drop(self) -> None:
        """Give it up: what arrives on it from now on belongs to nobody, and nothing more is sent."""
        self._leave(in_order=False)

    @property
    def is_hung_up(self) -> bool:
        """Whether it is not open, or the other side has closed it meanwhile."""
        return self._port is None or bool(self._port.is_hung_up)

    @property
    def is_clean(self) -> bool:
        """Whether the next answer can only be that to the next request."""
        return system.now_s() >= self._quiet_s

    @property
    def _quiet_s(self) -> float:
        """Until when a late answer may still come, to this device or to another one on its line."""
        return max(self._quiet_until_s, self._port.quiet_until_s if self._port is not None else 0.0)

    def _wait(self) -> None:
        """Let a late answer pass, and a device its pause."""
        wait_s = max(self._quiet_s, self._rest_until_s) - system.now_s()
        if wait_s > 0.0:
            system.sleep(wait_s)

    def _keep_quiet(self) -> None:
        self._quiet_until_s = system.now_s() + self._longest_reply_s
        if self._port is not None:
            self._port.quiet_until_s = self._quiet_until_s

    def _without_echo(self, sent: bytes, received: bytes) -> bytes:
        """What has come of an answer; nothing while the echo may still come."""
        if not self._echo or not sent.startswith(received[: len(sent)]):
            return received
        return received[len(sent) :]

    def _leave(self, *, in_order: bool) -> None:
        port, self._port = self._port, None
        with suppress(Exception):
            if port is not None:
                (port.let_go if in_order else port.drop)()


class OnALine(DeviceLink):
    """A link on a line that may be connected anew: by a fault, or because the device hangs up while it idles.

    Attributes:
        line: on which it is asked; a link gives it.
    """

    line: RequestLine

    @property
    def identity(self) -> str:
        """What the device says that it is; empty where it does not, or has not on this connection."""
        return self.line.meeting.identity

    def close(self) -> None:
        """Close the line."""
        self.line.close()

    def renew(self) -> None:
        """Connect again where the device has closed an idle connection, if it is the same one; outputs are safe.

        Raises:
            DeviceLostError: it is not reached, or another one answers there.
            LinkError: it does not answer, or does not say any more what it is.
        """
        if self.line.is_hung_up:
            self.line.close()
            self.line.meet()
            self.line.meeting.refuse_a_stranger()
            self._make_ready()
            self.drive(self._safe)  # after a gap the first command is the safe one

    @property
    def _is_clean(self) -> bool:
        return self.line.is_clean
