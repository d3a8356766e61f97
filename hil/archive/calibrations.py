"""Instruments of the benches: which calibrations are in force, when they fall due, and runs made after that."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import Connection, func, select

from hil.archive.database import opened
from hil.archive.place import Place
from hil.archive.tables import CALIBRATION, OF_CALIBRATION, RUN
from hil.record.run_folder.instruments import StatedCalibration


@dataclass(frozen=True, slots=True)
class OverdueRun:
    """A run on a day after its calibration was due."""

    run: Path
    started_utc: dt.datetime
    due: dt.date


@dataclass(frozen=True, slots=True)
class Instrument:
    """An instrument of a bench.

    Attributes:
        bench: where it is.
        calibration: what the last run with it states.
        in_use: whether the last run of the bench was made with it.
        runs: how many runs were made with it, on all its calibrations; `last_used_utc` the start of the last.
        overdue: those of them that were made with a calibration that was overdue on their day (UTC).
    """

    bench: str
    calibration: StatedCalibration
    in_use: bool
    runs: int
    last_used_utc: dt.datetime
    overdue: tuple[OverdueRun, ...]


def instruments(place: Place) -> tuple[list[Instrument], int]:
    """(instruments of all benches, runs that an earlier version entered without their calibrations).

    Raises:
        ArchiveError: the index cannot be read.
    """
    asked = select(*RUN.c["bench", "started_utc", "folder"], *CALIBRATION.c[OF_CALIBRATION])
    used: dict[tuple[str, ...], list[tuple[dt.datetime, Path, StatedCalibration]]] = {}
    with opened(place, make=False) as engine, engine.connect() as index:
        last = _last_runs(index)
        for bench, started, folder, *fields in index.execute(
            asked.join_from(RUN, CALIBRATION).order_by(RUN.c.started_utc)
        ):
            one = StatedCalibration(*fields)
            key = (bench, one.channel, one.instrument, one.serial)
            used.setdefault(key, []).append((started, Path(folder), one))
        unread = index.scalar(select(func.count()).where(RUN.c.instruments.is_(None))) or 0
    return [_instrument(bench, uses, last[bench]) for (bench, *_), uses in sorted(used.items())], unread


def _last_runs(index: Connection) -> dict[str, dt.datetime]:
    asked = select(RUN.c.bench, func.max(RUN.c.started_utc)).where(RUN.c.instruments.is_not(None))
    return {row[0]: row[1] for row in index.execute(asked.group_by(RUN.c.bench))}


def _instrument(
    bench: str, uses: Sequence[tuple[dt.datetime, Path, StatedCalibration]], last: dt.datetime
) -> Instrument:
    """The instrument that runs used, the oldest first; the last says which calibration is in force."""
    used_utc, _, now = uses[-1]
    overdue = [
        OverdueRun(folder, started, one.due)
        for started, folder, one in uses
        if one.due is not None and started.astimezone(dt.UTC).date() > one.due
    ]
    return Instrument(bench, now, used_utc == last, len(uses), used_utc, tuple(dict.fromkeys(overdue)))
