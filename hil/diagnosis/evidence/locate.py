"""Where a simulation and its recordings part: in time, in frequency, in operating region, in the signal chain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from hil.cores import parallel_map
from hil.diagnosis.intake.problem import Problem
from hil.diagnosis.thresholds import LISTED, TINY
from hil.identification.preparation.experiment import Experiment
from hil.language.words import marked
from hil.physics.simulate import ActiveEffect
from hil.record.recording import Array
from hil.signals.products import in_parts, triangular
from hil.signals.runs import runs

_BLOCK_S = 0.5
_FALSE_DISCOVERIES = 0.01
_REVERSAL_S = 0.3
_KNOTS = 7
_SEGMENT = 8192  # samples


@dataclass(frozen=True, slots=True)
class Where:
    """Places of a difference.

    Attributes:
        recording: where it is largest; `time_s` are stretches of that recording.
        frequency_hz: the band that holds nine tenths of its energy.
        region: in words: "reversals of motion", "high level", …
        shares: energy of the difference over time spent, by region; 1 is nothing special.
    """

    recording: str
    time_s: tuple[tuple[float, float], ...]
    frequency_hz: tuple[float, float]
    region: str
    shares: dict[str, float]


@dataclass(frozen=True, slots=True)
class StageShare:
    """How much of the misfit a free disturbance at a hook explains, as a curve over what passes there.

    Attributes:
        hook, stage: the place in the chain.
        share: of the misfit's variance, per what chance would give already taken off.
        level, rising, falling: the disturbance (shape (knots,)) over the value at the hook, by direction of motion.
    """

    hook: str
    stage: str
    unit: str
    share: float
    level: Array
    rising: Array
    falling: Array


def locate(problem: Problem, difference: Sequence[Array]) -> Where:
    """Places of a difference between two outputs, given in units of the noise for each experiment."""
    energies = [float(d @ d) for d in difference]
    k = int(np.argmax(energies))
    shares = _region_shares(problem, difference)
    return Where(
        problem.experiments[k].name,
        _intervals(problem.experiments[k].time_s, difference[k]),
        _band(problem, difference),
        _in_words(shares),
        shares,
    )


def _intervals(time_s: Array, d: Array) -> tuple[tuple[float, float], ...]:
    """Stretches in which the difference is beyond chance, the largest of them, in order of time."""
    labels = ((time_s - time_s[0]) / _BLOCK_S).astype(np.int64)
    counts = np.bincount(labels)
    sums = np.bincount(labels, d**2)
    used = counts > 0
    p = np.ones(len(counts))
    p[used] = chdtrc(counts[used], sums[used] + counts[used] - 1.0)
    beyond = _false_discovery_rates(p) < _FALSE_DISCOVERIES
    found = []
    for start, stop in runs(beyond):
        energy = float(sums[start:stop].sum())
        first, last = time_s[0] + start * _BLOCK_S, min(time_s[0] + stop * _BLOCK_S, time_s[-1])
        found.append((energy, (round(float(first), 3), round(float(last), 3))))
    largest = sorted(found, reverse=True)[:LISTED]
    return tuple(sorted(interval for _, interval in largest))


def _false_discovery_rates(p: Array) -> Array:
    """The rate of false discoveries at which each is one (Benjamini, Hochberg, JRSS B 57, 1995), shape (n,)."""
    order = np.argsort(p)[::-1]
    rates = np.empty(len(p))
    rates[order] = np.minimum.accumulate(p[order] * len(p) / np.arange(len(p), 0, -1))
    return rates


def _band(problem: Problem, difference: Sequence[Array]) -> tuple[float, float]:
    """The band from 5 to 95 % of the difference's energy, its mean included."""
    f, power = (np.concatenate(each) for each in zip(*map(_spectrum, problem.experiments, difference), strict=True))
    order = np.argsort(f)
    total = np.cumsum(power[order])
    if total[-1] <= 0.0:
        return 0.0, 0.0
    low, high = np.searchsorted(total, [0.05 * total[-1], 0.95 * total[-1]])
    return float(f[order][low]), float(f[order][min(high, len(f) - 1)])


def _spectrum(e: Experiment, values: Array) -> tuple[Array, Array]:
    """Frequencies in Hz and the energy at each, from half overlapping segments (Welch, 1967), shape (m,) each.

    Written here since importing `scipy.signal` takes a second.
    """
    count = min(len(values), _SEGMENT)
    window = np.hanning(count + 1)[:-1]
    segments = np.lib.stride_tricks.sliding_window_view(values, count)[:: max(count - count // 2, 1)]
    power = np.mean([np.abs(np.fft.rfft(window * segment)) ** 2 for segment in segments], axis=0)
    power[1 : (count + 1) // 2] *= 2.0  # of both signs; the mean and the highest of an even number have one
    power *= len(values) / (count * float(window @ window))
    return np.asarray(np.fft.rfftfreq(count, e.interval_s), np.float64), power


def _region_shares(problem: Problem, difference: Sequence[Array]) -> dict[str, float]:
    """Energy share over time share for each region."""
    energy: dict[str, float] = {}
    time: dict[str, float] = {}
    total_energy, total_time = 0.0, 0.0
    middle = _middle(problem)
    largest = max(float(np.abs(e.output - middle).max()) for e in problem.experiments)
    for e, d in zip(problem.experiments, difference, strict=True):
        masks = _regions(e, e.output - middle, largest)
        total_energy += float(d @ d)
        total_time += len(d)
        for name, mask in masks.items():
            energy[name] = energy.get(name, 0.0) + float(d[mask] @ d[mask])
            time[name] = time.get(name, 0.0) + float(mask.sum())
    if total_energy == 0.0:
        return dict.fromkeys(energy, 1.0)
    return {name: (energy[name] / total_energy) / (time[name] / total_time) if time[name] else 0.0 for name in energy}


def _middle(problem: Problem) -> float:
    """Zero for two-sided outputs, the middle of the span for one-sided ones."""
    low = min(float(e.output.min()) for e in problem.experiments)
    high = max(float(e.output.max()) for e in problem.experiments)
    return 0.0 if low < -0.2 * high else 0.5 * (low + high)


def _regions(e: Experiment, output: Array, largest: float) -> dict[str, Array]:
    window = max(3, int(0.06 / e.interval_s) | 1)
    smooth = np.convolve(np.pad(output, window // 2, mode="edge"), np.full(window, 1.0 / window), "valid")
    speed = np.gradient(smooth, e.time_s)
    fast = np.quantile(np.abs(speed), 0.85)
    still = 0.02 * max(float(np.abs(speed).max()), TINY)
    level = np.abs(smooth) / largest
    since = _since_reversal(e.time_s, e.on_grid_input())
    progress = (e.time_s - e.time_s[0]) / max(e.duration_s, TINY)
    return {
        marked("high level"): level > 0.7,
        marked("around zero"): level < 0.1,
        marked("positive side"): smooth > 0.1 * largest,
        marked("negative side"): smooth < -0.1 * largest,
        marked("fast motion"): np.abs(speed) >= max(fast, still),
        marked("slow motion or rest"): np.abs(speed) < still,
        marked("reversals of motion"): since < _REVERSAL_S,
        marked("rising"): speed > still,
        marked("falling"): speed < -still,
        marked("late in the recording"): progress > 0.7,
    }


def _since_reversal(time_s: Array, command: Array) -> Array:
    """Time since the command last turned round."""
    moves = np.sign(np.diff(command, prepend=command[0]))
    moving = np.flatnonzero(moves)
    since = np.full(len(time_s), np.inf)
    if moving.size < 2:
        return since
    turns = moving[1:][moves[moving[1:]] != moves[moving[:-1]]]
    if turns.size:
        last = np.searchsorted(turns, np.arange(len(time_s)), side="right") - 1
        seen = last >= 0
        since[seen] = time_s[seen] - time_s[turns[last[seen]]]
    return since


def _in_words(shares: dict[str, float]) -> str:
    special = sorted(((value, name) for name, value in shares.items() if value > 1.5), reverse=True)
    return special[0][1] if special else "everywhere"


def stages(
    problem: Problem, parameters: dict[str, float], effects: Sequence[ActiveEffect], left: Array
) -> tuple[StageShare, ...]:
    """A free disturbance at each hook in turn: how much of what is left does it explain, and with which shape.

    The disturbance is any function of the value at the hook and its direction of motion, in straight pieces.
    Best first.
    """
    base = problem.residuals(parameters, effects, factor=problem.coarse_factor)
    traces = problem.traces(parameters, effects)
    at = _Point(problem, parameters, effects, left, base)
    # one stage after another: the slopes of one are as large as all recordings times its knots
    found = [_stage(at, k, [rows[k] for rows in traces]) for k in range(len(problem.plant.hooks))]
    return tuple(sorted(found, key=lambda s: -s.share))


@dataclass(frozen=True, slots=True)
class _Point:
    """A model, what it leaves (`left`), and its residuals with coarse sub-steps, from which slopes are taken."""

    problem: Problem
    parameters: dict[str, float]
    effects: Sequence[ActiveEffect]
    left: Array
    base: Array


def _stage(at: _Point, k: int, traces: Sequence[Array]) -> StageShare:
    """`traces`: what passes the hook in every recording."""
    hook, left = at.problem.plant.hooks[k], at.left
    values = np.concatenate(traces)
    knots = np.unique(np.quantile(values, np.linspace(0.0, 1.0, _KNOTS)))
    if len(knots) < 2:
        knots = np.array([values[0] - 1.0, values[0] + 1.0])
    size = 1e-3 * hook.full_scale
    columns = np.empty((2 * len(knots), len(left)))

    def fill(i: int) -> None:
        rising, j = i < len(knots), i % len(knots)
        shapes = [_hat(trace, knots, j, rising) * size for trace in traces]
        factor = at.problem.coarse_factor
        moved = at.problem.residuals(at.parameters, at.effects, factor=factor, inject=(hook.name, shapes))
        columns[i] = (moved - at.base) / size

    parallel_map(fill, range(len(columns)))
    used = np.array([np.linalg.norm(column) > 1e-9 for column in columns])
    solution = np.zeros(len(columns))
    reduced = triangular(np.vstack([columns[used, part], -left[part]]).T for part in in_parts(len(left)))
    solution[used] = np.linalg.lstsq(reduced[:, :-1], reduced[:, -1], rcond=1e-8)[0]
    remaining = left + solution @ columns
    gained = float(left @ left - remaining @ remaining) - int(used.sum())
    share = max(0.0, gained / max(float(left @ left) - len(left), float(np.sqrt(2 * len(left)))))
    n = len(knots)
    unit = at.problem.model.resolved_unit(hook.unit)
    return StageShare(hook.name, hook.stage, unit, min(share, 1.0), knots, solution[:n], solution[n:])


def _hat(values: Array, knots: Array, j: int, rising: bool) -> Array:
    height = np.zeros(len(knots))
    height[j] = 1.0
    up = np.diff(values, prepend=values[0]) >= 0.0
    return np.interp(values, knots, height) * np.where(up if rising else ~up, 1.0, 0.0)
