"""The rig: what a bench promises to a procedure, and nothing below it.

A procedure is a plain function `run(rig, *, setting=default, …)`. It sees roles (the command, the response)
in engineering units, never device names, volts or registers.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any, Literal, Protocol, get_args

from hil.record.recording import Array, Recording

SwitchedRole = Literal["electronics supply", "feedback"]
ConditionRole = Literal["supply pressure", "load orifice", "tank pressure", "oil temperature", SwitchedRole]
"""What a bench may adjust beside the command. A load orifice at 0 blocks the ports A and B.

A switched role is lost at the lower end of its range: a relay in a supply, or in a feedback, that has opened.
"""
SWITCHED: tuple[SwitchedRole, ...] = get_args(SwitchedRole)


@dataclass(frozen=True, slots=True)
class RoleChannel:
    """A channel of the rig in engineering units: its name, unit and allowed range.

    `operating_point`: of a command, where the valve is tried when nobody says where; of a condition, where it stands
    unless it is adjusted; None where the bench names none.
    `settles_s`: of a condition: so long after it was adjusted it has come about.
    `integrates`: of a response, whether it moves on for as long as the command is off neutral.
    """

    name: str
    unit: str
    low: float
    high: float
    safe: float = 0.0
    slew_per_s: float | None = None
    operating_point: float | None = None
    integrates: bool = False
    settles_s: float = 0.0


class Rig(Protocol):
    """What a procedure may ask of a bench."""

    @property
    def command(self) -> RoleChannel:
        """The valve's command (spool command in %, coil current in A, position request in mm)."""
        ...

    @property
    def response(self) -> RoleChannel:
        """The measured answer (flow, pressure, position)."""
        ...

    @property
    def adjustable(self) -> Mapping[ConditionRole, RoleChannel]:
        """What sets a condition of the test on this bench, by role."""
        ...

    @property
    def rate_hz(self) -> float:
        """The sample rate that the bench is set to, as the device really makes it; used when none is asked for."""
        ...

    @property
    def settling_s(self) -> float:
        """In this time the valve's answer to a change of its command has died away."""
        ...

    @property
    def conditions(self) -> Mapping[str, Any]:
        """Bench, valve, conditions of the test and instruments: from the bench file."""
        ...

    @property
    def promises(self) -> Mapping[str, Any]:
        """What the backend keeps (timing, read_at, skew, delay of each input), as written into recordings."""
        ...

    @property
    def finished(self) -> Sequence[Mapping[str, Any]]:
        """Parts that need not be driven again: those that the run which this one resumes has finished.

        Their samples are in the recording already. Empty unless a run is resumed; only a procedure that says
        `RESUMABLE = True` is ever resumed.
        """
        ...

    def actual_rate_hz(self, asked_hz: float | None = None) -> float:
        """The sample rate that will really be used; of the bench's own when none is asked for. Raises `RangeError`."""
        ...

    def tighten(self, low: float, high: float, slew_per_s: float | None = None) -> None:
        """Narrow the limits of the command for the rest of the run; they never become wider.

        Raises:
            RangeError: nothing would be left, or not the safe value or the present level.
        """
        ...

    def check(self, command: Array, rate_hz: float | None = None) -> None:
        """Raise `RangeError` if any sample would leave the envelope (range, slew, dwell); drives nothing."""
        ...

    def play(self, command: Array, rate_hz: float | None = None, *, part: Mapping[str, Any] | None = None) -> Recording:
        """Drive the command, in its unit, and return every channel for just these samples.

        The samples are on disk before this returns. Time goes on from one call to the next; the command
        holds its last value in between. `part` says what these samples are (`{"kind": "sine",
        "frequency_hz": 0.3, "bias": 50, …}`); it is kept with their place in `Recording.meta["parts"]`, where
        the evaluation finds them.
        """
        ...

    def stream(
        self, commands: Iterable[Array], rate_hz: float | None = None, *, part: Mapping[str, Any] | None = None
    ) -> Iterator[Recording]:
        """Like `play` for a long run, without a gap between the arrays; one recording for each.

        The next array is asked for while the current one plays, so what an array brings can decide about the
        next but one. Memory does not grow with the run; neither does the run folder where `part` says in `rows_kept`
        which rows stay (see `hil.record.run_folder.thinned`). Every row is given back here.
        """
        ...

    def hold(
        self, duration_s: float, rate_hz: float | None = None, *, part: Mapping[str, Any] | None = None
    ) -> Recording:
        """Keep the command where it stands, and record."""
        ...

    def ramp_to(self, value: float, rate_hz: float | None = None) -> Recording:
        """Go to a value at the allowed slew and stay there for one settling time of the valve."""
        ...

    def adjust(self, values: Mapping[ConditionRole, float], rate_hz: float | None = None) -> Recording:
        """Bring conditions to values, by role, at their allowed slews, and stay until they have come about.

        The command stands meanwhile. The recording has the part `{"kind": "adjusted", ROLE: value, …}`.

        Raises:
            RangeError: a value is outside the limits of its channel; nothing has moved.
            KeyError: a role that is not in `adjustable`.
        """
        ...

    def way_to(self, value: float, rate_hz: float | None = None) -> Array:
        """The samples that bring the command from where it stands to a value at the allowed slew; drives nothing.

        At least one, the value itself.
        """
        ...

    def mark(self, samples: int, part: Mapping[str, Any]) -> None:
        """Say afterwards what the last so many recorded samples are, as `part` of `play` says it beforehand.

        For what shows only in the samples themselves: from when on a response is steady. While a stream is
        read, the last samples are those that it has given back.
        """
        ...

    def note(self, event: str, **details: Any) -> None:
        """Write an event into the run: a level reached, a decision taken."""
        ...

    def progress(self, done: float, text: str) -> None:
        """Tell the operator what is done, and how far that is: 0 … 1; where a time is expected, that counts."""
        ...

    def expect(self, duration_s: float) -> None:
        """Say how long what comes now takes, in s of bench time: the operator is told how much of it is left."""
        ...

    def before(self, rest_s: float) -> AbstractContextManager[None]:
        """For a sequence: what is expected inside is followed by so much more, in s of bench time."""
        ...
