"""Figures of a steady characteristic, read from the smooth curve through sweeps, each with its uncertainty."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from hil.errors import InputError
from hil.identification.steady.criteria import CRITERIA, EFFORT
from hil.identification.steady.sweep_estimate import SweepEstimate
from hil.identification.uncertainty.parametric_bootstrap import about, draws_of
from hil.record.recording import Array, Integers
from hil.signals.crossing import first_crossing
from hil.signals.interval import UNIFORM
from hil.signals.rounding import rounding_of_means

Read = tuple[float, float]
"""Value and standard uncertainty."""


@dataclass(frozen=True, slots=True)
class Side:
    """One side of a curve that goes both ways from neutral; `departures` are those of the resampled curves."""

    edge: Read
    gain: Read
    departure: Read
    departures: Array


@dataclass(frozen=True, slots=True)
class Loop:
    """What lies between the branches, along the command; `lag` and `width` are None for sweeps of one speed.

    Attributes:
        lag: s. `width`: the largest that speed does not explain, where the curve is steep.
        is_friction: whether the width is more than noise makes.
    """

    lag: Read | None
    width: Read | None
    is_friction: bool


def over_all(estimate: SweepEstimate, figure: Callable[[Array, Array], float]) -> Read:
    """A figure of (response, slope) at the levels, with its uncertainty from the resampled curves."""
    value = figure(estimate.response, estimate.slope)
    resampled = [figure(one, slope) for one, slope in zip(estimate.responses, estimate.slopes, strict=True)]
    return value, about(np.array(resampled), value)


def loop(estimate: SweepEstimate, certain: float, speeds: tuple[float, ...]) -> Loop:
    """Lag and hysteresis; friction that depends on speed could be taken for lag, and is granted to both.

    Args:
        estimate: of the sweeps.
        certain: standard uncertainties from which a width is no noise.
        speeds: of the sweeps, in the command's unit per second.
    """
    low, high = estimate.covered
    steep = (np.abs(estimate.slope) > CRITERIA.steep * float(np.max(np.abs(estimate.slope)))) & (
        (estimate.command >= low) & (estimate.command <= high)
    )
    if math.isnan(estimate.lag_s) or not steep.any():  # nothing that rises was driven both ways
        return Loop(None, None, False)
    width = float(np.max(np.abs(estimate.width[steep])))
    width_std = about(np.max(np.abs(estimate.widths[:, steep]), axis=1), width)
    lag_std_s = about(estimate.lags_s, estimate.lag_s)
    friction = width >= certain * width_std
    if friction:
        granted = width * CRITERIA.stiction / (1.0 + CRITERIA.stiction) * 2.0 * UNIFORM
        width_std = math.hypot(width_std, CRITERIA.at_rest * granted)
        lag_std_s = math.hypot(lag_std_s, CRITERIA.between_speeds * granted / (2.0 * (max(speeds) - min(speeds))))
    return Loop((estimate.lag_s, lag_std_s), (width, width_std), friction)


def side(estimate: SweepEstimate, neutral: float, zero: Read, end: Read, sign: int, step: float = 0.0) -> Side:
    """Edge of the dead band, gain, and largest departure from its line as a share of the response at the end.

    What is not known of both responses moves the commands between which the line lies; the edge's law is free in both.

    Args:
        estimate: of the sweeps.
        neutral: command from which both sides go.
        zero: response there.
        end: response at the end of this side.
        sign: 1 for the side above neutral, −1 for that below.
        step: between two codes of the converter that read the response; 0 where there is none.

    Raises:
        InputError: no response beyond the noise, or too few levels carry one.
    """
    noise = float(np.median(np.std(estimate.responses, axis=0)))
    (at_zero, zero_std), (at_end, end_std) = zero, end
    if abs(at_end - at_zero) <= CRITERIA.clear * noise:
        raise InputError(f"flow curve: at the {'positive' if sign > 0 else 'negative'} end no flow beyond the noise")
    mine = sign * (estimate.command - neutral) >= 0.0
    command, outwards = estimate.command[mine], slice(None, None, sign)

    def line(response: Array, low: float = at_zero, high: float = at_end) -> tuple[float, float]:
        share = ((response[mine] - low) / (high - low))[outwards]
        first, last = (level_at(command[outwards], share, part) for part in (CRITERIA.gain_from, CRITERIA.gain_to))
        if math.isnan(first) or math.isnan(last):
            raise InputError("flow curve: too few levels carry flow on one side of centre")
        middle, level, gain = line_through(command, response[mine], first, last)
        places = np.linspace(first, last, EFFORT.points)
        left = np.interp(places, command, response[mine]) - level - gain * (places - middle)
        return gain, float(np.max(np.abs(left))) / abs(high - low)

    found = line(estimate.response)
    # inwards, where the curve surely passes
    off, far = (math.copysign(std, at_end - at_zero) for std in (zero_std, end_std))
    moved = line(estimate.response, at_zero - off), line(estimate.response, at_zero, at_end - far)
    resampled = np.array([line(one) for one in estimate.responses])
    gain, departure = (
        (value, math.hypot(about(again, value), *(other - value for other in others)))
        for value, again, *others in zip(found, resampled.T, *moved, strict=True)
    )
    return Side(_edge(estimate, neutral, at_zero, at_end, sign, step), gain, departure, resampled[:, 1])


def symmetry(sides: Collection[Side]) -> Read:
    """Gain of the weaker side over that of the stronger one."""
    weak, strong = sorted((one.gain for one in sides), key=lambda gain: abs(gain[0]))
    return ratio_of(weak, strong)


def ratio_of(above: Read, below: Read) -> Read:
    """Size of one over that of another, neither 0."""
    ratio = abs(above[0] / below[0])
    return ratio, ratio * math.hypot(above[1] / above[0], below[1] / below[0])


def worst_departure(sides: Collection[Side]) -> Read:
    """The worse departure of two sides; the other one counts as far as noise may make it the worse."""
    value, std = max(one.departure for one in sides)
    resampled = np.max([one.departures for one in sides], axis=0)
    return value, max(about(resampled, value), std)  # of two that contend, resampled ones spread less than the error


def line_through(command: Array, response: Array, first: float, last: float) -> tuple[float, float, float]:
    """(middle command, response there, slope) of the least-squares line over all commands from `first` to `last`.

    Over all commands between, not over so many points: whole weight at both ends would turn the line of a curve that
    bends.
    """
    places, middle = np.linspace(first, last, EFFORT.points), (first + last) / 2.0
    values, late = np.interp(places, command, response), places - middle
    slope = float(np.trapezoid(late * values) / np.trapezoid(late**2))
    return middle, float(np.trapezoid(values)) / (len(places) - 1), slope


def level_at(levels: Array, values: Array, wanted: float) -> float:
    """First level at which the values pass a wanted one; NaN where they do not."""
    sign = 1.0 if values[-1] > values[0] else -1.0
    found = first_crossing(levels, sign * values, sign * wanted)
    return math.nan if found is None or found == levels[0] else found


def largest_slope(estimate: SweepEstimate, speeds: Sequence[float]) -> tuple[Read, float]:
    """(steepest slope, the level at which it is) of sweeps with these speeds.

    What is late by more than one delay averages the curve over the commands that were just before: by none, if all of
    the lag is one dead time, by those that a first order of this lag averages, at most. Half of what that takes from
    the steepest slope is given back, and as much is granted.
    """
    steepest = int(np.argmax(np.abs(estimate.slope)))
    sign = math.copysign(1.0, float(estimate.slope[steepest]))
    value, std = over_all(estimate, lambda _response, slope: float(np.max(sign * slope)))
    reach = averaged_over(estimate, speeds) / (2.0 * UNIFORM)
    places = np.clip(estimate.command[steepest] + np.linspace(-reach, reach, EFFORT.points), *estimate.command[[0, -1]])
    lost = max(value - float(np.mean(np.interp(places, estimate.command, sign * estimate.slope))), 0.0)
    return (sign * (value + lost / 2.0), math.hypot(std, UNIFORM * lost)), float(estimate.command[steepest])


def averaged_over(estimate: SweepEstimate, speeds: Sequence[float]) -> float:
    """Standard deviation, in the command's unit, of the commands over which a first order of the sweeps' lag averages.

    The mean square over the sweeps, each for as long as it takes; of one sweep, all that keeps its branches apart.
    """
    if math.isnan(estimate.lag_s):
        return abs(float(estimate.half_widths[0]))
    lasted = [1.0 / speed for speed in speeds]
    return abs(estimate.lag_s) * math.sqrt(sum(speeds) / sum(lasted))


def reaches_both_sides(low: float, high: float, neutral: float) -> bool:
    """Whether a sweep from low to high shows both sides of a valve."""
    reach = CRITERIA.side * (high - low)
    return low < neutral - reach and high > neutral + reach


def polyline() -> Integers:
    """Indices of some levels of an estimate, evenly spread: a curve for the page."""
    return np.linspace(0, EFFORT.levels - 1, EFFORT.shown).round().astype(np.int64)


def _edge(estimate: SweepEstimate, neutral: float, zero: float, end: float, sign: int, step: float) -> Read:
    """Where a power law through the foot of the curve begins, with its uncertainty.

    At the foot the response stays on one code of a coarse converter for many samples; what that hides is no noise, and
    is drawn beside it, with the codes anywhere.
    """
    from scipy.optimize import least_squares

    points = estimate.points
    place = sign * (points.command - neutral)
    share = (points.response - zero) / (end - zero)
    foot = (place > 0.0) & (share < CRITERIA.foot_to)
    if foot.sum() < 5:
        raise InputError("flow curve: too few levels carry flow on one side of centre")
    opening, part = place[foot], share[foot]
    weight = 1.0 / np.maximum(estimate.std[foot] / abs(end - zero), 1e-6)
    top = float(opening.max())

    def law_at(place: Array, p: Array) -> Array:
        over = np.maximum((place - p[0]) / (top - p[0]), 0.0)
        return p[3] + p[4] * place / top + p[2] * over ** p[1]

    def residuals(p: Array) -> Array:
        return (law_at(opening, p) - part) * weight

    # leakage beside a dead band makes its foot lean
    bounds = ([0.0, 0.3, 0.0, -0.5, -0.5], [0.98 * top, 5.0, 2.0, 0.5, 0.5])
    flowing = np.sort(opening[part > 0.02])
    start = float(flowing[0]) if len(flowing) else 0.0
    fitted = partial(least_squares, residuals, bounds=bounds, x_scale=[top, 1.0, 1.0, 1.0, 1.0])
    found = fitted([min(0.9 * start, 0.9 * top), 1.2, float(part.max()), 0.0, 0.0])
    # a corner is no place for a linear uncertainty: the law is fitted again to noise about itself
    scale = math.sqrt(max(1.0, 2.0 * found.cost / max(len(opening) - 4, 1)))
    law, rng = law_at(opening, found.x), draws_of(points.response)
    half = float(np.ptp(estimate.command)) / EFFORT.bins / 2.0
    passed = np.abs(law_at(opening + half, found.x) - law_at(opening - half, found.x))
    code = step / abs(end - zero)
    noise = float(np.median(estimate.std[foot] * np.sqrt(points.count[foot])))
    edges = []
    for _ in range(EFFORT.edge_draws):
        hidden = rounding_of_means(law, passed, code, noise / abs(end - zero), rng.uniform())
        part = law + hidden + scale * rng.normal(size=len(law)) / weight
        edges.append(fitted(found.x).x[0])
    return neutral + sign * float(found.x[0]), about(np.array(edges), float(found.x[0]))
