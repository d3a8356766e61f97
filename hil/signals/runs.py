"""Stretches in which something holds, sample after sample."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def runs(held: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """(first, one past the last) index of every stretch of True, in order."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], held.astype(np.int8), [0]))))
    return [(int(start), int(stop)) for start, stop in zip(edges[::2], edges[1::2], strict=True)]
