"""Which rows of a channel hold no sample: empty fields, numbers that stand for none, stamps that repeat."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from hil.errors import FileError, option
from hil.language.note import Note
from hil.record.recording import Array, Mask
from hil.record.table.columns import Column

_BEYOND = 10.0  # times all other values
_FEW = 4  # values; a channel with so few is a state, not a measurement
_FEW_REPEATED = 0.1  # of the stamps

Place = Callable[[int], str]


def missing_values(column: Column, values: Array, time_s: Array, place: Place, gaps: bool) -> tuple[Mask, list[str]]:
    """The rows without a sample, and what there is to say about them.

    Fields that leave a channel evenly sampled are its own rate, and nothing is said of them here.

    Args:
        column: the channel.
        values: its numbers, shape (n,).
        time_s: their stamps, shape (n,).
        place: where a row stands.
        gaps: whether single rows may have no sample.

    Raises:
        FileError: single rows have none, and nothing was said about gaps; says where and what helps.
    """
    missing, notes = (~np.isfinite(values) if gaps else np.isnan(values)) | np.isnan(time_s), []
    if missing.any() and not missing.all() and not is_even(time_s[~missing]):
        notes += _blanks(column, missing, place, gaps)
    number = _stands_for_none(values)
    if number is not None:
        notes += _stand_ins(column, values == number, number, place, gaps)
        missing |= values == number
    if gaps:
        again = np.flatnonzero(np.diff(time_s) == 0.0) + 1
        if again.size and again.size <= _FEW_REPEATED * len(time_s):  # more than a few are stamps that were rounded
            missing[again] = True
            notes.append(Note("{count} of {rows} rows have the stamp of the row before and are left out",
                              count=again.size, rows=len(time_s)))  # fmt: skip
    return missing, notes


def is_even(time_s: Array) -> bool:
    """Whether stamps lie evenly apart, within a twentieth; never true of a few."""
    steps = np.diff(time_s)
    if len(steps) <= 4:
        return False
    usual = float(np.median(steps))
    return bool(steps.max() <= 1.05 * usual and steps.min() >= 0.95 * usual)


def is_stand_in(value: float) -> bool:
    """Whether loggers write a number where nothing was measured: nines alone, -999.25, 9.91e37 (SCPI) and beyond."""
    size = abs(value)
    return 1e30 <= size < math.inf or size == 999.25 or (size >= 999.0 and set(f"{size:.9g}") <= {"9", "."})


def _blanks(column: Column, missing: Mask, place: Place, gaps: bool) -> list[str]:
    """Scattered samples that are missing, in words; a channel of a rate of its own is spoken of elsewhere."""
    at = np.flatnonzero(missing)
    if at.size > len(missing) // 2 or missing[at[0] :].all():
        return []
    label = column.name_and_unit[0]
    if not gaps:
        raise FileError(
            f"{place(int(at[0]))}, channel '{label}': no value ({at.size} such of {len(missing)}); with "
            f"{option('gaps')} "
            f"that is a sample that was not taken, and {option('columns')} can leave the channel out"
        )
    return [Note("'{channel}' has no value in {count} of {rows} rows, the first at {place}", channel=label,
                 count=at.size, rows=len(missing), place=place(int(at[0])))]  # fmt: skip


def _stands_for_none(values: Array) -> float | None:
    """The number that stands for no value, as loggers write one (-9999): far beyond all others."""
    if len(values) < _FEW or np.isnan(values).all():
        return None
    for extreme in (float(np.nanmin(values)), float(np.nanmax(values))):
        if not is_stand_in(extreme):
            continue
        others = values[(values != extreme) & np.isfinite(values)]
        if 2 * len(others) > len(values) and _BEYOND * np.abs(others).max() < abs(extreme) and len(set(others)) > _FEW:
            return extreme
    return None


def _stand_ins(column: Column, here: Mask, number: float, place: Place, gaps: bool) -> list[str]:
    at, label = np.flatnonzero(here), column.name_and_unit[0]
    if not gaps:
        raise FileError(
            f"{place(int(at[0]))}, channel '{label}': {number:g} lies far beyond all other values, as loggers "
            f"write where nothing was measured ({at.size} such of {len(here)}); with {option('gaps')} that is a "
            "sample that was "
            f"not taken, and {option('columns')} can leave the channel out"
        )
    return [Note("'{channel}' is {number:g} in {count} of {rows} rows, treated as missing", channel=label,
                 number=number, count=at.size, rows=len(here))]  # fmt: skip
