"""How a measured value of a unit went over time, and whether it drifts beyond what its repeatability explains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from hil.archive.entry import Entry
from hil.language.note import Note
from hil.language.words import marked
from hil.record.measurement import COVERAGE_FACTOR, Measured, names_of, present_name
from hil.signals.straight_line import chance_beyond, weighted_line

FALSE_ALARM_RATE = 0.01
_FEWEST = 3  # points below which a line through them tells nothing
_YEAR_S = 365.25 * 86400.0


@dataclass(frozen=True, slots=True)
class Point:
    """A value at its date."""

    run: str
    started_utc: datetime
    value: Measured
    simulated: bool | None = None


@dataclass(frozen=True, slots=True)
class Drift:
    """The slope of a straight line through the values, per year, with its standard uncertainty.

    `chance`: how likely a slope so far from zero is for a unit that does not change. None of the three where the points
    tell no slope.
    """

    per_year: float | None
    std: float | None
    chance: float | None
    unit: str

    @property
    def is_drift(self) -> bool:
        """Whether the value drifts, at the stated false-alarm rate."""
        return self.chance is not None and self.chance < FALSE_ALARM_RATE

    @property
    def sentence(self) -> Note:
        """In words, with the rate of false alarms."""
        if self.per_year is None or self.std is None or self.chance is None:
            return Note(
                "No drift can be determined: at least {count} values with an uncertainty, at different times, are "
                "needed.",
                count=_FEWEST,
            )
        text = (
            marked("It drifts: {change:+.3g} ± {u:.2g} {unit} per year (false-alarm rate {rate:g} %).")
            if self.is_drift
            else marked("No drift: {change:+.3g} ± {u:.2g} {unit} per year (false-alarm rate {rate:g} %).")
        )
        expanded, rate = COVERAGE_FACTOR * self.std, 100.0 * FALSE_ALARM_RATE
        return Note(text, change=self.per_year, u=expanded, unit=self.unit, rate=rate)


def points_of(runs: Sequence[Entry], measurement: str) -> list[Point]:
    """The values of one quantity, by its name and place, or its name alone for every place."""
    found, measurement = [], present_name(measurement)
    for run in runs:
        named = [value for value in run.values if measurement in names_of(value.name)]
        found += [Point(run.folder.name, run.started_utc, one, run.simulated) for one in named if one.value is not None]
    return found


def drift_of(points: Sequence[Point]) -> Drift:
    """Weighted straight line through values and bounds left out; the test is Student's t on its slope.

    The weights are the repeatabilities: what the calibration adds is the same at all dates. Where values scatter more
    than these say, the scatter sets the scale (Birge).
    """
    used = [p for p in points if p.value.relation == "=" and (p.value.repeatability or 0.0) > 0.0]
    unit = used[0].value.unit if used else ""
    years = np.array([p.started_utc.timestamp() / _YEAR_S for p in used])
    if len(used) < _FEWEST or np.ptp(years) == 0.0:
        return Drift(None, None, None, unit)
    values = np.array([p.value.value for p in used], dtype=np.float64)
    line = weighted_line(years, values, np.array([1.0 / (p.value.repeatability or 1.0) ** 2 for p in used]))
    std = line.slope_std(least_variance=1.0)
    return Drift(line.slope, std, chance_beyond(line.slope / std, line.freedom), unit)
