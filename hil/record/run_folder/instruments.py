"""What a run states about its instruments: the calibrations that were in force, as its header has them."""

from __future__ import annotations

import datetime as dt
import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from hil.record.run_folder.header import Column, Header, stated


@dataclass(frozen=True, slots=True)
class StatedCalibration:
    """One calibration as a run states it; what nobody stated is empty, or None.

    Attributes:
        channel: that it is of, or that the instrument feeds.
        instrument: its name, or the source of the channel in words; `serial` its number.
        date, due: when it was made, and the last day on which it holds.
        reference: the certificate, or what it was made against.
        uncertainty: expanded (k = 2), with its unit, as it was stated.
    """

    channel: str
    instrument: str
    serial: str
    date: dt.date | None
    due: dt.date | None
    reference: str
    uncertainty: str

    def days_left(self, day: dt.date) -> int | None:
        """Days from a day to the last one on which it holds; negative when it is overdue, None without a due date."""
        return None if self.due is None else (self.due - day).days


def calibrations_of(header: Header) -> tuple[StatedCalibration, ...]:
    """Those of the channels, then those of the instruments."""
    return (*_of_channels(header.samples.columns), *_of_instruments(header.meta.get("instruments")))


def instruments_mark(header: Header) -> str:
    """A mark that two runs share when one bench measured both with the same calibrations."""
    lines = [(column.name, column.calibration) for column in header.samples.columns]
    both = json.dumps([header.meta.get("bench"), lines], sort_keys=True, default=str)
    return hashlib.sha256(both.encode()).hexdigest()


def _of_channels(columns: tuple[Column, ...]) -> Iterator[StatedCalibration]:
    for column in columns:
        line = column.calibration
        if line:
            yield StatedCalibration(
                column.name, column.source, "", _day(line.get("date")), _day(line.get("due")),
                stated(line, "source"), _width(line.get("uncertainty"), column.unit),
            )  # fmt: skip


def _of_instruments(listed: Any) -> Iterator[StatedCalibration]:
    for one in listed if isinstance(listed, list | tuple) else ():
        if isinstance(one, Mapping):
            yield StatedCalibration(
                stated(one, "channel"), stated(one, "name"), stated(one, "serial"),
                _day(one.get("calibrated")), _day(one.get("due")), "", stated(one, "uncertainty"),
            )  # fmt: skip


def _day(text: Any) -> dt.date | None:
    try:
        return dt.date.fromisoformat(str(text))
    except ValueError:
        return None


def _width(uncertainty: Any, unit: str) -> str:
    return f"{uncertainty:g} {unit}" if isinstance(uncertainty, int | float) else str(uncertainty or "")
