"""Conditions of the bench that differ between two dates: oil temperature and supply pressure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hil.passport.change import Change, Size
from hil.record.conditions import measured_conditions
from hil.record.measurement import COVERAGE_FACTOR
from hil.record.recording import Recording

_CONDITIONS = (
    ("oil temperature", "oil", "fluid_temperature_c", "°C"),
    ("supply pressure", "supply", "supply_pressure_bar", "bar"),
)
"""Its name, the stage where it is, its name in the bench file, the unit of that name."""


def condition_changes(old: Sequence[Recording], new: Sequence[Recording]) -> list[Change]:
    """Those that were measured or stated at both dates and differ beyond their uncertainty."""
    found = []
    for name, stage, key, unit in _CONDITIONS:
        was, now = _mean(old, key), _mean(new, key)
        if was is None or now is None:
            continue
        width = COVERAGE_FACTOR * float(np.hypot(was.std or 0.0, now.std or 0.0))
        if abs((now.value or 0.0) - (was.value or 0.0)) > width:
            found.append(Change(name, stage, "bench", name, was, now, unit, None, None))
    return found


def _mean(recordings: Sequence[Recording], key: str) -> Size | None:
    """Over the recordings: measured where a channel measures it, else as stated."""
    values, stds = [], []
    for recording in recordings:
        measured = measured_conditions(recording).get(key)
        stated = (recording.meta.get("conditions") or {}).get(key)
        if measured is not None:
            values.append(measured.mean)
            stds.append(measured.std)
        elif stated is not None:
            values.append(float(stated))
    return Size(float(np.mean(values)), max(stds, default=None)) if values else None
