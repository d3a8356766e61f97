"""Stretches in which something holds, sample after sample."""

from __future__ import annotations

import numpy as np

from hil.arrays import Integers, Mask


def runs(held: Mask) -> list[tuple[int, int]]:
    """(first, one past the last) index of every stretch of True, in order."""
    return [(start, stop) for start, stop in _edges(held).tolist()]


def longest_runs(held: Mask, most: int) -> list[tuple[int, int]]:
    """The longest stretches of True, at most so many, the longest first; of equally long ones the first."""
    edges = _edges(held)
    return [
        (start, stop) for start, stop in edges[np.argsort(edges[:, 0] - edges[:, 1], kind="stable")[:most]].tolist()
    ]


def _edges(held: Mask) -> Integers:
    """Shape (number of stretches, 2)."""
    return np.flatnonzero(np.diff(held.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)
