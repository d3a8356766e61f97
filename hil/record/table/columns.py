"""Columns as other programs write them, and the tables that they stand in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil.errors import option
from hil.record.recording import Array
from hil.record.table import heading as headings
from hil.record.table.clocks import shortest, with_minutes, without_changed_clocks, without_rollover
from hil.record.table.tokens import as_numbers, is_number, is_stamp, stamps
from hil.units import convert

_MOST_COLUMNS = 256


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
        """What it is called; the unit is empty when none is stated (see `heading.split`)."""
        heading, unit = headings.on_one_line(self.heading), headings.unit_text(headings.on_one_line(self.unit))
        if unit and ("[" not in heading or headings.is_indexed(heading)):
            return heading, unit
        name, stated = headings.split(heading)
        return name, unit or stated

    @property
    def is_number(self) -> bool:
        """Whether it holds one real number per row."""
        return self.values.ndim == 1 and self.values.dtype.kind in "biuf"

    @property
    def is_dated(self) -> bool:
        """Whether it holds stamps of a calendar or a clock."""
        return self.values.ndim == 1 and self.values.dtype.kind in "mM"

    @property
    def is_time(self) -> bool:
        """Whether it holds the time, by its name."""
        name, unit = self.name_and_unit
        if self.is_dated:
            return True
        surely = headings.plain_name(name) == "time"  # with another unit it is refused, not taken for a signal
        return self.is_number and headings.is_time(name) and (surely or not unit or headings.is_time_unit(unit))

    @property
    def may_be_time(self) -> bool:
        """Whether it holds a time of its own: by its name's first word, its unit, and values that increase."""
        name, unit = self.name_and_unit
        called = headings.may_be_time(name) and headings.is_time_unit(unit or "s")
        return self.is_number and called and self.rises and not self.counts_rows

    @property
    def is_like_time(self) -> bool:
        """Whether it holds a time by its unit (`X [s]`) or its name's end (`SimTime`), and values that increase."""
        name, unit = self.name_and_unit
        called = headings.is_time_unit(unit) if unit else headings.ends_as_time(name) or headings.fraction_ns(name) > 0
        return self.is_number and called and self.rises

    @property
    def rises(self) -> bool:
        """Whether its values increase from row to row, but for those that are missing."""
        real = self.values[~np.isnan(self.values)] if self.values.dtype.kind == "f" else self.values
        return len(real) > 1 and bool(np.all(real[1:] > real[:-1]))

    @property
    def counts_rows(self) -> bool:
        """Whether it does nothing but number the rows."""
        name, unit = self.name_and_unit
        bare = unit in ("", "1") or headings.is_counter(unit.rstrip("."))
        if not (self.is_number and headings.is_counter(name) and bare and len(self.values) > 1):
            return False
        return bool(np.all(np.diff(self.values.astype(np.float64)) == 1.0))

    def seconds(self, unit: str = "", origin: Any = None) -> tuple[Array, str]:
        """The time in seconds, and what had to be assumed for it.

        Args:
            unit: instead of the one that is stated.
            origin: stamp from which stamps of a calendar or a clock count; the first of them when not given.

        Raises:
            UnitError: its unit measures something else.
        """
        name, stated = self.name_and_unit
        if self.is_dated:
            second = np.timedelta64(1, "s")
            stamps, changed = without_changed_clocks(self.values)
            first = stamps[:1] if origin is None else origin
            start = (
                f"time counts from {shortest(np.ravel(first)[0])}" if stamps.size and stamps.dtype.kind == "M" else ""
            )
            return (stamps - first) / second, "; ".join(filter(None, (start, changed)))
        unit = headings.spelt_time_unit(unit or stated or headings.time_unit(name))
        values, assumed = without_rollover(np.asarray(self.values, dtype=np.float64))
        if not unit:
            values, clocks = with_minutes(values)
            unit, kind = ("s", clocks) if clocks else headings.unit_of_stamps(values)
            taken = (
                f"no unit is stated for '{name}'; taken as {kind}, {option('unit', f'{name}=ms')} would say otherwise"
            )
            assumed = "; ".join(filter(None, (assumed, taken)))
            if unit == "day":  # seconds since the year 0 would have no digits left for a sample's
                values = values - values[0]
        return values if unit in ("", "s") else convert(values, unit, "s"), assumed


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Columns of one length; `time_s` is their time base when no column is, `assumed` says where it is from."""

    name: str
    columns: Sequence[Column]
    time_s: Array | None = None
    assumed: str = ""


Contents = tuple[list[Table], str]
"""The tables of a file, and the line in which a file of this program says more (see `about`)."""


def numbers(properties: Mapping[str, Any]) -> dict[str, float]:
    """The single numbers among what is said about a file, a group or a channel."""
    single = {key: np.asarray(value) for key, value in properties.items() if np.size(value) == 1}
    return {key: float(value.item()) for key, value in single.items() if value.dtype.kind in "iuf"}


def even_times(count: int, interval_s: float, start_s: float = 0.0) -> Array:
    """The stamps of so many evenly spaced samples."""
    return start_s + interval_s * np.arange(count, dtype=np.float64)


def even_table(name: str, columns: Sequence[Column], numbers: Mapping[str, float]) -> Table:
    """A table, on an even time base when no column holds the time and one of the numbers is a known interval.

    Known are an interval in seconds (`Ts`, `dt`, `wf_increment`, …), a rate in hertz (`fs`, `sample_rate`, …), and
    beside them the first stamp (`t0`, `x0`, `start_time`).
    """
    if any(column.is_time for column in columns) or not columns:
        return Table(name, columns)
    start_s = next((value for key, value in numbers.items() if headings.is_start(key)), 0.0)
    for key, value in numbers.items():
        interval_s = headings.interval_of(key, value)
        if interval_s > 0:
            time_s = even_times(len(columns[0].values), interval_s, start_s)
            return Table(name, columns, time_s, f"even time base from {key} = {value:g}")
    return Table(name, columns)


def from_texts(column: Column) -> Column:
    """A column of texts as the stamps or the numbers that every one of them is; as it is where they are neither."""
    if column.values.ndim != 1 or column.values.dtype.kind not in "SUO" or not len(column.values):
        return column
    texts = [text.decode(errors="replace") if isinstance(text, bytes) else text for text in column.values.tolist()]
    if not all(isinstance(text, str) for text in texts):
        return column
    if all(map(is_number, texts)):
        return replace(column, values=as_numbers(texts))
    if all(map(is_stamp, texts)):
        with suppress(ValueError, OverflowError):
            return replace(column, values=stamps(texts))
    return column


def from_matrix(name: str, values: NDArray[Any], unit: str) -> list[Column]:
    """A vector as one column, a matrix as numbered ones along its longer side; anything else as none."""
    values = np.squeeze(values)
    if values.ndim == 1:
        return [Column(name, values, unit)]
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
