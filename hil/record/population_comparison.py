"""Figures of a unit beside those of good units of its type: what differs and by how much, whatever the limits are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from hil.record.measured import Measured, Verdict


@dataclass(frozen=True, slots=True)
class PopulationComparison:
    """Figures of the unit beside those of good units of its type; no part of the verdict.

    `low` and `high` of a figure are the ends of the range of good units, learnt from `good_units` simulated ones.
    `beyond` is the share of them that lies beyond either end. `reason` says why there are no figures.
    """

    __pydantic_config__: ClassVar = {"extra": "forbid"}
    figures: tuple[Measured, ...] = ()
    good_units: int = 0
    beyond: float = 0.0
    reason: str = ""

    def those(self, verdict: Verdict) -> tuple[Measured, ...]:
        """Figures that lie within the range for certain (`pass`), beyond it (`fail`), or of which nobody can tell."""
        return tuple(m for m in self.figures if m.verdict_of_limits == verdict)
