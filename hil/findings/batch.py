"""A batch of units: how many pass, how many passed at first, how capable each value is, and which limits are missed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.findings.results import Results
from hil.record.measurement import Measured, Verdict
from hil.signals.interval import exact_limits

_TAIL = 0.025  # beyond either end of an interval of 95 %
_FEWEST = 2  # units below which there is no scatter


@dataclass(frozen=True, slots=True)
class Yield:
    """So many units passed of those judged; `low` and `high` are 95 % limits of the share (Clopper-Pearson)."""

    passed: int
    judged: int
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class LimitOfBatch:
    """One limit over the units of a batch that were judged by it.

    Attributes:
        name, unit: of the value. `low`, `high`: the limit.
        units: judged by it. `failed`, `cannot_tell`: how many of them have that verdict.
        cumulative: share of all misses of the batch that this limit and those before it have; None without a miss.
        mean, std: of the values of the units. `cpk`: distance of the mean to the nearer limit, in 3 `std`.
        cpk_low, cpk_high: where it lies in 95 % of batches, for values that scatter as a normal distribution does.
        why: there is no capability.
    """

    name: str
    unit: str
    low: float | None
    high: float | None
    units: int
    failed: int
    cannot_tell: int
    cumulative: float | None = None
    mean: float | None = None
    std: float | None = None
    cpk: float | None = None
    cpk_low: float | None = None
    cpk_high: float | None = None
    why: str = ""


@dataclass(frozen=True, slots=True)
class Batch:
    """Units of one procedure: yield by their run, first-pass yield by their first run, limits, most missed first."""

    final: Yield
    first_pass: Yield
    limits: tuple[LimitOfBatch, ...]


def batch_of(units: Sequence[Results], first_verdicts: Mapping[str, Verdict | None]) -> Batch | None:
    """What a batch comes to; None where no unit was judged.

    Args:
        units: a run for each unit.
        first_verdicts: of the first run of each unit that an archive has, by serial number.
    """
    if not (judged := [one for one in units if one.verdict is not None]):
        return None
    first = [first_verdicts.get(one.serial or "") or one.verdict for one in judged]
    return Batch(_yield([one.verdict for one in judged]), _yield(first), tuple(_by_misses(judged)))


def _yield(verdicts: Sequence[Verdict | None]) -> Yield:
    passed = sum(verdict == "pass" for verdict in verdicts)
    return Yield(passed, len(verdicts), *exact_limits(passed, len(verdicts)))


def _by_misses(units: Sequence[Results]) -> Iterator[LimitOfBatch]:
    limits: dict[tuple[object, ...], list[Measured]] = {}
    for value in (value.renamed for one in units for value in one.values if value.verdict):
        limits.setdefault((value.name, value.unit, value.low, value.high), []).append(value)
    found = sorted(map(_limit, limits.values()), key=lambda one: (-one.failed, -one.cannot_tell))
    misses = sum(one.failed for one in found)
    for one, counted in zip(found, np.cumsum([one.failed for one in found]), strict=True):
        yield replace(one, cumulative=float(counted / misses)) if misses else one


def _limit(values: Sequence[Measured]) -> LimitOfBatch:
    one = values[0]
    failed, cannot_tell = (sum(value.verdict == verdict for value in values) for verdict in ("fail", "cannot tell"))
    bare = LimitOfBatch(one.name, one.unit, one.low, one.high, len(values), failed, cannot_tell)
    numbers = [value.value for value in values if value.relation == "=" and value.value is not None]
    if bounds := len(values) - len(numbers):
        return replace(bare, why=f"{bounds} of {len(values)} units have a bound or no value")
    if len(numbers) < _FEWEST:
        return replace(bare, mean=numbers[0], why="one unit has no scatter")
    mean, std = float(np.mean(numbers)), float(np.std(numbers, ddof=1))
    if std == 0.0:
        return replace(bare, mean=mean, std=std, why="all units have the same value")
    cpk = min(_distances(mean, one.low, one.high)) / (3.0 * std)
    low, high = _cpk_limits(cpk, len(numbers))
    return replace(bare, mean=mean, std=std, cpk=cpk, cpk_low=low, cpk_high=high)


def _distances(mean: float, low: float | None, high: float | None) -> Iterator[float]:
    if low is not None:
        yield mean - low
    if high is not None:
        yield high - mean


def _cpk_limits(cpk: float, units: int) -> tuple[float, float]:
    """3·√n times the capability at one limit scatters as a noncentral t: exact there.

    With a mean midway between two limits it still holds the truth in 93 to 95 of 100 batches of 5 to 30 units.
    """
    from scipy.special import nctdtrinc

    scale = 3.0 * np.sqrt(units)
    low, high = (float(nctdtrinc(units - 1, share, scale * cpk) / scale) for share in (1.0 - _TAIL, _TAIL))
    return low, high
