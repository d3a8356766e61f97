"""Several procedures as one run: all are planned before anything moves, each has parts, limits and time of its own."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any, NoReturn, cast

from hil.errors import InputError, RangeError
from hil.language.note import Note
from hil.record.measurement import Findings
from hil.record.recording import Array, Recording
from hil.rig import Rig
from procedures._scale import scale_of

_TEST, _DONE = "test", "test completed"


@dataclass(frozen=True, slots=True)
class SequencedTest:
    """A procedure in a sequence, with the settings that the sequence gives it; the others have their defaults."""

    procedure: ModuleType
    title: Note
    given: Mapping[str, Any]

    @property
    def name(self) -> str:
        """Of the procedure, as installed."""
        return self.procedure.__name__.rpartition(".")[2]

    @property
    def settings(self) -> dict[str, Any]:
        """All of them, by name."""
        return {**defaults_of(self.procedure.run), **self.given}


def defaults_of(run: Callable[..., None]) -> dict[str, Any]:
    """What a procedure takes where nobody says anything, by the names of its settings."""
    return {a.name: a.default for a in inspect.signature(run).parameters.values() if a.default is not a.empty}


def drive(rig: Rig, tests: Sequence[SequencedTest]) -> None:
    """Drive tests one after another; those that a resumed run has completed are left out.

    Raises:
        RangeError, SettingError: a test cannot be driven on this bench; nothing has moved.
    """
    done = {part[_TEST] for part in rig.finished if part.get("kind") == _DONE}
    left = [test for test in tests if test.name not in done]
    plans = [_Planned.of(rig, test) for test in left]
    if not plans:
        return
    rig.tighten(min(plan.low for plan in plans), max(plan.high for plan in plans))
    for k, test in enumerate(left):
        own = _Own(rig, test.name)
        with rig.before(sum(plan.expected_s for plan in plans[k + 1 :])):
            test.procedure.run(cast("Rig", own), **test.given)
        own.mark(1, {"kind": _DONE})


def evaluated(recording: Recording, tests: Sequence[SequencedTest]) -> Findings:
    """The findings of all tests together; what was not driven to its end is said, and nobody judges it."""
    found: list[Findings] = []
    notes: list[str] = []
    for test in tests:
        parts = [p for p in recording.meta.get("parts", ()) if p.get(_TEST) == test.name and not p.get("unfinished")]
        if not any(part["kind"] == _DONE for part in parts):
            notes.append(Note("Not done: {part}.", part=test.title))
            continue
        own = replace(recording, meta={**recording.meta, "settings": test.settings, "parts": _last(test, parts)})
        try:
            found.append(test.procedure.evaluate(own))
        except InputError as error:
            notes.append(Note("Not evaluated: {part}: {why}.", part=test.title, why=str(error)))
    return joined(found, notes)


def joined(found: Collection[Findings], notes: Iterable[str]) -> Findings:
    """The findings of parts as those of one run; `notes` come first, and what several say stands once."""
    return Findings(
        tuple(one for part in found for one in part.measured),
        {name: curve for part in found for name, curve in part.curves.items()},
        tuple(dict.fromkeys([*notes, *(note for part in found for note in part.notes)])),
        tuple(dict.fromkeys(one for part in found for one in part.deviations)),
    )


def both_sides(rig: Rig, setting: str, sizes: Sequence[float], full_command: float | None) -> tuple[float, ...]:
    """Levels of steps from neutral and back, in % of full command, to both sides where the command has two.

    Raises:
        SettingError: a size, by the name of its setting, is beyond the command's range.
    """
    scale = scale_of(rig, full_command)
    levels = [0.0]
    for size in sizes:
        levels += [size, 0.0, -size, 0.0] if scale.both_ways else [size, 0.0]
    for level in levels:
        scale.level(setting, level)
    return tuple(levels)


def _last(test: SequencedTest, parts: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """The parts that count: those of the last time that a test was begun, unless it goes on where it was broken off."""
    if getattr(test.procedure, "RESUMABLE", False):
        return list(parts)
    return [part for part in parts if part["begun"] == parts[-1]["begun"]]


class _Own:
    """The bench as one test of a sequence sees it: parts that say whose they are, and limits that end with the test.

    The guard's limits are never widened within a run: what one test narrows would hold for those after it.
    """

    def __init__(self, rig: Rig, test: str) -> None:
        self._rig, self._test = rig, test
        self.low, self.high = rig.command.low, rig.command.high
        self._begun = 1 + max((int(part["begun"]) for part in self.finished), default=0)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._rig, name)

    @property
    def finished(self) -> list[Mapping[str, Any]]:
        """Of the parts that a resumed run has finished, those of this test."""
        return [part for part in self._rig.finished if part.get(_TEST) == self._test]

    def tighten(self, low: float, high: float) -> None:
        """Narrow the limits of the command for the rest of the test."""
        self.low, self.high = max(self.low, low), min(self.high, high)

    def play(self, command: Array, rate_hz: float | None = None, *, part: Mapping[str, Any] | None = None) -> Recording:
        """As `Rig.play`, within the limits of the test."""
        return self._rig.play(self._within(command), rate_hz, part=self._named(part))

    def stream(
        self, commands: Iterable[Array], rate_hz: float | None = None, *, part: Mapping[str, Any] | None = None
    ) -> Iterator[Recording]:
        """As `Rig.stream`, within the limits of the test."""
        return self._rig.stream(map(self._within, commands), rate_hz, part=self._named(part))

    def mark(self, samples: int, part: Mapping[str, Any]) -> None:
        """As `Rig.mark`."""
        self._rig.mark(samples, {**part, _TEST: self._test, "begun": self._begun})

    def _named(self, part: Mapping[str, Any] | None) -> Mapping[str, Any] | None:
        return None if part is None else {**part, _TEST: self._test, "begun": self._begun}

    def _within(self, command: Array) -> Array:
        if command.min() < self.low or command.max() > self.high:
            unit = self._rig.command.unit
            raise RangeError(
                f"{self._test}: {command.min():g} … {command.max():g} {unit} asked for, {self.low:g} … {self.high:g} "
                f"{unit} planned"
            )
        return command


class _Expected(Exception):
    """How long a test takes, in s of bench time."""


class _Planned(_Own):
    """The bench while a test says what it is going to do: it is checked, and nothing moves."""

    expected_s = 0.0

    @classmethod
    def of(cls, rig: Rig, test: SequencedTest) -> _Planned:
        """The plan of a test: its expected time and its limits."""
        plan = cls(rig, test.name)
        try:
            test.procedure.run(cast("Rig", plan), **test.given)
        except _Expected as expected:
            (plan.expected_s,) = expected.args
            return plan
        raise RangeError(f"{test.name}: it does not say what it is going to drive, and cannot stand in a sequence")

    def expect(self, duration_s: float) -> NoReturn:
        """The end of planning."""
        raise _Expected(duration_s)

    def note(self, event: str, **details: Any) -> None:
        """Nothing has happened."""

    def play(self, *_: Any, **__: Any) -> NoReturn:
        """A test drives only what it has said before."""
        raise RangeError(f"{self._test}: drives before it says how long it takes")

    stream = hold = ramp_to = adjust = play
