"""The rig of a bench: what procedures drive (see `hil.rig`), through the guard and into the run folder."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import Any

import numpy as np

from hil.bench.ending import Ending
from hil.bench.file import CONDITIONS, Bench
from hil.bench.progress_report import ProgressReporter
from hil.bench.recorder import Recorder
from hil.daq.contract import Block, Promises, Waveform, joined
from hil.errors import RangeError, StoppedError
from hil.record.conditions import ADJUSTED
from hil.record.invalid_samples import supposed
from hil.record.recording import Array, Channel, Recording
from hil.record.run_folder.header import Column
from hil.record.simulated import SIMULATED
from hil.rig import ConditionRole, RoleChannel
from hil.safety.envelope import Envelope
from hil.safety.guard import Guard
from hil.safety.ramp import way_to


class BenchRig:
    """A bench as a procedure sees it: roles in engineering units, no device, no volts.

    A procedure steers by numbers: where a channel was not measured it is handed the end of the range, or what was
    measured last. The run folder has no number there, and that is what is evaluated.

    Args:
        bench: the bench file.
        guard: the device behind its limits and interlocks.
        recorder: the run folder; the guard keeps every block in it.
        columns: the channels as they are recorded, with source and calibration.
        reporter: what the operator hears.
        finished: parts that a run which this one resumes has finished.
        commanding: the output that is driven as the command, where it is not the bench's own.
        ending: of the run: what has ended it is raised by every call.
        asks: what somebody who sets conditions by hand does then, in words; empty where nobody is there: they are taken
            as set.
    """

    def __init__(
        self,
        bench: Bench,
        guard: Guard,
        recorder: Recorder,
        columns: Iterable[Column],
        reporter: ProgressReporter,
        finished: Sequence[Mapping[str, Any]] = (),
        commanding: str = "",
        ending: Ending | None = None,
        *,
        asks: str = "",
    ) -> None:
        self.finished = finished
        self._ending = ending or Ending()
        self._bench, self._asks = bench, asks
        self._guard = guard
        self._recorder = recorder
        self._columns = {column.name: column for column in columns}
        self._reporter = reporter
        self._rates_hz: set[float] = set()
        self._sampled: tuple[Promises, float, dict[str, Any]] | None = None
        self._roles = bench.roles
        self._own_command = self._roles["command"]
        self._roles["command"] = commanding or self._own_command

    @property
    def command(self) -> RoleChannel:
        """The valve's command, with the limits in force."""
        name = self._roles["command"]
        return self._output(name, self._bench.valve.operating_point if name == self._own_command else None)

    @property
    def response(self) -> RoleChannel:
        """The measured answer, with the range that its instrument covers."""
        channel = self._guard.inputs[self._roles["response"]]
        integrates = self._bench.valve.integrates and self.command.name == self._own_command
        return RoleChannel(channel.name, channel.unit, channel.low, channel.high, integrates=integrates)

    @property
    def adjustable(self) -> Mapping[ConditionRole, RoleChannel]:
        """What sets a condition of the test, by role, with the limits in force."""
        found: dict[ConditionRole, RoleChannel] = {}
        for role in CONDITIONS:
            if name := self._roles.get(role):
                entry = self._bench.channels[name]
                if (hand := entry.by_hand) is not None:
                    made = RoleChannel(name, entry.unit, hand.low, hand.high, hand.usual, None, hand.usual)
                else:
                    made = self._output(name, entry.safe if entry.on is None else entry.on)
                found[role] = replace(made, settles_s=entry.settles_s or self.settling_s)
        return found

    @property
    def rate_hz(self) -> float:
        """The sample rate that the bench file asks for, as the device really makes it."""
        return self.actual_rate_hz()

    @property
    def settling_s(self) -> float:
        """In this time the valve's answer to a change has died away."""
        return self._bench.valve.settling_s

    @property
    def conditions(self) -> Mapping[str, Any]:
        """Valve, conditions of the test and instruments."""
        return conditions_of(self._bench)

    @property
    def promises(self) -> Mapping[str, Any]:
        """What the backend keeps at the bench's own rate, as written into recordings."""
        return self._sampling(self.rate_hz)

    def actual_rate_hz(self, asked_hz: float | None = None) -> float:
        """The sample rate that will really be used; another one than was asked for is noted. Raises `RangeError`."""
        asked_hz = self._bench.sample_rate_hz if asked_hz is None else asked_hz
        made_hz = self._guard.actual_rate_hz(asked_hz)
        if asked_hz not in self._rates_hz and not math.isclose(made_hz, asked_hz, rel_tol=1e-6):
            self.note("the device makes another sample rate", asked_hz=asked_hz, made_hz=made_hz)
        self._rates_hz.add(asked_hz)
        return made_hz

    def tighten(self, low: float, high: float, slew_per_s: float | None = None) -> None:
        """Narrow the limits of the command for the rest of the run; they never become wider."""
        self._ending.check()
        self._guard.tighten(self.command.name, Envelope(low, high, slew_per_s or np.inf))
        self.note("limits tightened", low=low, high=high, slew_per_s=slew_per_s)

    def check(self, command: Array, rate_hz: float | None = None) -> None:
        """Raise `RangeError` if any sample would leave the envelope; drives nothing."""
        self._ending.check()
        self._guard.check(self._waveform(command, rate_hz))

    def play(self, command: Array, rate_hz: float | None = None, *, part: Mapping[str, Any] | None = None) -> Recording:
        """Drive the command and return every channel for just these samples, already on disk."""
        self._ending.check()
        return self._played(self._waveform(command, rate_hz), part)

    def _played(self, waveform: Waveform, part: Mapping[str, Any] | None) -> Recording:
        with self._ending.task():
            self._guard.ready()
            with self._recorder.part(part):
                blocks = list(self._guard.play(waveform))
        return self._recording(joined(blocks), waveform.rate_hz, part)

    def stream(
        self, commands: Iterable[Array], rate_hz: float | None = None, *, part: Mapping[str, Any] | None = None
    ) -> Iterator[Recording]:
        """Like `play` for a long run without a gap: a recording for each array of commands."""
        self._ending.check()
        yield from self._ending.streamed(self._streamed(commands, self.actual_rate_hz(rate_hz), part))

    def _streamed(
        self, commands: Iterable[Array], rate_hz: float, part: Mapping[str, Any] | None
    ) -> Generator[Recording]:
        asked: deque[int] = deque()
        self._guard.ready()
        with self._recorder.part(part):
            for block in whole(self._guard.stream(self._counted(commands, rate_hz, asked)), asked):
                yield self._recording(block, rate_hz, part)

    def hold(
        self, duration_s: float, rate_hz: float | None = None, *, part: Mapping[str, Any] | None = None
    ) -> Recording:
        """Keep the command where it stands and record."""
        rate_hz = self.actual_rate_hz(rate_hz)
        samples = max(1, round(duration_s * rate_hz))
        return self.play(np.full(samples, self._level), rate_hz, part=part)

    def ramp_to(self, value: float, rate_hz: float | None = None) -> Recording:
        """Go to a value at the allowed slew and stay there until the valve has settled."""
        rate_hz = self.actual_rate_hz(rate_hz)
        still = np.full(max(1, round(self.settling_s * rate_hz)), value)
        command = still if value == self._level else np.concatenate((self.way_to(value, rate_hz), still))
        return self.play(command, rate_hz, part={"kind": "ramp", "to": value})

    def adjust(self, values: Mapping[ConditionRole, float], rate_hz: float | None = None) -> Recording:
        """Bring conditions to values, by role, at their allowed slews, and stay until they have come about."""
        self._ending.check()
        rate_hz, adjusted = self.actual_rate_hz(rate_hz), self.adjustable
        targets = {adjusted[role].name: value for role, value in values.items()}
        for name in [name for name in targets if self._bench.channels[name].by_hand is not None]:
            self._set_by_hand(name, targets.pop(name), rate_hz)
        if not targets:
            return self.hold(1.0 / rate_hz, rate_hz, part=_adjusted(values))
        way = way_to(targets, self._guard.levels, {name: self._slew_per_s(name) for name in targets}, rate_hz)
        moved = 0 if way is None else len(way)
        still = max(1, round(max(adjusted[role].settles_s for role in values) * rate_hz))
        outputs = {name: np.full(moved + still, value) for name, value in targets.items()}
        for name, path in ({} if way is None else way.outputs).items():
            outputs[name][:moved] = path
        waveform = Waveform(rate_hz, outputs)
        self._guard.check(waveform)  # what is refused while it plays makes all outputs safe
        return self._played(waveform, _adjusted(values))

    def _set_by_hand(self, name: str, value: float, rate_hz: float) -> None:
        """Have somebody set a condition, and hold what it reads against what was confirmed."""
        entry = self._bench.channels[name]
        hand, wanted = entry.by_hand, f"{entry.role} {value:.4g} {entry.unit}"
        if hand is None or not hand.low <= value <= hand.high:
            raise RangeError(f"'{name}': {wanted} cannot be set by hand")
        self.note("set by hand", channel=name, value=value, asked=bool(self._asks))
        if not self._asks:
            return
        self._reporter.say(0.0, f"HOLDS: set {wanted} by hand, then {self._asks}")
        with self._ending.task():
            self._guard.wait_for_operator()
        read = self.hold(entry.settles_s or self.settling_s, rate_hz).values(name)
        reads = float(read[len(read) // 2 :].mean())
        if not abs(reads - value) <= hand.tolerance:
            with self._ending.task():
                raise StoppedError(
                    f"'{name}' reads {reads:.4g} {entry.unit}; {wanted} was confirmed, ± {hand.tolerance:g} is "
                    "allowed; the run was stopped"
                )

    def way_to(self, value: float, rate_hz: float | None = None) -> Array:
        """The samples that bring the command to a value at the allowed slew; drives nothing."""
        name = self.command.name
        way = way_to({name: value}, {name: self._level}, {name: self._slew_per_s(name)}, self.actual_rate_hz(rate_hz))
        return np.array([value]) if way is None else way.outputs[name]

    def mark(self, samples: int, part: Mapping[str, Any]) -> None:
        """Say afterwards what the last so many recorded samples are."""
        with self._ending.task():
            self._recorder.mark(samples, part)

    def note(self, event: str, **details: Any) -> None:
        """Write an event into the run."""
        with self._ending.task():
            self._recorder.note(event, **details)

    def progress(self, done: float, text: str) -> None:
        """Tell the operator what is done, and how far that is: 0 … 1."""
        self._ending.check()
        self._reporter.say(done, text)

    def expect(self, duration_s: float) -> None:
        """Say how long what comes now takes, in s of bench time."""
        self._ending.check()
        self._reporter.expect(duration_s)

    def before(self, rest_s: float) -> AbstractContextManager[None]:
        """What is expected inside is followed by so much more, in s of bench time."""
        return self._reporter.before(rest_s)

    @property
    def _level(self) -> float:
        return self._guard.levels[self.command.name]

    def _output(self, name: str, point: float | None) -> RoleChannel:
        limits, channel = self._guard.limits[name], self._guard.outputs[name]
        slew = None if np.isinf(limits.slew_per_s) else limits.slew_per_s
        return RoleChannel(name, channel.unit, limits.low, limits.high, channel.safe, slew, point)

    def _slew_per_s(self, name: str) -> float:
        slew_per_s = self._guard.limits[name].slew_per_s
        return slew_per_s if math.isfinite(slew_per_s) else self._bench.channels[name].ramp_to_safe_per_s or math.inf

    def _waveform(self, command: Array, rate_hz: float | None) -> Waveform:
        return Waveform(self.actual_rate_hz(rate_hz), {self.command.name: np.asarray(command, dtype=np.float64)})

    def _counted(self, commands: Iterable[Array], rate_hz: float, asked: deque[int]) -> Iterator[Waveform]:
        for command in commands:
            waveform = Waveform(rate_hz, {self._roles["command"]: np.asarray(command, dtype=np.float64)})
            asked.append(len(waveform))
            yield waveform

    def _sampling(self, rate_hz: float) -> dict[str, Any]:
        promises = self._guard.promises
        if self._sampled is None or self._sampled[0] is not promises or self._sampled[1] != rate_hz:
            self._sampled = promises, rate_hz, promises.sampling(self._guard.inputs, rate_hz)
        return self._sampled[2]

    def _recording(self, block: Block, rate_hz: float, part: Mapping[str, Any] | None) -> Recording:
        time_s = self._recorder.time_of(block)
        place = {"first": 0, "count": len(block), "start_s": float(time_s[0]), "stop_s": float(time_s[-1])}
        meta = {"sampling": self._sampling(rate_hz), "parts": [] if part is None else [{**part, **place}]}
        values = block.columns
        channels = {
            name: Channel(name, column.unit, values[name], column.source, column.calibration)
            for name, column in self._columns.items()
        }
        return supposed(Recording(self._recorder.name, time_s, channels, meta), "near")


def _adjusted(values: Mapping[ConditionRole, float]) -> dict[str, Any]:
    return {"kind": ADJUSTED} | {str(role): value for role, value in values.items()}


def whole(blocks: Iterable[Block], asked: deque[int]) -> Iterator[Block]:
    """Blocks put together to the lengths that were asked for, which are taken from the queue one by one."""
    parts: list[Block] = []
    for block in blocks:
        parts.append(block)
        if sum(map(len, parts)) == asked[0]:
            asked.popleft()
            yield joined(parts)
            parts = []


def conditions_of(bench: Bench) -> dict[str, Any]:
    """Valve, roles of channels, conditions of the test, instruments, and whether it is simulated, as JSON values."""
    description = bench.model_dump(mode="json", include={"valve", "conditions", "instruments"})
    simulated = any(device.simulated for device in bench.devices.values())
    return {"bench": bench.name, "roles": bench.roles, SIMULATED: simulated, **description}
