"""Figures of a unit beside those of good units of its type: what differs and by how much, whatever the limits are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from hil.record.measurement import Measured, Verdict, judge
from hil.record.plain import plain


@dataclass(frozen=True, slots=True)
class PopulationComparison:
    """What is said beside a verdict that is no pass; it judges nothing itself.

    Attributes:
        figures: of the unit, without verdict; `low` and `high` are the ends of the range of good units.
        good_units: how many simulated good units of the type the ranges were learnt from.
        beyond: share of good units that lie beyond either end of a range.
        reason: why nothing can be said; then there are no figures.
    """

    __pydantic_config__: ClassVar = {"extra": "forbid"}
    figures: tuple[Measured, ...] = ()
    good_units: int = 0
    beyond: float = 0.0
    reason: str = ""

    def those(self, verdict: Verdict) -> tuple[Measured, ...]:
        """Figures that lie within the range for certain (`pass`), beyond it (`fail`), or of which nobody can tell."""
        return tuple(m for m in self.figures if judge(m.value, m.std, m.low, m.high, m.relation) == verdict)

    def as_dict(self) -> dict[str, Any]:
        """As JSON values."""
        found: dict[str, Any] = plain(self)
        return found
