"""A recording from the tables of a file: time bases found and joined, what is no signal left out.

Whatever had to be assumed or changed on the way is said in `meta["assumed"]`, a sentence each. Channels without
a stated unit get 1 and are named in `meta["units_missing"]`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hil.errors import FileError, UnitError
from hil.record.columns import Column, Table
from hil.record.recording import Array, Channel, Recording, check


@dataclass(frozen=True, slots=True, eq=False)
class _Timed:
    """Signals of one table on its own time base, and what was assumed to get there."""

    name: str
    time_s: Array
    signals: tuple[Column, ...]
    assumed: tuple[str, ...] = ()


def assemble(name: str, tables: Sequence[Table], meta: Mapping[str, Any] | None = None) -> Recording:
    """One recording from tables.

    Channels of several time bases are brought to the one with the most samples, within the time that all of
    them cover: real numbers along straight lines, whole numbers (states, counters) held. A table without a
    time takes that of another one of its length.

    Raises:
        FileError: no time, no signal, or samples that are no recording (see `recording.check`).
    """
    timed = list(_timed(name, tables))
    if not timed:
        have = ", ".join(f"'{column.heading}'" for table in tables for column in table.columns)
        there = f"no signal with a time was found, but {have}" if have else "no signal was found"
        raise FileError(f"{name}: {there}; call the column of the time 'time [s]'")
    timed = [table for table in timed if len(table.time_s)] or timed[:1]
    base = max(timed, key=lambda table: len(table.time_s))
    time_s = _common(name, base.time_s, timed)
    channels: dict[str, Channel] = {}
    units_missing = []
    for table in timed:
        for column in table.signals:
            heading, unit = column.name_and_unit
            label = _free_name(heading, table.name, channels)
            values = _at(time_s, table.time_s, column.values)
            channels[label] = Channel(label, unit or "1", values, column.source, column.calibration)
            units_missing += [] if unit else [label]
    assumed = [sentence for table in timed for sentence in table.assumed]
    assumed += [_joined(table, base) for table in timed if not np.array_equal(table.time_s, base.time_s)]
    said: dict[str, Any] = {**(meta or {}), **({"units_missing": units_missing} if units_missing else {})}
    if assumed:
        said["assumed"] = assumed
    found = Recording(name, time_s, channels, said)
    check(found)
    return found


def _timed(name: str, tables: Sequence[Table]) -> Iterator[_Timed]:
    found = [(table, *_time(name, table)) for table in tables]
    by_length = {len(time_s): time_s for _, time_s, _ in reversed(found) if time_s is not None}
    for table, own_s, assumed in found:
        clock = next((column for column in table.columns if column.is_time), None) if table.time_s is None else None
        signals = tuple(column for column in table.columns if column.is_number and column is not clock)
        other = [column.heading for column in table.columns if not column.is_number and column is not clock]
        left_out = (f"left out, not one number per sample: {', '.join(other)}",) if other else ()
        length = len(signals[0].values) if signals else 0
        time_s = by_length.get(length) if own_s is None else own_s
        if signals and time_s is not None:
            yield _Timed(table.name, time_s, signals, (*assumed, *left_out))


def _time(name: str, table: Table) -> tuple[Array | None, tuple[str, ...]]:
    said = (table.assumed,) if table.assumed else ()
    if table.time_s is not None:
        return table.time_s, said
    for column in table.columns:
        if column.is_time:
            try:
                time_s, assumed = column.seconds()
            except UnitError as error:
                raise FileError(f"{name}: time column '{column.heading}': {error}") from None
            return time_s, (*said, assumed) if assumed else said
    return None, said


def _common(name: str, time_s: Array, timed: Sequence[_Timed]) -> Array:
    if len(timed) == 1:
        return time_s
    start, stop = max(table.time_s[0] for table in timed), min(table.time_s[-1] for table in timed)
    common: Array = time_s[(time_s >= start) & (time_s <= stop)]
    if len(common) < 2:
        raise FileError(f"{name}: its time bases have no time in common: {', '.join(table.name for table in timed)}")
    return common


def _at(time_s: Array, own_s: Array, values: Array) -> Array:
    real = np.ascontiguousarray(values, dtype=np.float64)
    if np.array_equal(time_s, own_s) or len(values) != len(own_s):
        return real  # a wrong length is said by `check`, with the channel's name
    if values.dtype.kind == "f":
        return np.interp(time_s, own_s, real)
    held: Array = real[np.searchsorted(own_s, time_s, side="right") - 1]
    return held


def _joined(table: _Timed, base: _Timed) -> str:
    names = ", ".join(column.name_and_unit[0] for column in table.signals)
    return f"{names}: brought from {len(table.time_s)} samples to the times of the {len(base.time_s)} of {base.name}"


def _free_name(wanted: str, table: str, taken: Mapping[str, Any]) -> str:
    candidates = (wanted, f"{wanted} ({table})", *(f"{wanted} ({table}, {i})" for i in range(2, len(taken) + 3)))
    return next(name for name in candidates if name not in taken and name != "time")
