"""The results of two runs side by side, each difference with its significance."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Literal, Protocol, TypeVar

from hil.findings.results import Results
from hil.record.measurement import Measured, present_name

ALPHA = 0.05  # a difference is one when chance alone makes it in less than 5 % of pairs, over all values together

Meaning = Literal["differs", "within uncertainty", "cannot tell"]


@dataclass(frozen=True, slots=True)
class Difference:
    """One value of two runs.

    Attributes:
        name, unit: of the value.
        first, second: as measured; None in a run that lacks it.
        change: second less first. `std`: its standard uncertainty, without what both share.
        chance: how likely a change so large is when nothing has changed.
        meaning: what that says, all values of the two runs considered.
    """

    name: str
    unit: str
    first: Measured | None
    second: Measured | None
    change: float | None
    std: float | None
    chance: float | None
    meaning: Meaning


def differences(first: Results, second: Results, *, one_bench: bool) -> list[Difference]:
    """Every value that either run has.

    Args:
        first: the earlier run, or the reference.
        second: the other.
        one_bench: whether the same instruments measured both; what their calibration adds is then the same in both and
            says nothing of a change.
    """
    found = [_difference(a, b, one_bench) for _, a, b in by_name(first.values, second.values)]
    level = ALPHA / max(1, sum(one.chance is not None for one in found))  # Bonferroni: one false alarm in twenty pairs
    return [one if one.chance is None else replace(one, meaning=_meaning(one.chance, level)) for one in found]


class _Named(Protocol):
    @property
    def name(self) -> str: ...


Some = TypeVar("Some", bound=_Named)


def by_name(kept: Iterable[Some], others: Iterable[Some]) -> Iterator[tuple[str, Some | None, Some | None]]:
    """(name of today, what each of two runs has of it) of all that either has; None in the run that lacks it."""
    own, found = ({present_name(one.name): one for one in each} for each in (kept, others))
    for name in dict.fromkeys((*own, *found)):
        yield name, own.get(name), found.get(name)


def _meaning(chance: float, level: float) -> Meaning:
    return "differs" if chance < level else "within uncertainty"


def _difference(a: Measured | None, b: Measured | None, one_bench: bool) -> Difference:
    """A bound, a missing value and an uncertainty that is not known cannot be told."""
    named = a or b
    if named is None:
        raise ValueError("a difference is of a value that at least one run has")
    bare = Difference(present_name(named.name), named.unit, a, b, None, None, None, "cannot tell")
    if a is None or b is None or not (a.is_known and b.is_known) or a.unit != b.unit:
        return bare
    std = math.hypot(*((m.repeatability if one_bench else m.std) or 0.0 for m in (a, b)))
    change = (b.value or 0.0) - (a.value or 0.0)
    chance = math.erfc(abs(change) / std / math.sqrt(2.0)) if std > 0.0 else float(change == 0.0)
    return replace(bare, change=change, std=std, chance=chance)
