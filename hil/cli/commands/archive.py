"""`hil archive`: the index of the runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from hil.cli.options import Archive, Json, option
from hil.cli.printed import printed

if TYPE_CHECKING:
    import datetime as dt
    from collections.abc import Sequence

    from hil.archive.calibrations import Instrument

group = typer.Typer(no_args_is_help=True, help="Look after the index of the runs.")


@group.callback()
def _archive() -> None:
    """Look after the index of the runs."""


@group.command()
def rebuild(
    archive: Archive = "",
    folders: list[Path] = option([], "--folder", "DIR", "Also search this folder for runs."),
    as_json: Json = False,
) -> None:
    """Make the index anew from the run folders."""
    from hil.archive.archive import rebuild as rebuilt
    from hil.archive.place import archive_place

    place = archive_place(archive)
    count, left_out = rebuilt(place, [*([place.folder] if place.folder else []), *folders])
    for sentence in left_out:
        typer.echo(f"left out: {sentence}", err=True)
    document = {"schema": "hil.rebuilt/1", "archive": str(place), "runs": count, "left_out": left_out}
    printed(document, f"{place}: {count} runs", as_json)


@group.command()
def calibrations(
    due_within: int | None = option(
        None, "--due-within", "DAYS", "Those alone that fall due within so many days, or are overdue."
    ),
    archive: Archive = "",
    as_json: Json = False,
) -> None:
    """List the instruments of the benches, when their calibrations fall due, and runs made with an overdue one.

    An instrument that the last run of its bench does not state any more is out of use. Days are those of UTC.
    """
    import datetime as dt

    from hil.archive.calibrations import instruments
    from hil.archive.pending import searched
    from hil.cli.searches import not_entered

    found, unread = searched(archive, instruments, not_entered)
    day = dt.datetime.now(dt.UTC).date()
    shown = found if due_within is None else [one for one in found if _is_due(one, day, due_within)]
    undated = sum(one.in_use and one.calibration.due is None for one in found)
    document = {"schema": "hil.calibrations/1", "day": day, "calibrations": [_entry(one, day) for one in shown]}
    document |= {"without_due_date": undated, "runs_not_read": unread}
    printed(document, _text(shown, day, undated, unread), as_json)


def _is_due(one: Instrument, day: dt.date, within: int) -> bool:
    left = one.calibration.days_left(day)
    return one.in_use and left is not None and left <= within


def _entry(one: Instrument, day: dt.date) -> dict[str, object]:
    from dataclasses import asdict

    return {
        "bench": one.bench, **asdict(one.calibration), "days_left": one.calibration.days_left(day),
        "in_use": one.in_use, "runs": one.runs, "last_used_utc": one.last_used_utc, "overdue_runs": one.overdue,
    }  # fmt: skip


def _text(found: Sequence[Instrument], day: dt.date, undated: int, unread: int) -> str:
    from hil.report.terminal import aligned

    used = [_row(one, day) for one in found if one.in_use]
    head = ("bench", "channel", "instrument", "serial", "date", "due", "days left")
    lines = aligned([head, *used]) if used else ["no calibrations"]
    lines += [line for one in found for line in _overdue_lines(one)]
    if undated:
        lines.append(f"{undated} of the instruments in use state no due date: whether they are due cannot be told")
    if unread:
        lines.append(f"{unread} runs were entered without their calibrations: `hil archive rebuild` reads them")
    return "\n".join(lines)


def _row(one: Instrument, day: dt.date) -> tuple[str, ...]:
    stated, left = one.calibration, one.calibration.days_left(day)
    days = "" if left is None else f"{left} overdue" if left < 0 else str(left)
    date, due = _day(stated.date) or "not stated", _day(stated.due) or "not stated"
    return one.bench, stated.channel, stated.instrument, stated.serial, date, due, days


def _overdue_lines(one: Instrument) -> list[str]:
    from hil.report.local_time import local_text

    named = one.calibration.instrument or one.calibration.channel
    return [
        f"overdue: {run.run}, {local_text(run.started_utc, 'minutes')}: {named} was due on {run.due}"
        for run in one.overdue
    ]


def _day(day: dt.date | None) -> str:
    return "" if day is None else day.isoformat()
