"""Has a response become steady? Judged from successive periods, so that no test waits longer than it must."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from hil.signals.sine_fit import SineFit

_COVERAGE = 2.5  # standard deviations within which two periods of a steady response differ


def is_steady(periods: Sequence[SineFit], tolerance: float = 0.005) -> bool:
    """Judge the last of successive fits of one period (or the same number of periods) each.

    It is steady when what is still to come is within tolerance, or below what noise lets anyone see. A transient
    shrinks by the same ratio from period to period, so what is still to come is the last change times r/(1 − r); with
    fewer than three periods r is taken as ½.

    Args:
        periods: fits in order, phases referred to one zero of time.
        tolerance: allowed remaining change, as a share of the amplitude.
    """
    if len(periods) < 2:
        return False
    allowed = tolerance * periods[-1].amplitude
    changes = zip(*(_changes(a, b) for a, b in pairwise(periods[-3:])), strict=True)
    noises = _noises(periods[-2], periods[-1])
    return all(
        series[-1] <= noise or _to_come(series) <= allowed for series, noise in zip(changes, noises, strict=True)
    )


def _changes(a: SineFit, b: SineFit) -> tuple[float, float]:
    return abs(b.phasor - a.phasor), abs(b.offset - a.offset)


def _to_come(changes: Sequence[float]) -> float:
    """The rest of a geometric decay after the last change."""
    ratio = 0.5
    if len(changes) > 1 and changes[0] > 0.0:
        ratio = min(changes[1] / changes[0], 0.9)  # growing changes are noise, or not a decay
    return changes[-1] * ratio / (1.0 - ratio)


def _noises(a: SineFit, b: SineFit) -> tuple[float, float]:
    """How far phasor and offset of two steady periods may differ by noise alone."""
    phasor = float(np.trace(a.phasor_covariance()) + np.trace(b.phasor_covariance()))
    offset = float(a.covariance[0, 0] + b.covariance[0, 0])
    return _COVERAGE * math.sqrt(phasor), _COVERAGE * math.sqrt(offset)
