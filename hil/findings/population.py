"""Values of a unit, or of a batch, beside the other units: how far off, and whether chance makes it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from hil.findings.difference import ALPHA
from hil.findings.results import Results
from hil.record.measurement import Measured, present_name

FEWEST_UNITS = 5  # below which the spread of the others is hardly known

Meaning = Literal["differs", "within the population", "cannot tell"]


@dataclass(frozen=True, slots=True)
class Standing:
    """Where one quantity of a unit, or the mean of a batch, lies in the population.

    Attributes:
        who: run of the unit, or "batch".
        name, unit: of the value.
        values: as measured, one for each unit that is looked at.
        units: how many other units have the value with its uncertainty.
        mean, std: of the others; None for fewer than two.
        distance: from that mean. `distance_std`: its standard uncertainty, from the spread of the units and from what
            the measurement adds on both sides.
        chance: how likely a distance so large is for a unit of the same population.
        meaning: what that says, everything that was asked together considered; `why` it cannot be told.
    """

    who: str
    name: str
    unit: str
    values: tuple[Measured, ...]
    units: int
    mean: float | None = None
    std: float | None = None
    distance: float | None = None
    distance_std: float | None = None
    chance: float | None = None
    meaning: Meaning = "cannot tell"
    why: str = ""


def standings(given: Sequence[Results], others: Sequence[Sequence[Measured]], *, one_bench: bool) -> list[Standing]:
    """Every value of each unit, then the means of the batch where there are several units.

    Args:
        given: runs of one procedure, one for each unit.
        others: the values of each other unit.
        one_bench: whether the same instruments measured all; what their calibration adds is then the same in all and
            says nothing of a distance.
    """
    asked = [(one.run, name, [one[name]]) for one in given for name in _names([one])]
    if len(given) > 1:
        asked += [("batch", name, _named(name, [one.values for one in given])) for name in _names(given)]
    found = [_standing(who, own, _named(name, others), one_bench) for who, name, own in asked]
    level = ALPHA / max(1, sum(one.chance is not None for one in found))  # Bonferroni: one false alarm in twenty calls
    return [one if one.chance is None else replace(one, meaning=_meaning(one.chance, level)) for one in found]


def _names(given: Sequence[Results]) -> list[str]:
    return list(dict.fromkeys(present_name(value.name) for one in given for value in one.values))


def _named(name: str, units: Sequence[Sequence[Measured]]) -> list[Measured]:
    return [value for unit in units for value in unit if present_name(value.name) == name]


def _meaning(chance: float, level: float) -> Meaning:
    return "differs" if chance < level else "within the population"


def _standing(who: str, own: Sequence[Measured], others: Sequence[Measured], one_bench: bool) -> Standing:
    name, unit = own[0].name, own[0].unit
    same = [value for value in others if value.unit == unit]
    known = [value for value in same if value.is_known]
    numbers = np.array([value.value for value in known], dtype=np.float64)
    mean = float(numbers.mean()) if len(known) > 1 else None
    std = float(numbers.std(ddof=1)) if len(known) > 1 else None
    bare = Standing(who, name, unit, tuple(own), len(known), mean, std)
    if why := next(_obstacles(own, same, known), ""):
        return replace(bare, why=why)
    distance = float(np.mean([value.value for value in own if value.value is not None]) - numbers.mean())
    distance_std = _distance_std(own, known, float(numbers.var(ddof=1)), one_bench)
    return replace(
        bare, distance=distance, distance_std=distance_std, chance=_chance(distance, distance_std, len(known) - 1)
    )


def _obstacles(own: Sequence[Measured], same: Sequence[Measured], known: Sequence[Measured]) -> Iterator[str]:
    """Why it cannot be told. Bounds of others are not left out: those that remain would be a selection by size."""
    if not all(value.is_known for value in own):
        yield "a bound, no value, or no uncertainty"
    if bounds := sum(value.relation != "=" for value in same):
        yield f"{bounds} of {len(same)} other units have a bound alone"
    if len(known) < FEWEST_UNITS:
        yield f"{len(known)} other units, at least {FEWEST_UNITS} are needed"


def _distance_std(own: Sequence[Measured], known: Sequence[Measured], variance: float, one_bench: bool) -> float:
    """The scatter of the others holds their repeatability, and is never less than that.

    What the unit's own repeatability exceeds it by is added, and the calibration on both sides where it is not shared.
    """
    own_repeat, other_repeat = (_mean_square(m.repeatability or 0.0 for m in some) for some in (own, known))
    spread = max(variance, other_repeat)
    total = spread * (1.0 / len(own) + 1.0 / len(known)) + max(0.0, own_repeat - other_repeat) / len(own)
    if not one_bench:
        total += sum(_mean_square(value.calibration_std for value in some) for some in (own, known))
    return math.sqrt(total)


def _mean_square(stds: Iterator[float]) -> float:
    return float(np.mean(np.square(list(stds))))


def _chance(distance: float, std: float, freedom: int) -> float:
    """Student's t: the spread is known from so few units."""
    from scipy.special import stdtr

    return float(2.0 * stdtr(freedom, -abs(distance) / std)) if std > 0.0 else float(distance == 0.0)
