"""Slopes of a function by which uncertainties are propagated through it (GUM, JCGM 100:2008, 5.1.3)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hil.record.recording import Array


def central_slopes(function: Callable[[Array], Array], at: Array, steps: Array) -> Array:
    """Slopes of m values in k others, shape (m, k), by differences of `steps` to both sides of `at`, both (k,)."""
    moves = zip(steps, np.diag(steps), strict=True)
    return np.column_stack([(function(at + move) - function(at - move)) / (2.0 * step) for step, move in moves])
