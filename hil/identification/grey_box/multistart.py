"""Grossly different starts: where a fit explains little, the values that it began at were no start."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from hil.cores import parallel_map
from hil.identification.grey_box.criteria import EFFORT
from hil.identification.grey_box.estimate import Unknown
from hil.record.recording import Array


def multistart(residuals: Callable[[Array], Array], unknowns: Sequence[Unknown]) -> list[list[Unknown]]:
    """The most promising of many starts all over the bounds, the best first; `residuals` as in `estimate`.

    Sizes are spread over orders of magnitude, what may have either sign evenly about its start.
    """
    count, size = EFFORT.far_places, len(residuals(np.array([u.start for u in unknowns])))
    while count > EFFORT.fewest_places and count * size > EFFORT.far_residuals:
        count //= 2
    tried = far_places(unknowns, count)

    def chi2(values: Array) -> float:
        r = residuals(values)
        return float(r @ r)

    found = sorted((c, k) for k, c in enumerate(parallel_map(chi2, tried)) if math.isfinite(c))
    starts = [tried[k].tolist() for _, k in found[: EFFORT.far_fitted]]
    return [[replace(u, start=v) for u, v in zip(unknowns, values, strict=True)] for values in starts]


def far_places(unknowns: Sequence[Unknown], count: int) -> list[Array]:
    """So many values (a power of two) all over the bounds, each of shape (k,); the same at every call."""
    from scipy.stats import qmc  # seconds of import, for the few plants that are started from afar

    places = qmc.Sobol(len(unknowns), scramble=False).random(count)
    return [np.array([_at(u, share) for u, share in zip(unknowns, place, strict=True)]) for place in places]


def _at(u: Unknown, share: float) -> float:
    """A place within the bounds, counted from 0 to 1."""
    if u.low >= 0.0:
        size = u.start if u.start > 0.0 else u.scale
        low, high = max(u.low, size / EFFORT.far), min(u.high, size * EFFORT.far)
        return float(low * (high / low) ** share)
    low, high = max(u.low, u.start - EFFORT.far * u.scale), min(u.high, u.start + EFFORT.far * u.scale)
    return float(low + (high - low) * share)
