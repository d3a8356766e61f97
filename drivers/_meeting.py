"""Who answers on a line: asked again on every new connection, before anything is written there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

from hil.daq.channel import Wiring
from hil.daq.device_link import DeviceLink
from hil.errors import LinkError


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


class MeetingLine(Protocol):
    """A line on which a device is met."""

    meeting: Meeting

    @property
    def is_hung_up(self) -> bool:
        """Whether the other side has closed it."""

    @property
    def is_clean(self) -> bool:
        """Whether the next answer can only be that to the next request."""

    def meet(self) -> None:
        """Connect where it is not, and ask who answers."""

    def close(self) -> None:
        """Close it."""


class OnALine(DeviceLink):
    """A link on a line that may be connected anew: by a fault, or because the device hangs up while it idles.

    A link gives its `_line`.
    """

    _line: MeetingLine

    @property
    def identity(self) -> str:
        """What the device says that it is; empty where it does not, or has not on this connection."""
        return self._line.meeting.identity

    def renew(self) -> None:
        """Connect again where the device has closed an idle connection, if it is the same one; outputs are safe.

        Raises:
            DeviceLostError: it is not reached, or another one answers there.
            LinkError: it does not answer, or does not say any more what it is.
        """
        if self._line.is_hung_up:
            self._line.close()
            self._line.meet()
            self._line.meeting.refuse_a_stranger()
            self._make_ready()

    @property
    def _is_clean(self) -> bool:
        return self._line.is_clean
