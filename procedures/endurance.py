"""Endurance: cycles of one pattern without a pause, figures of every cycle as a trend, and a stop when one drifts.

The first cycle of each block stays in the recording at the full rate; of the others their figures do, as means of the
block. A run that was broken off goes on with the block that it had not finished.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from annotated_types import Interval

from hil.errors import SettingError
from hil.language.note import Note
from hil.record.measurement import Findings, Measured, Measurement
from hil.record.recording import Array, Recording
from hil.record.run_folder.thinned import ROWS_KEPT
from hil.rig import Rig
from hil.signals.colour import colour_factor
from hil.signals.straight_line import chance_beyond, weighted_line
from procedures._definitions import CYCLES, defined
from procedures._recorded import calibration_share, calibration_std, departures, noted, parts_of, roles_of, settings_of
from procedures._run_sequence import RunSequence, joined
from procedures._scale import check_stands, scale_of
from procedures._settings import NotNegative, NotNegativePercent, Percent, Positive, PositivePercent

RESUMABLE = True
_Figure = Literal["gain", "phase", "offset", "residual"]
FIGURES: tuple[_Figure, ...] = ("gain", "phase", "offset", "residual")
COUNT = Measurement("cycles", "1", "cycles that were driven and evaluated")
OF = {
    "gain": Measurement("gain", "", "amplitude of the response's fundamental over that of the command"),
    "phase": Measurement("phase", "deg", "phase of the response's fundamental against the command"),
    "offset": Measurement("offset", "", "mean of the response over a cycle"),
    "residual": Measurement("residual", "", "rms of the response beside its mean and its fundamental"),
}
CHANGE = {
    name: Measurement(f"{name}_drift", "%", f"change of the {name} from the first cycle to the last") for name in OF
}
MEASUREMENTS = defined(CYCLES, COUNT, *OF.values(), *CHANGE.values())

_PIECE_S = 5.0
_FEWEST = 3  # blocks below which no line has a scatter
_TESTS = 2  # of each figure at each look: the line through all blocks, the newest block beside those before it
_ROWS = (*FIGURES, "amplitude")
_ROUNDING = 1e-9  # of the response's amplitude, in %: a scatter below it is that of arithmetic


class Block(NamedTuple):
    """Neighbouring cycles: how many there are, after how many others, means and standard deviations by figure."""

    after: int
    cycles: int
    mean: Mapping[str, float]
    std: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Change:
    """How far a figure has moved, in % of the response's amplitude, with its standard uncertainty and its freedom."""

    percent: float
    std: float
    freedom: int

    def chance(self, allowed: float) -> float:
        """How likely so large a change is at most where the figure has moved by no more than allowed."""
        beyond = max(0.0, abs(self.percent) - allowed)
        return chance_beyond(beyond / max(self.std, _ROUNDING), self.freedom)


def run(
    rig: Rig,
    *,
    cycles: Annotated[int, Interval(ge=2, le=1_000_000_000)] = 10_000,
    pattern: Literal["sine", "triangle", "square"] = "sine",
    frequency_hz: Positive = 1.0,
    amplitude: PositivePercent = 40.0,
    bias: Percent | None = None,
    keep_every: Annotated[int, Interval(ge=2, le=1_000_000)] = 1000,
    figures: tuple[_Figure, ...] = FIGURES,
    stop_at: NotNegativePercent | None = 10.0,
    false_stop: Annotated[float, Interval(gt=0.0, lt=1.0)] = 0.01,
    warm_up_s: NotNegative = 0.0,
    full_command: Positive | None = None,
    rate_hz: Positive | None = None,
) -> None:
    """Drive the cycles.

    Args:
        rig: the bench.
        cycles: how many.
        pattern: one cycle of it, from its lowest level up and back.
        frequency_hz: of the cycles; the nearest whose period is a whole number of samples, at least 20.
        amplitude: in % of full command.
        bias: about which level, in % of full command from neutral. When not given neutral, or the middle of a one-way
            command.
        keep_every: cycles in a block: the first one is kept at the full rate, figures are means over the block.
        figures: those that may stop the run.
        stop_at: change of a figure, in % of the response's amplitude, beyond which the run ends; without it none does.
        false_stop: highest probability that a run is stopped although no figure has moved by so much; for all figures
            and blocks together.
        warm_up_s: time at the first level before anything is measured, in s.
        full_command: what 100 % is, in the unit of the command; the farther end of its range when not given.
        rate_hz: sample rate; that of the bench when not given.
    """
    rate_hz = rig.actual_rate_hz(rate_hz)
    scale = scale_of(rig, full_command)
    check_stands(scale, "an endurance run", "drive it in a closed loop")
    middle = scale.centre if bias is None else scale.middle("bias", bias)
    size = scale.amplitude_about("amplitude", amplitude, middle)
    cycle = middle + size * _shape(pattern, _samples(frequency_hz, rate_hz))
    period_s = len(cycle) / rate_hz
    done = [block_of(part) for part in rig.finished if part["kind"] == "cycle"]
    counted = sum(block.cycles for block in done)
    settling = math.ceil(rig.settling_s / period_s) + 1
    left = cycles - counted + settling
    plan = {"cycles": cycles, "done before": counted, "period_s": period_s}
    path = joined(rig, rate_hz, warm_up_s, [np.concatenate((cycle, cycle))])
    sequence = RunSequence(rig, rate_hz, path, plan, further_s=(left - 2) * period_s)
    watch = _Watch(figures, stop_at, false_stop / (_TESTS * len(figures) * math.ceil(cycles / keep_every)), done)
    if counted < cycles and not watch.has_moved:
        sequence.warm_up(float(cycle[0]), warm_up_s)
        sequence.say(f"{cycles - counted} cycles of {period_s:.4g} s")
        _drive(rig, rate_hz, cycle, range(counted, cycles), keep_every, settling, watch)
    sequence.finish()


def _drive(rig: Rig, rate_hz: float, cycle: Array, todo: range, keep_every: int, settling: int, watch: _Watch) -> None:
    """Cycles without a gap: some to settle in, then block by block until the last one, or until a figure has moved."""
    samples = len(cycle)
    kept = {"after": settling * samples, "first": samples, "of": keep_every * samples,
            "last": (settling + 1) * samples}  # fmt: skip
    most = max(1, round(_PIECE_S * rate_hz / samples))
    commands = (np.tile(cycle, count) for count in chain([settling], _pieces(todo, keep_every, most, watch)))
    stream = rig.stream(commands, rate_hz, part={"kind": "cycles", ROWS_KEPT: kept})
    next(stream)
    block, after = _Figures(), todo.start
    for found in stream:
        if watch.has_moved:
            continue  # it was under way
        block.add(found.values(rig.command.name), found.values(rig.response.name), samples)
        at = after + block.cycles
        if at % keep_every == 0 or at == todo.stop:
            part = {"kind": "cycle", "after": after, "cycles": block.cycles, **block.statistics}
            rig.mark(samples, part)
            watch.see(block_of(part))
            rig.progress(0.0, f"{at} of {todo.stop} cycles")
            block, after = _Figures(), at
    if watch.has_moved:
        rig.note("stopped on drift", figure=watch.has_moved, after_cycles=after)


def _pieces(todo: range, keep_every: int, most: int, watch: _Watch) -> Iterator[int]:
    """How many cycles are driven at once: blocks from where they begin, cut where they are long."""
    at = todo.start
    while at < todo.stop and not watch.has_moved:
        count = min(most, keep_every - at % keep_every, todo.stop - at)
        at += count
        yield count


def _samples(frequency_hz: float, rate_hz: float) -> int:
    samples = round(rate_hz / frequency_hz)
    if samples < 20:
        raise SettingError(
            f"setting frequency_hz: {frequency_hz:g} Hz has {rate_hz / frequency_hz:.3g} samples a cycle at "
            f"{rate_hz:g} Hz; at least 20 are needed, at most {rate_hz / 20.0:g} Hz"
        )
    return samples


def _shape(pattern: str, samples: int) -> Array:
    """One cycle between −1 and 1, from its lowest level on."""
    phase = np.arange(samples) / samples
    return {
        "sine": -np.cos(2.0 * math.pi * phase),
        "triangle": 1.0 - 2.0 * np.abs(2.0 * phase - 1.0),
        "square": np.where(phase < 0.5, -1.0, 1.0),
    }[pattern]


def _about_the_first(phase_deg: Array) -> Array:
    """The same phases within half a turn of the first, so that none jumps at ±180°."""
    return np.asarray(phase_deg[0] + np.remainder(phase_deg - phase_deg[0] + 180.0, 360.0) - 180.0)


class _Figures:
    """The figures of a block's cycles, as they come."""

    def __init__(self) -> None:
        self._found: list[Array] = []

    @property
    def cycles(self) -> int:
        """How many were added."""
        return sum(found.shape[1] for found in self._found)

    @property
    def statistics(self) -> dict[str, dict[str, float]]:
        """Mean and standard deviation over the cycles, by figure."""
        found = np.concatenate(self._found, axis=1)
        found[1] = _about_the_first(found[1])
        mean, std = found.mean(axis=1), found.std(axis=1, ddof=min(1, found.shape[1] - 1))
        return {"mean": dict(zip(_ROWS, mean, strict=True)), "std": dict(zip(_ROWS, std, strict=True))}

    def add(self, command: Array, response: Array, samples: int) -> None:
        """Whole cycles of so many samples, as they were driven and read."""
        self._found.append(figures_of(command.reshape(-1, samples), response.reshape(-1, samples)))


def figures_of(command: Array, response: Array) -> Array:
    """Gain, phase in °, offset, residual and amplitude of cycles, shape (5, n); both are of shape (n, samples)."""
    samples = command.shape[1]
    turn = np.exp(-2j * math.pi * np.arange(samples) / samples) * 2.0 / samples
    answer = response @ turn
    ratio = answer / (command @ turn)
    offset = response.mean(axis=1)
    amplitude = np.abs(answer)
    residual = np.sqrt(np.maximum(np.mean((response - offset[:, None]) ** 2, axis=1) - amplitude**2 / 2.0, 0.0))
    return np.stack([np.abs(ratio), np.degrees(np.angle(ratio)), offset, residual, amplitude])


def block_of(part: Mapping[str, Any]) -> Block:
    """A block as it stands in the recording."""
    return Block(int(part["after"]), int(part["cycles"]), part["mean"], part["std"])


class _Watch:
    """Looks at the blocks after each of them; the first figure that has moved too far ends the run."""

    def __init__(self, figures: Sequence[str], allowed: float | None, chance: float, done: Sequence[Block]) -> None:
        self._figures, self._allowed, self._chance = figures, allowed, chance
        self._blocks: list[Block] = []
        self.has_moved = ""
        for block in done:
            self.see(block)

    def see(self, block: Block) -> None:
        """One block more."""
        self._blocks.append(block)
        if self._allowed is None or self.has_moved or len(self._blocks) < _FEWEST:
            return
        for figure in self._figures:
            changes = along(self._blocks, figure), of_newest(self._blocks, figure)
            if min(change.chance(self._allowed) for change in changes) < self._chance:
                self.has_moved = figure
                return


def along(blocks: Sequence[Block], figure: str) -> Change:
    """From the first cycle to the last, by the line through the means of at least three blocks."""
    at, values, weights = _columns(blocks, figure)
    line = weighted_line(at, values, weights)
    cycles = blocks[-1].after + blocks[-1].cycles - blocks[0].after
    std = line.slope_std() * math.sqrt(colour_factor(line.residuals * np.sqrt(weights)))
    return Change(cycles * line.slope, cycles * std, line.freedom)


def of_newest(blocks: Sequence[Block], figure: str) -> Change:
    """Of the newest block beside the mean of at least two before it, by the scatter of these."""
    _, values, weights = _columns(blocks, figure)
    before, own = values[:-1], weights[:-1]
    mean, freedom = float(np.average(before, weights=own)), len(before) - 1
    variance = float(own @ (before - mean) ** 2) / freedom
    std = math.sqrt(variance * (1.0 / weights[-1] + 1.0 / own.sum()))
    return Change(float(values[-1]) - mean, std, freedom)


def _columns(blocks: Sequence[Block], figure: str) -> tuple[Array, Array, Array]:
    """Middle cycle of each block, mean of the figure in % of the response's first amplitude, weight."""
    first = blocks[0].mean
    unit = {"gain": first["gain"], "phase": math.degrees(1.0)}.get(figure, first["amplitude"]) or math.nan
    at, values, weights = _trend(blocks, figure)
    return at, 100.0 * values / unit, weights


def _trend(blocks: Sequence[Block], figure: str) -> tuple[Array, Array, Array]:
    """Middle cycle, mean of the figure, and number of cycles of each block."""
    values = np.array([block.mean[figure] for block in blocks])
    if figure == "phase":
        values = _about_the_first(values)
    cycles = np.array([float(block.cycles) for block in blocks])
    return np.array([block.after for block in blocks]) + cycles / 2.0, values, cycles


def evaluate(recording: Recording) -> Findings:
    """Each figure over the whole run, how far it has moved, and its trend."""
    blocks = [block_of(part) for part in parts_of(recording, "cycle")]
    measured = [COUNT.of(sum(block.cycles for block in blocks), 0.0)]
    measured += [_mean(recording, blocks, figure) for figure in FIGURES]
    measured += [_drift(blocks, figure) for figure in FIGURES] if len(blocks) >= _FEWEST else []
    curves = []
    for figure in FIGURES:
        cycle, values, _ = _trend(blocks, figure)
        curves.append({
            "label": figure, "response_unit": _unit(recording, figure), "cycle": cycle, "measured": values,
            "std": np.array([block.std[figure] for block in blocks]),
        })  # fmt: skip
    return Findings(tuple(measured), {"trend": curves}, _notes(recording), departures(recording))


def _mean(recording: Recording, blocks: Sequence[Block], figure: str) -> Measured:
    """Over all cycles, its uncertainty by the scatter of the blocks."""
    command, response = roles_of(recording)
    _, values, weights = _trend(blocks, figure)
    mean = float(np.average(values, weights=weights))
    enough = len(blocks) >= _FEWEST
    std = math.sqrt(weights @ (values - mean) ** 2 / (len(blocks) - 1) / weights.sum()) if enough else None
    share = calibration_share(response)
    calibration = {
        "gain": math.hypot(share, calibration_share(command)) * mean, "phase": 0.0, "residual": share * mean,
    }.get(figure, calibration_std(response))  # fmt: skip
    return OF[figure].at("", _unit(recording, figure)).of(mean, std, calibration=calibration)


def _drift(blocks: Sequence[Block], figure: str) -> Measured:
    change = along(blocks, figure)
    if not math.isfinite(change.percent):
        return CHANGE[figure].of(None)
    return CHANGE[figure].of(change.percent, change.std)


def _unit(recording: Recording, figure: str) -> str:
    command, response = roles_of(recording)
    return {"gain": f"{response.unit} per {command.unit}", "phase": "deg"}.get(figure, response.unit)


def _notes(recording: Recording) -> tuple[Note, ...]:
    allowed = settings_of(recording)["stop_at"]
    return tuple(
        Note(
            "Stopped after {cycles} cycles: {figure} had moved by more than {allowed:g} % of the response's amplitude.",
            cycles=found["after_cycles"], figure=found["figure"], allowed=allowed,
        )
        for found in noted(recording, "stopped on drift")[-1:]
    )  # fmt: skip
