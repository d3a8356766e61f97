"""Whether an effect is what its name says."""

from __future__ import annotations

from collections.abc import Sequence

from hil.diagnosis.search.terms import Term
from hil.identification.grey_box.estimate import Unknown


def is_another(term: Term, values: Sequence[float]) -> bool:
    """Whether a shape that tells an effect from others has ended where the effect would be another one."""
    telling = dict(term.telling)
    return any(
        u.at_bound(value) and _room(u, value, telling[u.name]) < 0.5 * (u.high - u.low)
        for u, value in zip(term.unknowns, values, strict=True)
        if u.name in telling
    )


def _room(u: Unknown, value: float, telling: str) -> float:
    """How far a shape is from where it would be that of another effect."""
    return u.high - value if telling == "upper end" else min(value - u.low, u.high - value)
