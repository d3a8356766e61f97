"""Instruments of the benches: which calibrations are in force, when they fall due, and runs made after that."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, func, select

from hil.archive.database import opened
from hil.archive.place import Place
from hil.archive.tables import CALIBRATION, OF_CALIBRATION, RUN
from hil.record.instruments import StatedCalibration


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


@dataclass(frozen=True, slots=True)
class _Period:
    """One calibration of a bench, and the runs that state it."""

    bench: str
    stated: StatedCalibration
    runs: int
    last_utc: dt.datetime


def instruments(place: Place) -> tuple[list[Instrument], int]:
    """(instruments of all benches, runs that an earlier version entered without their calibrations).

    Raises:
        ArchiveError: the index cannot be read.
    """
    with opened(place, make=False) as engine, engine.connect() as index:
        last = _last_runs(index)
        found = [_instrument(index, periods, last) for periods in _by_instrument(_periods(index))]
        unread = index.scalar(select(func.count()).where(RUN.c.instruments.is_(None))) or 0
    return sorted(found, key=lambda one: (one.bench, one.calibration.channel, one.calibration.instrument)), unread


def _last_runs(index: Connection) -> dict[str, dt.datetime]:
    asked = select(RUN.c.bench, func.max(RUN.c.started_utc)).where(RUN.c.instruments.is_not(None))
    return {row[0]: row[1] for row in index.execute(asked.group_by(RUN.c.bench))}


def _periods(index: Connection) -> list[_Period]:
    columns = _columns()
    asked = select(RUN.c.bench, func.count(), func.max(RUN.c.started_utc), *columns)
    rows = index.execute(asked.join_from(RUN, CALIBRATION).group_by(RUN.c.bench, *columns))
    return [_Period(bench, StatedCalibration(*fields), runs, last) for bench, runs, last, *fields in rows]


def _columns() -> list[Any]:
    return list(CALIBRATION.c[OF_CALIBRATION])


def _by_instrument(periods: Sequence[_Period]) -> list[list[_Period]]:
    """The periods of each instrument, the one in force last."""
    found: dict[tuple[str, ...], list[_Period]] = {}
    for one in sorted(periods, key=lambda one: one.last_utc):
        stated = one.stated
        found.setdefault((one.bench, stated.channel, stated.instrument, stated.serial), []).append(one)
    return list(found.values())


def _instrument(index: Connection, periods: Sequence[_Period], last: dict[str, dt.datetime]) -> Instrument:
    now = periods[-1]
    overdue = [run for period in periods for run in _overdue(index, period)]
    return Instrument(
        now.bench, now.stated, now.last_utc == last[now.bench], sum(one.runs for one in periods), now.last_utc,
        tuple(sorted(overdue, key=lambda run: run.started_utc)),
    )  # fmt: skip


def _overdue(index: Connection, period: _Period) -> list[OverdueRun]:
    due = period.stated.due
    if due is None or due >= dt.date.max:
        return []
    after = dt.datetime.combine(due + dt.timedelta(days=1), dt.time(), dt.UTC)
    if period.last_utc < after:
        return []
    same = [column.is_not_distinct_from(getattr(period.stated, column.key)) for column in _columns()]
    asked = select(RUN.c.folder, RUN.c.started_utc).join_from(RUN, CALIBRATION)
    rows = index.execute(asked.where(RUN.c.bench == period.bench, RUN.c.started_utc >= after, *same).distinct())
    return [OverdueRun(Path(folder), started, due) for folder, started in rows]
