"""Causes without a law: samples or commands held or lost at random moments, and tones with a phase of their own.

They happen when they happen, so no simulation can foresee them; they are recognised by what they leave behind.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import linregress

from hil.diagnose.measures import share_left
from hil.diagnose.problem import Problem
from hil.diagnose.runs import runs
from hil.diagnose.search import Fitted, pool, residuals_of
from hil.identify.experiment import Experiment
from hil.identify.lines import common_line
from hil.identify.noise import resolution, white_floor
from hil.record.recording import Array

Mask = NDArray[np.bool_]

# A noisy channel shows the same value so often in a row only when nobody has measured it anew: chance would make
# such a run in one of so many recordings.
_STALE_RUN = 4
_CHANCE_RUNS = 1e-4
_LEAST_STALE = 3
# In bursts of misfit a run is telling already when chance makes so few of them there, in a channel that seldom repeats.
_CHANCE_IN_BURSTS, _TELLING_REPEAT = 0.3, 0.3
_NOISE_OVER_RESOLUTION = 2.0
# Bursts of misfit: blocks of this length, those beyond this many times the noise variance.
_BLOCK_S = 0.1
# A jump is this share of the command's range; what comes with so many of them, and hardly without, has a law.
_JUMP, _NEARLY_ALL = 0.1, 0.75
# The first look must take this share of the misfit in the bursts that it is made at.
_HOPE = 0.25
# A line and its uncertainty take so many levels.
_LEAST_LEVELS = 3
# A step so many times the one that the model was identified with, and this share of the noise, is a coarser channel.
_COARSER, _TELLING_STEP = 4.0, 0.5
# An offset of half a step, to within this share of a step, is the converter's own.
_HALF_A_STEP = 0.1
_BURST = 4.0
_SPARSE_SHARE, _SPARSE_TIME = 0.6, 0.45
_LOOK_BACK_S = 0.4
_BACK_S = 0.024
_LASTING_S = (0.03, 0.05, 0.08, 0.12, 0.16, 0.21, 0.27, 0.34, 0.43, 0.55, 0.75, 1.0, 1.4)
# Events may leave so much: a tone has more harmonics, a held command a start between two samples.
TOLERANCE_OF_EVENTS = {"periodic_disturbance": 0.1, "dropout": 0.15}
# The share of the misfit that events must take before the rest is looked at again without them.
_WORTH_A_SECOND_LOOK = 0.3
_LEAST_TONE_RATIO, _FEWEST_TONE_CYCLES = 60.0, 4
_START_DIES_S = (0.1, 0.3, 1.0)


@dataclass(frozen=True, slots=True)
class Spell:
    """A stretch of a recording in which something stood still."""

    recording: str
    start_s: float
    stop_s: float


@dataclass(frozen=True, slots=True)
class Events:
    """Events that explain a misfit.

    Attributes:
        name: of the effect. `stage`, `hook`: where in the chain.
        spells: when. `values`: what is known of them: name → (value, std, unit).
        residuals: whitened, with the events taken into account, shape (n,).
        rest: the experiments without the events, to look at again.
        sentence: for the operator. `equation`: for the engineer.
        shows_as: an effect of the library that is there beside them and only another side of them.
    """

    name: str
    stage: str
    hook: str
    spells: tuple[Spell, ...]
    values: dict[str, tuple[float, float | None, str]]
    residuals: Array
    rest: tuple[Experiment, ...]
    sentence: str
    equation: str
    shows_as: str = ""

    @property
    def told(self) -> tuple[str, str]:
        """Effects that need no telling beside these events."""
        return self.name, self.shows_as

    @property
    def chi2(self) -> float:
        """Sum of squared residuals."""
        return float(self.residuals @ self.residuals)


def recognised(
    problem: Problem, models: Sequence[Fitted], beyond: float, *, commands: bool = True
) -> tuple[Events | None, Events | None]:
    """Events that explain, beside one of these models, a misfit given as variance beyond the noise; or a part of it.

    Args:
        problem: the question.
        models: the nominal one first.
        beyond: the misfit.
        commands: whether to look for lost commands, which takes longest.
    """
    part: Events | None = None
    lost = commands and not _every_time(problem, models[0])
    for beside in models:
        for events in (tone, held_outputs, held_commands) if lost else (tone, held_outputs):
            found = events(problem, beside)
            if found is None:
                continue
            left = share_left(problem, found.chi2, beyond)
            if left <= TOLERANCE_OF_EVENTS[found.name]:
                return found, None
            if left <= 1.0 - _WORTH_A_SECOND_LOOK and (part is None or found.chi2 < part.chi2):
                part = found
    return None, part


# -- samples that were not measured --------------------------------------------------------------------------


def without_stale(experiments: Sequence[Experiment]) -> tuple[tuple[Experiment, ...], tuple[Spell, ...]]:
    """The experiments with samples ignored that only repeat the one before, and where those are."""
    kept, spells = [], []
    for e in experiments:
        repeated = _stale_runs(e.output)
        if len(repeated) < _LEAST_STALE:
            kept.append(e)
            continue
        stale = np.zeros(len(e.output), dtype=np.bool_)
        for start, stop in repeated:
            stale[start + 1 : stop] = True
            spells.append(Spell(e.name, float(e.time_s[start]), float(e.time_s[stop - 1])))
        kept.append(without(e, stale))
    return tuple(kept), tuple(spells)


def without(e: Experiment, samples: Mask) -> Experiment:
    """An experiment with more samples ignored."""
    return replace(e, ignored=samples if e.ignored is None else e.ignored | samples)


def _stale_runs(values: Array) -> list[tuple[int, int]]:
    """Runs of identical values in a channel whose noise is well above its resolution."""
    steps = np.abs(np.diff(values))
    moving = steps[steps > 0.0]
    floor = white_floor(values)
    if not moving.size or floor < _NOISE_OVER_RESOLUTION * float(moving.min()):
        return []
    longest_by_chance = 1.0 + np.log(_CHANCE_RUNS / len(values)) / np.log(_same_again(steps, floor))
    least = max(_STALE_RUN, int(np.ceil(longest_by_chance)))
    ends = (values.max(), values.min())
    return [
        (start, stop + 1)
        for start, stop in runs(steps == 0.0)
        if stop - start >= least - 1 and values[start] not in ends
    ]


# -- a channel that resolves less than it did ----------------------------------------------------------------


def coarse_step(problem: Problem, recorded: Sequence[Experiment]) -> tuple[float, float] | None:
    """The step in which the output comes and its uncertainty, where the model was identified on a finer channel.

    `recorded`: the experiments as they came, with nothing taken out of them.
    """
    known = problem.model.noise
    before = float(problem.model.origin.get("resolution", 0.0))
    if known is None or before <= 0.0:
        return None
    steps = [resolution(e.output) for e in recorded]
    step = float(np.median(steps))
    if not (step > _COARSER * before and step > _TELLING_STEP * known.std):
        return None
    return _lattice(np.unique(np.concatenate([e.output for e in recorded])), step, before)


def _lattice(levels: Array, step: float, rounding: float) -> tuple[float, float]:
    """The distance of levels that are whole multiples of it apart, about `step`; rounded to `rounding` in their turn.

    A line through the levels over their number, with its standard uncertainty.
    """
    number = np.concatenate([[0.0], np.cumsum(np.rint(np.diff(levels) / step))])
    if len(levels) < _LEAST_LEVELS:
        return step, rounding / float(np.sqrt(6.0))
    line = linregress(number, levels)
    of_rounding = rounding / float(np.sqrt(12.0 * len(number)) * np.std(number))
    return float(line.slope), max(float(line.stderr), of_rounding)


def coarse(problem: Problem, step: float, std: float, chosen: Fitted) -> Events:
    """The finding for an output that comes in coarse steps of this size, beside what was chosen.

    A converter that cuts off what is below its level reads half a step too little: no offset of the sensor.
    """
    last, unit = problem.plant.hooks[-1], problem.plant.output.unit
    offset = sum(v[0] for term, v in zip(chosen.terms, chosen.values, strict=True) if term.name == "sensor_offset")
    cut = abs(abs(offset) - 0.5 * step) < _HALF_A_STEP * step
    how = (
        f", and reads {abs(offset):.3g} {unit} too {'little' if offset < 0.0 else 'much'}: it does not round"
        if cut
        else ""
    )
    return Events(
        "quantisation", last.stage, last.name, (), {"step": (step, std, unit)}, chosen.residuals, problem.experiments,
        f"The signal comes in steps of {step:.3g} {unit}, far coarser than when the model was identified{how}.",
        "y = q·⌊u/q⌋" if cut and offset < 0.0 else "y = q·⌈u/q⌉" if cut else "y = q·round(u/q)",
        shows_as="sensor_offset" if cut else "",
    )  # fmt: skip


# -- commands that did not arrive ----------------------------------------------------------------------------


def held_commands(problem: Problem, around: Fitted) -> Events | None:
    """Stretches in which the command stood still on its way; None when the misfit does not come in bursts.

    Every burst gets its own start and length; one simulation tries one offset and length at all bursts at once.
    """
    bursts = _all_bursts(problem, around)
    count = sum(map(len, bursts))
    if count < _LEAST_STALE or not _is_sparse(problem, around.residuals, bursts):
        return None
    holds = _best_holds(problem, around, bursts)
    if holds is None:
        return None
    rest = _held(problem, holds)
    spells = tuple(
        Spell(e.name, float(e.time_s[0] + start * e.drive.interval_s), float(e.time_s[0] + stop * e.drive.interval_s))
        for e, own in zip(problem.experiments, holds, strict=True)
        for start, stop in own
        if stop > start
    )
    if len(spells) < _LEAST_STALE:
        return None
    values = _how_often(spells)
    first = problem.plant.hooks[0]
    return Events(
        "dropout", first.stage, first.name, spells, values, residuals_of(problem, around, experiments=rest), rest,
        f"The command did not always arrive: {len(spells)} times the valve stood on the last one, "
        f"{values['lasting'][0]:.2g} s on average.",
        "u(t) = u(t_k) for t_k ≤ t < t_k + d_k, at random t_k",
    )  # fmt: skip


def held_outputs(problem: Problem, around: Fitted) -> Events | None:
    """Samples that repeat the one before in bursts of misfit, more often than a coarse channel repeats itself there.

    Where noise is hardly above the resolution `without_stale` needs longer runs than a short loss makes.
    """
    residuals, rest, spells = around.residuals.copy(), [], []
    for k, (e, part) in enumerate(zip(problem.experiments, problem.output_slices(), strict=True)):
        memory = len(problem.noises[k].colour)
        stale = np.zeros(len(e.output), dtype=np.bool_)
        for start, stop in _repeats_in_bursts(e.output, _bursts(problem, around.residuals, k)):
            residuals[part][start + 1 : stop + memory] = 1.0  # as noise would be; nothing was measured there
            stale[start + 1 : stop + memory] = True
            spells.append(Spell(e.name, float(e.time_s[start]), float(e.time_s[stop - 1])))
        rest.append(without(e, stale))
    if len(spells) < _LEAST_STALE:
        return None
    return stale_outputs(spells, problem, residuals, tuple(rest))


def _repeats_in_bursts(values: Array, bursts: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """Runs of identical values in these stretches, so long that chance makes hardly one of them."""
    steps = np.abs(np.diff(values))
    looked_at = sum(stop - start for start, stop in bursts)
    same_again = _same_again(steps, white_floor(values))
    if not looked_at or same_again > _TELLING_REPEAT:
        return []
    least = max(_STALE_RUN - 1, 1 + int(np.ceil(np.log(_CHANCE_IN_BURSTS / looked_at) / np.log(same_again))))
    inside = np.zeros(len(steps), dtype=np.bool_)
    for start, stop in bursts:
        inside[max(start - 1, 0) : stop] = True
    return [(start, stop + 1) for start, stop in runs((steps == 0.0) & inside) if stop + 1 - start >= least]


def _same_again(steps: Array, floor: float) -> float:
    """The probability that two readings of white noise agree within the resolution."""
    moving = steps[steps > 0.0]
    return float(moving.min()) / (2.0 * np.sqrt(np.pi) * floor) if moving.size and floor > 0.0 else 1.0


def stale_outputs(spells: Sequence[Spell], problem: Problem, residuals: Array, rest: tuple[Experiment, ...]) -> Events:
    """The finding for samples that were not measured anew and are left out of the rest."""
    values = _how_often(spells)
    last = problem.plant.hooks[-1]
    return Events(
        "dropout", last.stage, last.name, tuple(spells), values, residuals, rest,
        f"Samples were not measured anew: {len(spells)} times the recording repeats its last value, "
        f"{values['lasting'][0]:.2g} s on average.",
        "y(t) = y(t_k) for t_k ≤ t < t_k + d_k, at random t_k",
    )  # fmt: skip


def _how_often(spells: Sequence[Spell]) -> dict[str, tuple[float, float | None, str]]:
    """Number and length of spells."""
    lasting = np.array([spell.stop_s - spell.start_s for spell in spells])
    return {
        "events": (float(len(spells)), None, "1"),
        "lasting": (float(lasting.mean()), float(lasting.std() / np.sqrt(len(spells))), "s"),
        "longest": (float(lasting.max()), None, "s"),
    }


def _bursts(problem: Problem, residuals: Array, k: int) -> list[tuple[int, int]]:
    """(first, last) samples of stretches in which the misfit is far beyond the noise."""
    part, e = residuals[problem.output_slices()[k]], problem.experiments[k]
    size = max(2, round(_BLOCK_S / e.drive.interval_s))
    blocks = len(part) // size
    power = np.mean(part[: blocks * size].reshape(blocks, size) ** 2, axis=1)
    merged: list[tuple[int, int]] = []
    for start, stop in runs(power > _BURST):
        if merged and start - merged[-1][1] <= 1:
            merged[-1] = merged[-1][0], stop
        else:
            merged.append((start, stop))
    return [(start * size, stop * size) for start, stop in merged]


def _is_sparse(problem: Problem, residuals: Array, bursts: Sequence[Sequence[tuple[int, int]]]) -> bool:
    """Whether most of the misfit lies in a small part of the time."""
    inside, time = 0.0, 0
    for part, own in zip(problem.output_slices(), bursts, strict=True):
        r = residuals[part]
        for start, stop in own:
            inside += float(r[start:stop] @ r[start:stop]) - (stop - start)
            time += stop - start
    beyond = float(residuals @ residuals) - len(residuals)
    return inside > _SPARSE_SHARE * beyond and time < _SPARSE_TIME * problem.size


def _all_bursts(problem: Problem, around: Fitted) -> list[list[tuple[int, int]]]:
    """The bursts of every experiment."""
    return [_bursts(problem, around.residuals, k) for k in range(len(problem.experiments))]


def _every_time(problem: Problem, around: Fitted) -> bool:
    """Whether the misfit comes with nearly every jump of the command that is large enough to show it, and hardly ever
    without one: then it has a law. What gets lost at random moments misses most jumps.
    """
    bursts = _all_bursts(problem, around)
    sizes, shown, beside = [], [], 0
    for e, own in zip(problem.experiments, bursts, strict=True):
        at, size = _jumps(e)
        back = round(_LOOK_BACK_S / e.drive.interval_s)
        felt = np.array([(start - back, stop) for start, stop in own], dtype=np.int64).reshape(-1, 2)
        jump_in_burst = (at[:, None] >= felt[None, :, 0]) & (at[:, None] < felt[None, :, 1])
        sizes.append(size)
        shown.append(jump_in_burst.any(axis=1))
        beside += int((~jump_in_burst.any(axis=0)).sum())
    size, hit = np.concatenate(sizes), np.concatenate(shown)
    if hit.sum() < _LEAST_STALE or beside > (1.0 - _NEARLY_ALL) * sum(map(len, bursts)):
        return False
    return float(hit[size >= np.median(size[hit])].mean()) > _NEARLY_ALL


def _jumps(e: Experiment) -> tuple[NDArray[np.int64], Array]:
    """Where the command jumps, by a good share of its range between two samples, and by how much."""
    steps = np.abs(np.diff(e.drive.inputs[0]))
    at = np.flatnonzero(steps > _JUMP * max(float(np.ptp(e.drive.inputs[0])), 1e-12))
    return at, steps[at]


Holds = list[list[tuple[int, int]]]
Bursts = Sequence[Sequence[tuple[int, int]]]


def _best_holds(problem: Problem, around: Fitted, bursts: Bursts) -> Holds | None:
    """For every burst the held stretch that explains most of it: a coarse look, then finer ones around the best.

    None where the first look, at every other burst, finds next to nothing.
    """
    chosen: Holds = [[(start, start) for start, _ in own] for own in bursts]
    step = [e.drive.interval_s for e in problem.experiments]
    windows = [
        [(max(start - round(_LOOK_BACK_S / dt), 0), stop + round(_LOOK_BACK_S / dt)) for start, stop in own]
        for own, dt in zip(bursts, step, strict=True)
    ]

    def costs(holds: Holds) -> list[list[float]]:
        return _costs(problem, residuals_of(problem, around, experiments=_held(problem, holds)), windows)

    best = costs(chosen)

    def keep_better(trials: Sequence[Holds], parity: int) -> None:
        """Try holds at every other burst, the ones between staying as they are: neighbours are felt in each other."""
        nonlocal best
        mixed = [_mixed(chosen, trial, parity) for trial in trials]
        before = [list(own) for own in chosen]
        for trial, tried in zip(mixed, pool().map(costs, mixed), strict=True):
            for k, own in enumerate(tried):
                for i in range(parity, len(own), 2):
                    if own[i] < best[k][i] - 2.0 * np.log(problem.size):
                        best[k][i], chosen[k][i] = own[i], trial[k][i]
        if chosen != before:
            best = costs(chosen)

    coarse_look = [
        _placed(bursts, step, back, lasting)
        for back in np.arange(-_BLOCK_S, _LOOK_BACK_S, _BACK_S)
        for lasting in _LASTING_S
    ]
    nothing_held = _of_every_other(best, bursts)
    keep_better(coarse_look, 0)
    if _of_every_other(best, bursts) > (1.0 - _HOPE) * nothing_held:
        return None
    keep_better(coarse_look, 1)
    for fine_s in (0.016, 0.008, 0.004):
        for moves in ((-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, 1)) * 2:
            for parity in (0, 1):
                keep_better([_moved(chosen, bursts, step, fine_s, moves)], parity)
    return chosen


def _of_every_other(costs: Sequence[Sequence[float]], bursts: Bursts) -> float:
    """Squared residuals at the bursts that the first look is made at, beyond what noise would make of their time."""
    noise = sum(stop - start for own in bursts for start, stop in own[::2])
    return sum(cost for own in costs for cost in own[::2]) - noise


def _mixed(holds: Holds, trial: Holds, parity: int) -> Holds:
    """Every other hold taken from the trial."""
    return [
        [tried if i % 2 == parity else held for i, (held, tried) in enumerate(zip(own, other, strict=True))]
        for own, other in zip(holds, trial, strict=True)
    ]


def _placed(bursts: Bursts, step: Sequence[float], back_s: float, for_s: float) -> Holds:
    """A hold for every burst, so long before it; none lasts longer than the burst."""
    found = []
    for own, dt in zip(bursts, step, strict=True):
        starts = [max(start - round(back_s / dt), 1) for start, _ in own]
        found.append([(a, min(a + round(for_s / dt), stop)) for a, (_, stop) in zip(starts, own, strict=True)])
    return found


def _moved(holds: Holds, bursts: Bursts, step: Sequence[float], by_s: float, moves: tuple[int, int]) -> Holds:
    """The holds with their start, end or both moved by so much, either way."""
    found = []
    for own, felt, dt in zip(holds, bursts, step, strict=True):
        by = max(1, round(by_s / dt))
        found.append(
            [
                (max(a + moves[0] * by, 1), min(z + moves[1] * by, stop)) if z > a else (a, z)
                for (a, z), (_, stop) in zip(own, felt, strict=True)
            ]
        )
    return found


def _costs(problem: Problem, residuals: Array, windows: Sequence[Sequence[tuple[int, int]]]) -> list[list[float]]:
    """Squared residuals in each window."""
    parts = [residuals[part] for part in problem.output_slices()]
    return [[float(r[a:z] @ r[a:z]) for a, z in own] for r, own in zip(parts, windows, strict=True)]


def _held(problem: Problem, holds: Holds) -> tuple[Experiment, ...]:
    """The experiments with what arrived of their commands."""
    experiments = []
    for e, own in zip(problem.experiments, holds, strict=True):
        inputs = e.drive.inputs.copy()
        for start, stop in own:
            inputs[0, start:stop] = inputs[0, start - 1]
        experiments.append(replace(e, drive=replace(e.drive, inputs=inputs)))
    return tuple(experiments)


# -- tones ---------------------------------------------------------------------------------------------------


def tone(problem: Problem, around: Fitted) -> Events | None:
    """One frequency in all recordings, harmonics included, with a phase of its own in each; None if there is none.

    Its amplitude may grow with the output, as ripple does that enters before the orifice; where it is hardly there
    without an output it is no disturbance but a gain that swings.
    """
    parts = [around.residuals[part] for part in problem.output_slices()]
    frequency = common_line(problem.experiments, parts, _LEAST_TONE_RATIO, _FEWEST_TONE_CYCLES)
    if frequency is None:
        return None
    frequency = _sharpened(problem, around.residuals, frequency)
    residuals, waves = _tone_fit(problem, around.residuals, frequency)
    amplitudes = [float(np.hypot(a[0], a[3]) * n.std) for a, n in zip(waves, problem.noises, strict=True)]
    growing = [
        float(np.hypot(a[6], a[7]) * n.std * np.sqrt(np.mean(_level(e) ** 2)))
        for a, n, e in zip(waves, problem.noises, problem.experiments, strict=True)
    ]
    if np.mean(growing) > np.mean(amplitudes):
        return None
    unit = problem.plant.output.unit
    size, spread = float(np.mean(amplitudes)), float(np.std(amplitudes) / np.sqrt(len(amplitudes)))
    longest = max(float(e.time_s[-1] - e.time_s[0]) for e in problem.experiments)
    noise = problem.noises[0].std
    count = sum(len(e.output) for e in problem.experiments)
    std_hz = float(np.sqrt(6.0 / count) * noise / max(size, 1e-12) / (np.pi * longest))
    last = problem.plant.hooks[-1]
    return Events(
        "periodic_disturbance", last.stage, last.name, (),
        {"frequency": (frequency, std_hz, "Hz"), "amplitude": (size, spread, unit)},
        residuals, without_tone(problem, around, frequency),
        f"A disturbance of {frequency:.4g} Hz with amplitude {size:.3g} {unit} runs through everything, whatever the "
        "command does.",
        "y = y₀ + a·sin(2πft + φ), φ by chance in each recording",
    )  # fmt: skip


def without_tone(problem: Problem, beside: Fitted, frequency_hz: float) -> tuple[Experiment, ...]:
    """The experiments with a tone taken out of their output, as it shows beside a model."""
    effects = [*problem.model.active_effects, *beside.effects]
    kept = []
    for e in problem.experiments:
        simulated = e.respond(problem.plant, beside.parameters, effects, factor=problem.factor)[0]
        columns = _waves(e, frequency_hz)
        solution = np.linalg.lstsq(columns, e.output - simulated, rcond=None)[0]
        kept.append(replace(e, output=e.output - columns @ solution))
    return tuple(kept)


def _sharpened(problem: Problem, residuals: Array, frequency_hz: float) -> float:
    """The frequency at which a tone takes most, on grids that become finer."""
    width = 1.0 / min(float(e.time_s[-1] - e.time_s[0]) for e in problem.experiments)
    best = frequency_hz
    for scale in (2.0, 0.2, 0.02):
        grid = best + width * scale * np.linspace(-1.0, 1.0, 41)
        left = [float(np.sum(_tone_fit(problem, residuals, f)[0] ** 2)) for f in grid]
        best = float(grid[int(np.argmin(left))])
    return best


def _tone_fit(problem: Problem, residuals: Array, frequency_hz: float) -> tuple[Array, list[Array]]:
    """Residuals without the tone, and for each recording how much there is of each wave."""
    left, found = residuals.copy(), []
    for e, part in zip(problem.experiments, problem.output_slices(), strict=True):
        columns = _waves(e, frequency_hz)
        share: Array = np.asarray(np.linalg.lstsq(columns, left[part], rcond=None)[0], dtype=np.float64)
        left[part] -= columns @ share
        found.append(share)
    return left, found


def _waves(e: Experiment, frequency_hz: float) -> Array:
    """Three harmonics, sines before cosines, the first one growing with the output, and what dies out after the start
    when a tone that enters early in the chain meets a plant at rest, shape (n, 11).
    """
    phase = 2.0 * np.pi * frequency_hz * np.outer((1.0, 2.0, 3.0), e.time_s)
    waves = np.vstack([np.sin(phase), np.cos(phase)])
    decays = np.exp(-np.outer(1.0 / np.array(_START_DIES_S), e.time_s - e.time_s[0]))
    columns: Array = np.vstack([waves, waves[[0, 3]] * _level(e), decays]).T
    return columns


def _level(e: Experiment) -> Array:
    """The output as a share of its largest magnitude."""
    level: Array = e.output / max(float(np.abs(e.output).max()), 1e-12)
    return level
