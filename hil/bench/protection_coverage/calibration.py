"""Calibrations that are overdue, or have no date."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator

from hil.bench.file import Bench
from hil.bench.read import BenchFile
from hil.errors import SettingError
from hil.language.note import Note


def overdue(bench: Bench, day: dt.date) -> Iterator[Note]:
    """A sentence for each calibration that was due before a day: of channels, and of instruments."""
    for name, channel in bench.channels.items():
        given = channel.calibration
        if given is not None and given.due is not None and given.due < day:
            yield _overdue(Note("Channel '{name}'", name=name), given.due, day)
    for instrument in bench.instruments:
        if instrument.due is not None and instrument.due < day:
            name, serial = instrument.name, instrument.serial
            numbered = Note("Instrument '{name}' (serial {serial})", name=name, serial=serial)
            yield _overdue(numbered if serial else Note("Instrument '{name}'", name=name), instrument.due, day)


def _overdue(what: Note, due: dt.date, day: dt.date) -> Note:
    return Note(
        "{what}: its calibration was due on {due}; the day of this test is {day}.",
        what=what, due=str(due), day=str(day),
    )  # fmt: skip


def deviations_on(file: BenchFile, day: dt.date) -> list[Note]:
    """What of the calibrations a run on this day departs from, for its header.

    Raises:
        SettingError: something is overdue and the bench file says `overdue = "refuse"`; nothing was opened.
    """
    found = list(overdue(file.bench, day))
    if found and file.bench.protection.overdue == "refuse":
        raise SettingError(
            f'{file.path}: {found[0].removesuffix(".")}; [protection] says overdue = "refuse": calibrate it and put '
            f"in its new dates, or take that away"
        )
    return found


def overdue_today(file: BenchFile, day: dt.date) -> Iterator[str]:
    """What is overdue, with its remedy."""
    for text in overdue(file.bench, day):
        yield f"{text.partition(';')[0]}: calibrate it and put in its new dates; until then each run has a deviation"


def undated(file: BenchFile, _day: dt.date) -> Iterator[str]:
    """Calibrations of which nobody can say when they were made."""
    for name, channel in file.bench.channels.items():
        if channel.calibration is not None and channel.calibration.date is None:
            yield f"channel '{name}': its calibration has no date: say calibration.date = YYYY-MM-DD"


def dated_ahead(file: BenchFile, day: dt.date) -> Iterator[str]:
    """Calibrations that are said to be made on a day that has not come."""
    dates = [(f"channel '{name}'", channel.calibration.date)
             for name, channel in file.bench.channels.items() if channel.calibration is not None]  # fmt: skip
    dates += [(f"instrument '{instrument.name}'", instrument.calibrated) for instrument in file.bench.instruments]
    for whose, date in dates:
        if date is not None and date > day:
            yield f"{whose}: its calibration is dated {date}, and today is {day}: put in the day it was made"
