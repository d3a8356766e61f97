"""A steady characteristic from slow sweeps up and down: one smooth curve, and how far its branches lie apart.

Both branches are one curve, y = F(u ∓ h): while the command rises the response belongs to an earlier command, while it
falls as well. The half width h = w/2 + τ·speed has a part w that speed does not change (hysteresis) and a part from
whatever is late by τ. Sweeps at two speeds tell them apart. F is smoothed over all branches at once; where the width
differs from level to level, a second smooth curve says by how much.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.arrays import LEAST
from hil.errors import InputError
from hil.identification.steady.criteria import CRITERIA, EFFORT
from hil.identification.uncertainty.parametric_bootstrap import DRAWS, draws_of
from hil.record.recording import Array, Mask
from hil.signals.colour import noisy_mean
from hil.signals.products import one_blas_thread
from hil.signals.smooth_curve import Curves, Smoother


@dataclass(frozen=True, slots=True)
class Sweep:
    """Command and response over one sweep up and down, each of shape (n,); speed in the command's unit per second."""

    command: Array
    response: Array
    speed_per_s: float


@dataclass(frozen=True, slots=True)
class Standing:
    """A steady response: where the command stands, the mean there with its standard uncertainty from noise alone.

    `risen` says whether the command rose to it.
    """

    command: float
    response: float
    std: float
    samples: int
    risen: bool


def settled(waited: Array) -> tuple[float, float]:
    """Mean of the second half of a wait, and its standard uncertainty from noise."""
    return noisy_mean(waited[len(waited) // 2 :])


def together(waits: Sequence[Standing]) -> Standing:
    """The waits at one end as one; the first is what a single visit would have shown."""
    weights = np.array([wait.samples for wait in waits], dtype=np.float64)
    value = float(np.average([wait.response for wait in waits], weights=weights))
    std = float(np.sqrt(np.sum((weights * [wait.std for wait in waits]) ** 2)) / weights.sum())
    return Standing(waits[0].command, value, std, int(weights.sum()), waits[0].risen)


@dataclass(frozen=True, slots=True)
class Points:
    """Means of samples that belong to neighbouring commands on one branch.

    Attributes:
        command, response, count: shape (p,).
        side: 1 while the command rises, −1 while it falls. `sweep`: which it belongs to.
        both: whether the other branch has been there too.
    """

    command: Array
    response: Array
    count: Array
    side: Array
    sweep: Array
    both: Mask


@dataclass(frozen=True, slots=True)
class SweepEstimate:
    """The characteristic; rows of resampled arrays belong to the same resampled recording.

    Attributes:
        command: levels, rising, shape (levels,), from end to end of the sweeps.
        response, slope, width: of the curve there, and the width of the loop along the command that no speed
            explains, shape (levels,). `responses`, `slopes`, `widths`: resampled, shape (draws, levels).
        lag_s, mean_width: what makes the loop wider with speed, and what does not; NaN for sweeps of one speed.
            `lags_s`, `mean_widths`: resampled more often than curves are, shape (more,).
        half_widths: of each sweep, lag included. `resampled_half_widths`: shape (more, sweeps).
        points: the means, commands shifted to where the curve is; `std` their standard uncertainty, shape (p,).
        covered: lowest and highest command of the curve that the moving command reached on both branches.
    """

    command: Array
    response: Array
    slope: Array
    width: Array
    responses: Array
    slopes: Array
    widths: Array
    lag_s: float
    lags_s: Array
    mean_width: float
    mean_widths: Array
    half_widths: Array
    resampled_half_widths: Array
    points: Points
    std: Array
    covered: tuple[float, float]

    def branch(self, side: int, sweep: int = 0) -> Array:
        """Mean response on a branch of a sweep at the levels, lag taken out, shape (levels,); NaN where it was not."""
        mine = (self.points.side == side) & (self.points.sweep == sweep) & (self.points.count > 0)
        # what is left of the shift to the curve is hysteresis
        place = self.points.command[mine] + side * self.mean_width_or_all / 2.0
        order = np.argsort(place)
        return np.interp(self.command, place[order], self.points.response[mine][order], left=np.nan, right=np.nan)

    def completed_branch(self, side: int) -> Array:
        """A branch of the first sweep, the curve where it has not been, shape (levels,)."""
        found = self.branch(side)
        return np.where(np.isnan(found), self.response, found)

    @property
    def mean_width_or_all(self) -> float:
        """Mean width of the loop; with one speed the lag is in it."""
        return 2.0 * float(self.half_widths[0]) if np.isnan(self.mean_width) else self.mean_width


def sweep_estimate(
    name: str,
    sweeps: Sequence[Sweep],
    standing: Sequence[Standing] = (),
    waited_s: float = 0.0,
    draws: int = DRAWS,
) -> SweepEstimate:
    """The characteristic of sweeps over one range.

    Args:
        name: of the recording, for messages.
        sweeps: at two speeds, or one.
        standing: where the command waited until the response was steady.
        waited_s: time after a turn that is left out while the lag is not known.
        draws: how often it is resampled; few where nobody asks how certain it is.

    Raises:
        InputError: the command does not go both up and down over one range, or the response does not follow it.
    """
    low = min(float(s.command.min()) for s in sweeps)
    high = max(float(s.command.max()) for s in sweeps)
    if not high > low:
        raise InputError(f"{name}: the command does not move; a flow curve needs a sweep")
    speeds = np.array([sweep.speed_per_s for sweep in sweeps])
    with one_blas_thread():
        points = _points(name, sweeps, low, high, [waited_s] * len(sweeps))
        half, _, _ = _aligned(
            points, standing, speeds, np.zeros(len(speeds)), EFFORT.first_coefficients, EFFORT.near * (high - low)
        )
        late = CRITERIA.parallel_after * np.abs(half) / speeds
        points = _points(name, sweeps, low, high, late.tolist())
        half, smoother, curves = _aligned(
            points, standing, speeds, half, EFFORT.coefficients, EFFORT.together * (high - low)
        )
        return _estimate(points, standing, speeds, half, smoother, curves, np.linspace(low, high, EFFORT.levels), draws)


def _points(name: str, sweeps: Sequence[Sweep], low: float, high: float, drops_s: Sequence[float]) -> Points:
    width = (high - low) / EFFORT.bins
    found = []
    for number, (sweep, drop_s) in enumerate(zip(sweeps, drops_s, strict=True)):
        drop = min(drop_s * sweep.speed_per_s, CRITERIA.most_dropped * (high - low))
        slope = np.gradient(sweep.command)
        for side in (1.0, -1.0):
            begun = sweep.command - low if side > 0.0 else high - sweep.command
            kept = (side * slope > 0.0) & (begun >= drop)
            bins = np.clip(((sweep.command[kept] - low) / width).astype(np.int64), 0, EFFORT.bins - 1)
            count = np.bincount(bins, minlength=EFFORT.bins)
            full = count >= max(2.0, 0.5 * float(np.median(count[count > 0]))) if count.any() else count > 0
            sums = [np.bincount(bins, values[kept], EFFORT.bins)[full] for values in (sweep.command, sweep.response)]
            place = np.flatnonzero(full)
            alike = np.full(len(place), side), np.full(len(place), number)
            found.append((sums[0] / count[full], sums[1] / count[full], count[full], *alike, place))
    command, response, counts, sides, numbers, places = (np.concatenate(each) for each in zip(*found, strict=True))
    shared = np.intersect1d(places[sides > 0.0], places[sides < 0.0])
    if len(shared) < CRITERIA.both_ways * EFFORT.bins:
        raise InputError(f"{name}: the command does not sweep both up and down over one range")
    return Points(command, response, counts.astype(np.float64), sides, numbers, np.isin(places, shared))


def _split(half: Array, speeds: Array) -> tuple[float, float]:
    """(lag, width) from h = w/2 + τ·speed; NaN for one speed."""
    if np.ptp(speeds) == 0.0:
        return np.nan, np.nan
    lag_s, half_width = np.polyfit(speeds, half, 1)
    return float(lag_s), 2.0 * float(half_width)


def _shifted(points: Points, standing: Sequence[Standing], speeds: Array, half: Array) -> tuple[Array, Array]:
    """(where the samples belong on the curve, weight of each), standing responses behind the moving ones."""
    _, width = _split(half, speeds)
    rest = 0.0 if np.isnan(width) else width / 2.0
    moving = points.command - points.side * half[points.sweep]
    places = np.concatenate((moving, [s.command - (rest if s.risen else -rest) for s in standing]))
    weights = np.sqrt(np.concatenate((points.count, [float(s.samples) for s in standing])))
    return places, weights


def _aligned(
    points: Points, standing: Sequence[Standing], speeds: Array, half: Array, coefficients: int, enough: float
) -> tuple[Array, Smoother, Curves]:
    """Half widths that bring all branches onto one curve to within `enough`, by Gauss and Newton, and that curve."""
    samples = np.concatenate((points.response, [s.response for s in standing]))
    for last in range(EFFORT.rounds):
        places, weights = _shifted(points, standing, speeds, half)
        smoother = Smoother.on(places, coefficients, weights=weights)
        curves = smoother.curves(samples)
        if last == EFFORT.rounds - 1:
            break
        step = _apart(points, smoother, curves, samples[None, : len(points.command)], len(speeds))[0]
        if np.max(np.abs(step)) < enough:
            break
        half = half + step
    return half, smoother, curves


def _apart(points: Points, smoother: Smoother, curves: Curves, samples: Array, sweeps: int) -> Array:
    """By how much the half widths of the sweeps are too small, shape (m, sweeps), for samples of shape (m, p)."""
    count = len(points.command)
    values, slopes = smoother.at(curves)[:, :count], smoother.slopes(curves)[:, :count]
    weight = np.where(points.both, points.count, 0.0)
    pull = -points.side * slopes * (samples - values) * weight
    push = slopes**2 * weight
    one = np.equal.outer(points.sweep, np.arange(sweeps)).astype(np.float64)
    return (pull @ one) / np.maximum(push @ one, LEAST)


def _estimate(
    points: Points, standing: Sequence[Standing], speeds: Array, half: Array, smoother: Smoother, curves: Curves,
    levels: Array, draws: int,
) -> SweepEstimate:  # fmt: skip
    count, sweeps = len(points.command), len(speeds)
    places, weights = _shifted(points, standing, speeds, half)
    wide = Smoother.on(places[:count][points.both], EFFORT.width_coefficients, weights=weights[:count][points.both])
    samples = points.response[None, :]
    bend, local = _widths(points, wide, smoother, curves, samples, levels)
    lag_s, width = _split(half, speeds)

    rng = draws_of(points.response)
    parted = np.zeros(len(weights))  # what the branches keep apart is no noise: it is drawn with the curve
    parted[:count][points.both] = points.side[points.both] * bend[0]
    waited = np.array([one.response for one in standing])
    noise_std = float(smoother.curves(np.concatenate((points.response, waited)) - parted).noise_std[0]) / weights
    shown = smoother.at(curves)[0] + parted
    drawn = shown + noise_std * rng.normal(size=(draws, len(shown)))
    again = smoother.curves(drawn)
    off = _apart(points, smoother, again, drawn[:, :count], sweeps)
    splits = np.array([_split(one, speeds) for one in half + off])
    aligned = drawn[:, :count] + points.side * smoother.slopes(again)[:, :count] * off[:, points.sweep]
    _, local_again = _widths(points, wide, smoother, again, aligned, levels)
    base, bases = (2.0 * float(half[0]), 2.0 * (half + off)[:, 0]) if np.isnan(width) else (width, splits[:, 1])
    response, slope = (found[0] for found in smoother.beside(curves, levels))
    responses, slopes_again = smoother.beside(again, levels)
    reached = points.command[points.both] - (points.side * half[points.sweep])[points.both]
    shifted = replace(points, command=places[:count])
    return SweepEstimate(
        levels, response, slope, base + local[0], responses, slopes_again, bases[:, None] + local_again,
        lag_s, splits[:, 0], width, splits[:, 1], half, half + off, shifted, noise_std[:count],
        (float(reached.min()), float(reached.max())),
    )  # fmt: skip


def _widths(
    points: Points, wide: Smoother, smoother: Smoother, curves: Curves, samples: Array, levels: Array
) -> tuple[Array, Array]:
    """(what the branches keep apart at the samples, by how much wider than on the whole the loop is at the levels)."""
    left = points.side * (samples - smoother.at(curves)[:, : len(points.command)])
    found = wide.curves(left[:, points.both])
    _, slopes = smoother.beside(curves, levels)
    apart, _ = wide.beside(found, levels)
    with np.errstate(divide="ignore", invalid="ignore"):
        return wide.at(found), np.where(slopes != 0.0, -2.0 * apart / slopes, 0.0)
