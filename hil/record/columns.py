"""Columns as other programs write them: headings, units and times read with some goodwill."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil.errors import UnitError
from hil.record.recording import Array
from hil.units import check_unit, convert

_TIME_NAMES = frozenset({"time", "t", "timestamp", "timestamps", "zeit"})
_INTERVALS = frozenset({"ts", "dt", "delta_t", "sample_time", "sampling_time", "sampling_interval", "wf_increment"})
_RATES = frozenset({"fs", "sample_rate", "samplerate", "sampling_rate", "sampling_frequency", "rate_hz"})
_MOST_COLUMNS = 256
_SQUARE = re.compile(r"^\s*(?P<name>.*\S)\s*\[(?P<unit>[^\[\]]*)\]\s*$")
_LOOSE = re.compile(r"^\s*(?P<name>.*\S)(\s*\((?P<round>[^()]+)\)|\s+/\s+(?P<over>\S+))\s*$")


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """One column of a file: its heading, its unit where the file states one apart from that, its values."""

    heading: str
    values: NDArray[Any]
    unit: str = ""
    source: str = ""
    calibration: Mapping[str, Any] = field(default_factory=dict)

    @property
    def name_and_unit(self) -> tuple[str, str]:
        """What it is called; the unit is empty when none is stated.

        `flow [l/min]`, and where the bracket holds a unit also `flow (l/min)` and `flow / l/min`.
        """
        if match := _SQUARE.match(self.heading):
            return match["name"], self.unit or match["unit"].strip()
        if not self.unit and (match := _LOOSE.match(self.heading)):
            unit = (match["round"] or match["over"]).strip()
            if _is_unit(unit):
                return match["name"], unit
        return self.heading.strip(), self.unit

    @property
    def is_number(self) -> bool:
        """Whether it holds one real number per row."""
        return self.values.ndim == 1 and self.values.dtype.kind in "biuf"

    @property
    def is_time(self) -> bool:
        """Whether it holds the time."""
        dated = self.values.ndim == 1 and self.values.dtype.kind in "mM"
        return dated or (self.is_number and is_time(self.name_and_unit[0]))

    def seconds(self) -> tuple[Array, str]:
        """The time in seconds, and what had to be assumed for it.

        Raises:
            UnitError: its unit measures something else.
        """
        name, unit = self.name_and_unit
        if self.values.dtype.kind in "mM":
            second = np.timedelta64(1, "s")
            start = f"time counts from {self.values[0]}" if self.values.size and self.values.dtype.kind == "M" else ""
            return (self.values - self.values[:1]) / second, start
        assumed = "" if unit else f"no unit is stated for '{name}'; taken as seconds"
        return convert(self.values.astype(np.float64), unit or "s", "s"), assumed


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Columns of one length; `time_s` is their time base when no column is, `assumed` says where it is from."""

    name: str
    columns: Sequence[Column]
    time_s: Array | None = None
    assumed: str = ""


def even_table(name: str, columns: Sequence[Column], numbers: Mapping[str, float]) -> Table:
    """A table, on an even time base when no column holds the time and one of the numbers is a known interval.

    Known are an interval in seconds (`Ts`, `dt`, `wf_increment`, …) and a rate in hertz (`fs`, `sample_rate`, …).
    """
    if any(column.is_time for column in columns) or not columns:
        return Table(name, columns)
    for key, value in numbers.items():
        interval_s = value if key.casefold() in _INTERVALS else 1.0 / value if key.casefold() in _RATES else 0.0
        if interval_s > 0:
            time_s = interval_s * np.arange(len(columns[0].values), dtype=np.float64)
            return Table(name, columns, time_s, f"even time base from {key} = {value:g}")
    return Table(name, columns)


def from_matrix(name: str, values: NDArray[Any], unit: str = "", **more: Any) -> list[Column]:
    """A vector as one column, a matrix as numbered ones along its longer side; anything else as none."""
    values = np.squeeze(values)
    if values.ndim == 1:
        return [Column(name, values, unit, **more)]
    if values.ndim == 2 and min(values.shape) <= _MOST_COLUMNS:
        rows = values if values.shape[0] < values.shape[1] else values.T
        return [Column(f"{name} {i}", row, unit) for i, row in enumerate(rows, 1)]
    return []


def by_length(columns: Sequence[Column]) -> list[list[Column]]:
    """Columns sorted into groups of one length, in the order of their first appearance."""
    groups: dict[int, list[Column]] = {}
    for column in columns:
        groups.setdefault(len(column.values), []).append(column)
    return list(groups.values())


def is_time(name: str) -> bool:
    """Whether a column of this name holds the time."""
    return name.strip().casefold() in _TIME_NAMES


def _is_unit(text: str) -> bool:
    try:
        check_unit(text)
    except UnitError:
        return False
    return True
