"""A unit beside itself: what an earlier run of the same serial number measured, and what has changed since."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

from pydantic import Field

from hil.record.measured import Measured, Verdict
from hil.record.moment import Moment


@dataclass(frozen=True, slots=True)
class Moved:
    """A value that differs beyond its uncertainty between two runs of a unit."""

    __pydantic_config__: ClassVar = {"extra": "forbid"}
    then: Measured
    now: Measured


@dataclass(frozen=True, slots=True)
class Missed:
    """A limit missed now, and the value `then`: how likely that unit would have been measured *fail* on this bench.

    Exact from both uncertainties; what the calibration adds is left out where the same instruments measured both.
    """

    __pydantic_config__: ClassVar = {"extra": "forbid"}
    then: Measured
    fail_probability: float


@dataclass(frozen=True, slots=True)
class PreviousRunComparison:
    """What changed since an earlier `run` of the same unit, where a certificate is no pass; no part of the verdict.

    `moved` are the values that differ beyond their uncertainty: figures of the condition first, then what keeps the
    unit from passing, the surest first. `same` values do not; `not_compared` (`untold` in files) are bounds, and values
    that one run lacks. `same_instruments`: with the same calibrations too. `missed` are the limits missed now whose
    value was measured then.
    """

    __pydantic_config__: ClassVar = {"extra": "forbid"}
    run: str
    started_utc: Moment
    verdict: Verdict | None
    moved: tuple[Moved, ...] = ()
    same: int = 0
    not_compared: Annotated[int, Field(alias="untold")] = 0  # its name in results.json
    same_instruments: bool = False
    missed: tuple[Missed, ...] = ()
