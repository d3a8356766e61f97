"""Conditions of the bench that differ between two dates: oil temperature and supply pressure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hil.passport.change import Change, Size
from hil.record.conditions import measured_conditions
from hil.record.measurement import COVERAGE_FACTOR
from hil.record.recording import Recording


class _Condition(NamedTuple):
    name: str
    stage: str
    stated: str
    unit: str


_CONDITIONS = (
    _Condition("oil temperature", "oil", "fluid_temperature_c", "°C"),
    _Condition("supply pressure", "supply", "supply_pressure_bar", "bar"),
)


def condition_changes(old: Sequence[Recording], new: Sequence[Recording]) -> list[Change]:
    """Those that were measured or stated at both dates and differ beyond their uncertainty."""
    found = []
    for one in _CONDITIONS:
        was, now = _mean(old, one), _mean(new, one)
        if was is None or now is None:
            continue
        width = COVERAGE_FACTOR * float(np.hypot(was[1] or 0.0, now[1] or 0.0))
        if abs(now[0] - was[0]) > width:
            found.append(Change(one.name, one.stage, "bench", one.name, Size(*was), Size(*now), one.unit, None, None))
    return found


def _mean(recordings: Sequence[Recording], one: _Condition) -> tuple[float, float | None] | None:
    """(mean, standard uncertainty) over the recordings: measured where a channel measures it, else as stated."""
    values = [value for recording in recordings if (value := _of(recording, one)) is not None]
    if not values:
        return None
    known = [std for _, std in values if std is not None]
    return float(np.mean([value for value, _ in values])), max(known) if known else None


def _of(recording: Recording, one: _Condition) -> tuple[float, float | None] | None:
    measured = measured_conditions(recording).get(one.stated)
    if measured is not None:
        return measured.mean, measured.std
    stated = (recording.meta.get("conditions") or {}).get(one.stated)
    return None if stated is None else (float(stated), None)
