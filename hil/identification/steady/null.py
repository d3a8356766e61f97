"""Null, lap and saturation of a curve that passes zero, from the straight lines through its two sides.

Each line is a least-squares one over all commands from 20 % to 80 % of the response at the end of its side. The lines
cross zero response at two commands: their mean is the null, their distance the lap.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hil.identification.steady.characteristic import Read, level_at, line_through
from hil.identification.steady.criteria import CRITERIA
from hil.identification.steady.sweep_estimate import SweepEstimate
from hil.identification.uncertainty.parametric_bootstrap import about
from hil.record.recording import Array
from hil.signals.crossing import crossing
from hil.signals.interval import UNIFORM


@dataclass(frozen=True, slots=True)
class Null:
    """Where a valve is closed, in the unit of the command.

    Attributes:
        centre: mean of the two zero crossings.
        lap: distance between them: above 0 where neither side is open, below 0 where both are.
        slopes: of the lines below and above, response per command.
        saturated: from where on the curve is flat to the end, below and above; infinite where it is nowhere. Its
            uncertainty is infinite where some of the redrawn curves are flat and some are not.
    """

    centre: Read
    lap: Read
    slopes: tuple[float, float]
    saturated: tuple[Read, Read]


def null_of(estimate: SweepEstimate, low: float, high: float) -> Null | None:
    """The null of a curve that ends at the responses `low` and `high`; None where a side has no line to zero."""
    if not low * high < 0.0:
        return None
    rows = zip((estimate.response, *estimate.responses), (estimate.slope, *estimate.slopes), strict=True)
    read = np.array(
        [[_of_side(estimate.command, *row, end, sign) for end, sign in ((low, -1), (high, 1))] for row in rows]
    )
    if not np.isfinite(read[0, :, :2]).all():
        return None
    below, above = read[:, 0], read[:, 1]
    return Null(
        _read((below[:, 0] + above[:, 0]) / 2.0), _read(above[:, 0] - below[:, 0]),
        (float(below[0, 1]), float(above[0, 1])),
        (_saturated(estimate, below, -1), _saturated(estimate, above, 1)),
    )  # fmt: skip


def _saturated(estimate: SweepEstimate, side: Array, sign: int) -> Read:
    """Where a side becomes flat.

    A smooth curve cannot have a corner, and the branches leave theirs half the hysteresis to either side: how far the
    slope takes to fall is granted, and that half as well.
    """
    value, std = _read(side[:, 2])
    if not math.isfinite(std):
        return value, std
    steepness = estimate.slope / side[0, 1]
    fall = abs(
        _flat_from(estimate.command, steepness, sign, 0.5 * CRITERIA.flat)
        - _flat_from(estimate.command, steepness, sign, 1.5 * CRITERIA.flat)
    )
    return value, math.hypot(std, UNIFORM * fall, UNIFORM * estimate.mean_width_or_all)


def _read(values: Array) -> Read:
    """The first value with what the redrawn ones after it scatter."""
    return float(values[0]), about(values[1:], float(values[0]))


def _of_side(command: Array, response: Array, slope: Array, end: float, sign: int) -> tuple[float, float, float]:
    """(zero crossing of the line, its slope, where the curve becomes flat for good) of one side."""
    outwards = slice(None, None, sign)
    share = (response / end)[outwards]
    first, last = (level_at(command[outwards], share, part) for part in (CRITERIA.line_from, CRITERIA.line_to))
    if math.isnan(first) or math.isnan(last):
        return math.nan, math.nan, math.nan
    middle, level, gain = line_through(command, response, first, last)
    return middle - level / gain, gain, _flat_from(command, slope / gain, sign, CRITERIA.flat)


def _flat_from(command: Array, steepness: Array, sign: int, level: float) -> float:
    """The last command, outwards, at which the slope is still so steep; infinite where it is at the end."""
    steep = np.flatnonzero(steepness >= level)
    edge = int(steep[-1] if sign > 0 else steep[0]) if len(steep) else -1
    beyond = edge + sign
    if edge < 0 or not 0 <= beyond < len(command):
        return math.inf
    return crossing(command, steepness, level, edge, beyond)
