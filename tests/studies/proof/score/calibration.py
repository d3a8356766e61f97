"""Whether said probabilities are kept: of names said to be 80 % likely, 80 % should be right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tests.studies.rates import Rate

from ..cases.label import PARAMETER
from .result import Result

BANDS = (0.0, 0.5, 0.8, 0.95, 1.0)
"""Borders between which probabilities are taken together; the last band holds its upper border."""


@dataclass(frozen=True, slots=True)
class Band:
    """Names that were said to be about equally likely.

    Attributes:
        low: Lower border.
        high: Upper border.
        said: Mean of the probabilities; not a number without names.
        kept: How many of the names were right.
    """

    low: float
    high: float
    said: float
    kept: Rate


def bands(results: Sequence[Result]) -> list[Band]:
    """Return the names of all results by how likely they were said to be."""
    names = _judged(results)
    return [_band(low, high, names) for low, high in pairwise(BANDS)]


def brier(results: Sequence[Result]) -> float:
    """Return the mean square of probability said minus 1 or 0, right or not; not a number without names."""
    errors = [probability - right for probability, right in _judged(results)]
    return float(np.mean(np.square(errors))) if errors else float("nan")


def _judged(results: Sequence[Result]) -> list[tuple[float, bool]]:
    """Return the probability of each name, and whether it is right: whether that effect was concealed.

    Cases without listed effects count too (no name is right there).
    """
    return [
        (probability, name in r.effects and r.kind != PARAMETER)
        for r in results
        if r.visible
        for name, probability in zip(r.named, r.probabilities, strict=True)
    ]


def _band(low: float, high: float, names: Sequence[tuple[float, bool]]) -> Band:
    inside = [(p, right) for p, right in names if low <= p < high or p == high == BANDS[-1]]
    said = float(np.mean([p for p, _ in inside])) if inside else float("nan")
    return Band(low, high, said, Rate(sum(right for _, right in inside), len(inside)))
