"""Samples as a chart shows them: the least and the largest value of each stretch of time, kept to a bounded size."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hil.record.recording import Array

FINE_S = 0.02
FINE_KEPT = 3000  # a minute
COARSE_KEPT = 2400


@dataclass(slots=True)
class Envelope:
    """Stretches of `width_s`, each with the least and the largest value of every channel; NaN where none was measured.

    Attributes:
        channels: how many.
        width_s: of a stretch.
        most: stretches that are kept.
        merges: whether stretches are put together in pairs when there are too many (the whole run is kept); else the
            oldest are let go.
    """

    channels: int
    width_s: float
    most: int
    merges: bool
    start_s: Array = field(init=False)
    low: Array = field(init=False)
    high: Array = field(init=False)

    def __post_init__(self) -> None:
        self.start_s = np.empty(0)
        self.low, self.high = np.empty((self.channels, 0)), np.empty((self.channels, 0))

    def take(self, time_s: Array, values: Array) -> None:
        """Samples that came.

        Args:
            time_s: their stamps, shape (n,).
            values: shape (channels, n).
        """
        if not len(time_s):
            return
        start_s, low, high = intervals(time_s, values, self.width_s)
        self.start_s, self.low, self.high = _joined(
            np.concatenate((self.start_s, start_s)), np.hstack((self.low, low)), np.hstack((self.high, high))
        )
        while len(self.start_s) > self.most:
            if self.merges:
                self.width_s *= 2.0
                self.start_s, self.low, self.high = _joined(self._floored(), self.low, self.high)
            else:
                self.start_s = self.start_s[-self.most :]
                self.low, self.high = self.low[:, -self.most :], self.high[:, -self.most :]

    def since(self, start_s: float) -> dict[str, Any]:
        """The stretches from a time on, that one included, as JSON values."""
        first = int(np.searchsorted(self.start_s, start_s - 1e-9))
        return {
            "width_s": self.width_s,
            "t": [round(float(t), 6) for t in self.start_s[first:]],
            "low": [_json_row(row) for row in self.low[:, first:]],
            "high": [_json_row(row) for row in self.high[:, first:]],
        }

    @property
    def last_s(self) -> float:
        """Where the last stretch begins; minus infinity before the first."""
        return float(self.start_s[-1]) if len(self.start_s) else -math.inf

    def _floored(self) -> Array:
        return np.floor(self.start_s / self.width_s + 1e-6) * self.width_s


def intervals(time_s: Array, values: Array, width_s: float) -> tuple[Array, Array, Array]:
    """(where each stretch begins, least, largest) of samples; what was not measured counts in none."""
    return _joined(np.floor(time_s / width_s + 1e-6) * width_s, *_without_ends(values))


def _without_ends(values: Array) -> tuple[Array, Array]:
    finite = np.where(np.isfinite(values), values, np.nan)
    return finite, finite


def _joined(start_s: Array, low: Array, high: Array) -> tuple[Array, Array, Array]:
    """Neighbours that begin at one time put together."""
    firsts = np.flatnonzero(np.diff(start_s, prepend=-math.inf) > 1e-9)
    return start_s[firsts], np.fmin.reduceat(low, firsts, axis=1), np.fmax.reduceat(high, firsts, axis=1)


def _json_row(row: Array) -> list[float | None]:
    return [None if math.isnan(value) else float(f"{value:.5g}") for value in row.tolist()]
