"""Bandwidths: where magnitude falls 3 dB below its reference, and phase below −90°, with uncertainty."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hil.arrays import ROUNDING
from hil.identification.frequency.criteria import CRITERIA, EFFORT
from hil.identification.frequency.frequency_response import FrequencyResponse
from hil.language.note import Note
from hil.record.measurement import COVERAGE_FACTOR
from hil.record.recording import Array
from hil.signals.crossing import first_crossing
from hil.signals.interval import COVERED

_DEGREE = 3
# Where the 0 dB reference may lie: up to 5 Hz, or this share of the −90° frequency if that is lower.
# GOST 28971 cl. 9.1 (ISO 6404).
_HIGHEST_HZ, _SHARE_OF_PHASE_90 = 5.0, 0.05


@dataclass(frozen=True, slots=True)
class Crossing:
    """The lowest frequency at which a curve falls to a level.

    Attributes:
        level, unit: −3 dB, −90 °.
        frequency_hz: None when the curve does not get there within the measured range, or noise hides where.
        std_hz: standard uncertainty; NaN when that of the response is unknown.
        beyond_hz: up to which the curve is above the level for sure: the highest measured frequency, or less.
        below_hz: where the curve begins below the level: from which it is there for sure; None where noise hides it.
    """

    level: float
    unit: str
    frequency_hz: float | None
    std_hz: float
    beyond_hz: float
    below_hz: float | None = None

    def __str__(self) -> str:
        name = f"{self.level:g} {self.unit}"
        if self.below_hz is not None:
            return f"{name}: below {self.below_hz:.4g} Hz"
        if self.frequency_hz is None and self.beyond_hz == 0.0:
            return f"{name}: hidden by noise"
        if self.frequency_hz is None:
            return f"{name}: not reached up to {self.beyond_hz:g} Hz"
        error = "" if math.isnan(self.std_hz) else f" ± {COVERED * self.std_hz:.2g}"
        return f"{name}: {self.frequency_hz:.4g}{error} Hz"


@dataclass(frozen=True, slots=True)
class Bandwidth:
    """Bandwidths of one frequency response.

    Attributes:
        reference_hz: where the magnitude lies that −3 dB is counted from.
        amplitude: the −3 dB crossing. `phase`: the −90° crossing.
        notes: what departs from the reference rule.
    """

    reference_hz: float
    amplitude: Crossing
    phase: Crossing
    notes: tuple[Note, ...] = ()


def bandwidth(response: FrequencyResponse) -> Bandwidth:
    """−3 dB and −90° frequencies of a measured response.

    Magnitude counts from the lowest frequency (eq. 1 of the HPV41 paper); where the rule of ISO 6404 would have
    another reference, that is noted.
    """
    phase = phase_crossing(response, -90.0)
    notes = reference_notes(response, phase)
    return Bandwidth(float(response.frequency_hz[0]), magnitude_crossing(response, -3.0), phase, notes)


def reference_notes(response: FrequencyResponse, phase_90: Crossing) -> tuple[Note, ...]:
    """What departs from the rule when the lowest frequency is the reference."""
    used = float(response.frequency_hz[0])
    if used > _HIGHEST_HZ:
        return (
            Note("reference at {used_hz:g} Hz, the rule asks for {asked_hz:g} Hz or less",
                 used_hz=used, asked_hz=_HIGHEST_HZ),
        )  # fmt: skip
    if phase_90.frequency_hz is None:
        return ()
    allowed = _SHARE_OF_PHASE_90 * phase_90.frequency_hz
    if used <= allowed * (1.0 + ROUNDING):
        return ()
    note = Note(
        "reference at {used_hz:g} Hz is {share:.1f} % of the −90° frequency; the rule asks for {asked:g} % or less, "
        "{allowed_hz:.3f} Hz",
        used_hz=used, share=100.0 * used / phase_90.frequency_hz, asked=100 * _SHARE_OF_PHASE_90,
        allowed_hz=allowed,
    )  # fmt: skip
    return (note,)


def magnitude_crossing(response: FrequencyResponse, level_db: float) -> Crossing:
    """Where magnitude falls to a level relative to that at the lowest frequency."""
    own = response.magnitude_std_db
    shared = np.full(len(own), own[0])  # the reference is in every other line
    shared[0] = own[0] = 0.0
    return _crossing(response.frequency_hz, response.normalised().magnitude_db, own, shared, level_db, "dB")


def phase_crossing(response: FrequencyResponse, level_deg: float) -> Crossing:
    """Where the unwrapped phase falls to a level."""
    own, shared = response.own_phase_std_deg, response.shared_phase_std_deg
    return _crossing(response.frequency_hz, response.phase_deg, own, shared, level_deg, "°")


def _crossing(frequency_hz: Array, values: Array, own: Array, shared: Array, level: float, unit: str) -> Crossing:
    """First fall to a level; lines that are hardly heard are left out: their noise would bend the whole curve.

    Where none that is heard is so low, the others tell whether it is reached, and no less is known than by those heard.
    """
    heard = own <= (CRITERIA.heard_db if unit == "dB" else CRITERIA.heard_deg)
    by_all = _fall(frequency_hz, values, own, shared, level, unit)
    if heard.sum() < 2 or heard.all():
        return by_all
    alone = _fall(frequency_hz[heard], values[heard], own[heard], shared[heard], level, unit)
    if np.any(values[heard] <= level):
        return alone
    return by_all if by_all.frequency_hz is not None else max(alone, by_all, key=lambda one: one.beyond_hz)


def _fall(frequency_hz: Array, values: Array, own: Array, shared: Array, level: float, unit: str) -> Crossing:
    """First fall to a level of the cubic spline through the values over log frequency.

    The spline is linear in the values, so its uncertainty at every frequency follows from theirs exactly. `own` errors
    of the lines are independent, `shared` ones common. No crossing is where the curve less its expanded uncertainty is
    above the level, nor where with it it is below. What lies between is the interval (Fieller, J. R. Statist. Soc. B
    16(2), 1954), and its middle the value. Over the slope at the crossing alone the interval would be too narrow: noise
    crosses where it makes a flat curve steep.

    The spline of one degree less says how far the spline lies beside the response between lines, as an integrator of
    one order less says the error of another. What noise makes of their difference is taken off.
    """
    top = float(frequency_hz[-1])
    grid = np.linspace(math.log(frequency_hz[0]), math.log(top), EFFORT.grid)
    degree = min(_DEGREE, len(values) - 1)
    weights, lower = (_spline_weights(frequency_hz, grid, k) for k in (degree, max(degree - 1, min(degree, 1))))
    curve = weights @ values
    departure = np.maximum(((weights - lower) @ values) ** 2 - _variance(weights - lower, own, shared), 0.0)
    wide = COVERAGE_FACTOR * np.sqrt(_variance(weights, own, shared) + departure)
    if curve[0] <= level:  # it has fallen before the lowest line
        sure = np.flatnonzero(curve + np.nan_to_num(wide, nan=0.0) <= level)
        return Crossing(level, unit, None, math.nan, 0.0, math.exp(grid[sure[0]]) if len(sure) else None)
    if not np.isfinite(wide).all():
        at = first_crossing(grid, level - curve, 0.0)
        return Crossing(level, unit, None if at is None else math.exp(at), math.nan, top)
    low, high = (first_crossing(grid, level - curve - sign * wide, 0.0) for sign in (-1.0, 1.0))
    if low is None or high is None:
        return Crossing(level, unit, None, math.nan, top if low is None else math.exp(low))
    least, most = math.exp(low), math.exp(high)
    return Crossing(level, unit, (least + most) / 2.0, (most - least) / (2.0 * COVERAGE_FACTOR), top)


def _variance(weights: Array, own: Array, shared: Array) -> Array:
    """Of sums of the lines, one for each row of weights."""
    return np.asarray(((weights * own) ** 2).sum(axis=1) + (weights @ shared) ** 2)


def _spline_weights(frequency_hz: Array, grid: Array, degree: int) -> Array:
    """What each line counts for in the spline over log frequency, shape (grid, lines)."""
    from scipy.interpolate import make_interp_spline

    return np.asarray(make_interp_spline(np.log(frequency_hz), np.eye(len(frequency_hz)), k=degree)(grid))
