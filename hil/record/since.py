"""A unit beside itself: what an earlier run of the same serial number measured, and what has changed since."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from hil.record.measurement import Measured, Verdict


@dataclass(frozen=True, slots=True)
class Since:
    """What is said beside a verdict that is no pass; it judges nothing itself.

    Attributes:
        run: name of the earlier run. `started_utc`, `verdict`: of it.
        moved: (then, now) of each value that differs beyond its uncertainty: figures of the condition first, then what
            keeps the unit from passing; the surest first.
        same: how many values do not.
        untold: how many cannot be compared: bounds, and values that one run lacks.
        same_instruments: whether the same instruments with the same calibrations measured both.
    """

    run: str
    started_utc: datetime
    verdict: Verdict | None
    moved: tuple[tuple[Measured, Measured], ...]
    same: int
    untold: int
    same_instruments: bool
