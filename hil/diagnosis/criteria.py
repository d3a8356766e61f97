"""The numbers that decide what is believed, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Criteria:
    """Everything that decides between hypotheses, and whether a unit has changed at all.

    Attributes:
        parts: m, from where on what is left counts by its logarithm. `cause`: γ, what a cause costs, in parts.
        unknown: what something unknown leaves of what its partner leaves, and its `unknowns`.
        temper: τ; odds of two rows are exp(ΔS/2τ). `odds`: rows within these odds of the first are not separable.
        scale: the noise's variance is no better known than to this share, within 95 %; what is consistent leaves less.
        alarm: z from which a unit of another structure than its model has changed.
    """

    parts: float = 100.0
    cause: float = 1.1
    unknown: float = 0.1
    unknowns: int = 3
    temper: float = 10.0
    odds: float = 20.0
    scale: float = 0.06
    alarm: float = 5.5


CRITERIA = Criteria()
