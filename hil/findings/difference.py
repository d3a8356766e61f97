"""The results of two runs side by side, each difference with its significance."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from hil.findings.results import Results
from hil.record.measurement import Measured

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
    pairs = list(_pairs(first, second))
    tested = [pair for pair in pairs if _std(*pair, one_bench) is not None]
    level = ALPHA / max(1, len(tested))  # Bonferroni: one false alarm in twenty pairs of runs, not in twenty values
    return [_difference(*pair, one_bench, level) for pair in pairs]


def _pairs(first: Results, second: Results) -> Iterator[tuple[Measured | None, Measured | None]]:
    own, other = ({value.name: value for value in one.values} for one in (first, second))
    for name in dict.fromkeys((*own, *other)):
        yield own.get(name), other.get(name)


def _difference(a: Measured | None, b: Measured | None, one_bench: bool, level: float) -> Difference:
    named = a or b
    if named is None:
        raise ValueError("a difference is of a value that at least one run has")
    std = _std(a, b, one_bench)
    if a is None or b is None or std is None or a.value is None or b.value is None:
        return Difference(named.name, named.unit, a, b, None, None, None, "cannot tell")
    change = b.value - a.value
    chance = math.erfc(abs(change) / std / math.sqrt(2.0)) if std > 0.0 else float(change == 0.0)
    meaning: Meaning = "differs" if chance < level else "within uncertainty"
    return Difference(named.name, named.unit, a, b, change, std, chance, meaning)


def _std(a: Measured | None, b: Measured | None, one_bench: bool) -> float | None:
    """Of the change; None where it cannot be told: a bound, a missing value, an uncertainty that is not known."""
    if a is None or b is None or a.relation != "=" or b.relation != "=" or a.unit != b.unit:
        return None
    if a.value is None or b.value is None or a.std is None or b.std is None:
        return None
    shared = [value.calibration_std if one_bench else 0.0 for value in (a, b)]
    own = [
        math.sqrt(max(value.std**2 - part**2, 0.0))
        for value, part in zip((a, b), shared, strict=True)
        if value.std is not None
    ]
    return math.hypot(*own)
