"""A unit beside itself: what an earlier run of the same serial number measured, and what has changed since."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pydantic import AwareDatetime

from hil.record.measurement import Measured, Verdict


@dataclass(frozen=True, slots=True)
class Moved:
    """A value that differs beyond its uncertainty between two runs of a unit."""

    __pydantic_config__: ClassVar = {"extra": "forbid"}
    then: Measured
    now: Measured


@dataclass(frozen=True, slots=True)
class Since:
    """What is said beside a verdict that is no pass; it judges nothing itself.

    Attributes:
        run: name of the earlier run. `started_utc`, `verdict`: of it.
        moved: each value that differs beyond its uncertainty: figures of the condition first, then what
            keeps the unit from passing; the surest first.
        same: how many values do not.
        untold: how many cannot be compared: bounds, and values that one run lacks.
        same_instruments: whether the same instruments with the same calibrations measured both.
    """

    __pydantic_config__: ClassVar = {"extra": "forbid"}
    run: str
    started_utc: AwareDatetime
    verdict: Verdict | None
    moved: tuple[Moved, ...] = ()
    same: int = 0
    untold: int = 0
    same_instruments: bool = False
