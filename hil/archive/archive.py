"""Enter runs into the index, find them again, and make the index anew from the folders."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from sqlalchemy import Select, delete, select
from sqlalchemy.orm import Session

from hil.archive.database import opened
from hil.archive.entry import Entry, entry_of, run_folders
from hil.archive.place import INDEX_FILE, Place
from hil.archive.tables import OF_CALIBRATION, CalibrationRow, RunRow, ValueRow
from hil.errors import ArchiveError, FileError
from hil.findings.results import Value

_AT_ONCE = 500


@dataclass(frozen=True, slots=True)
class Search:
    """Which runs are looked for; what is None or empty is not asked."""

    serial: str = ""
    procedure: str = ""
    since: datetime | None = None
    verdict: str = ""


def enter(place: Place, folders: Iterable[Path]) -> None:
    """Enter run folders into the index; one that is in it already is entered anew.

    Raises:
        ArchiveError: the index cannot be written.
        FileError: not a run folder.
    """
    _put(place, [entry_of(folder) for folder in folders])


def enter_readable(place: Place, folders: Iterable[Path]) -> list[str]:
    """Enter those run folders that can be read; why the others were left out.

    Raises:
        ArchiveError: the index cannot be written.
    """
    left_out: list[str] = []
    entries = []
    for folder in folders:
        try:
            entries.append(entry_of(folder))
        except FileError as error:  # a header that a power cut tore keeps no other run out
            left_out.append(str(error))
    if entries:
        _put(place, entries)
    return left_out


def _put(place: Place, entries: list[Entry]) -> None:
    with opened(place) as engine, Session(engine) as session, session.begin():
        _enter(session, entries)


def find_runs(place: Place, search: Search, *, values: bool = False) -> list[Entry]:
    """Runs by what was asked, the oldest first; with their measured values when these are wanted.

    Raises:
        ArchiveError: the index cannot be read.
    """
    with opened(place, make=False) as engine, Session(engine) as session:
        wanted = _asked(search)
        of_runs = _values_of(session, wanted) if values else {}
        asked = wanted.with_only_columns(RunRow.id, RunRow.folder, *(getattr(RunRow, name) for name in _TOLD))
        found = session.execute(asked.order_by(RunRow.started_utc, RunRow.id))
        return [
            Entry(folder=Path(folder), values=tuple(of_runs.get(key, ())), **dict(zip(_TOLD, told, strict=True)))
            for key, folder, *told in found
        ]


def _values_of(session: Session, wanted: Select[Any]) -> dict[int, list[Value]]:
    """Measured values of the runs that are wanted, by the run's number."""
    runs = wanted.with_only_columns(RunRow.id).scalar_subquery()
    columns = [getattr(ValueRow, name) for name in _OF_VALUE]
    asked = select(ValueRow.run_id, *columns).where(ValueRow.run_id.in_(runs)).order_by(ValueRow.id)
    found: dict[int, list[Value]] = {}
    for run, *told in session.execute(asked):
        found.setdefault(run, []).append(Value(**dict(zip(_OF_VALUE, told, strict=True))))
    return found


def rebuild(place: Place, folders: Sequence[Path]) -> tuple[int, list[str]]:
    """Make the index anew from run folders: (runs entered, why others were left out).

    Args:
        place: the archive.
        folders: where runs lie, at any depth. For an archive without a folder of its own, those in which its runs lay
            are searched too.

    Raises:
        ArchiveError: the index cannot be written.
        FileError: a folder cannot be read.
    """
    if not any(folder.is_dir() for folder in folders) and place.is_away:
        raise ArchiveError(f"archive {place}: there is no such folder")
    left_out: list[str] = []
    _clear_unreadable(place)
    with opened(place) as engine, Session(engine) as session, session.begin():
        known = {Path(folder).parent for folder in session.scalars(select(RunRow.folder))}
        roots = {folder.resolve() for folder in folders} | {folder for folder in known if folder.is_dir()}
        session.execute(delete(CalibrationRow))
        session.execute(delete(ValueRow))
        session.execute(delete(RunRow))
        count = 0
        for batch in _batches(_entries(sorted(roots), left_out)):
            session.add_all([_row(entry) for entry in batch])
            session.flush()
            session.expunge_all()
            count += len(batch)
    return count, left_out


def _clear_unreadable(place: Place) -> None:
    """Remove an index in the archive's own folder that cannot be opened: everything in it stands in the folders."""
    if place.folder is None:
        return
    try:
        with opened(place):
            pass
    except ArchiveError:
        for path in place.folder.glob(f"{INDEX_FILE}*"):
            path.unlink(missing_ok=True)


def _enter(session: Session, entries: Sequence[Entry]) -> None:
    folders = [str(entry.folder) for entry in entries]
    for row in session.scalars(select(RunRow).where(RunRow.folder.in_(folders))):
        session.delete(row)
    session.flush()
    session.add_all([_row(entry) for entry in entries])


def _entries(roots: Iterable[Path], left_out: list[str]) -> Iterator[Entry]:
    seen: set[Path] = set()
    for root in roots:
        for folder in run_folders(root):
            if folder in seen:
                continue
            seen.add(folder)
            try:
                yield entry_of(folder)
            except FileError as error:
                left_out.append(str(error))


def _batches(entries: Iterator[Entry]) -> Iterator[list[Entry]]:
    batch: list[Entry] = []
    for entry in entries:
        batch.append(entry)
        if len(batch) == _AT_ONCE:
            yield batch
            batch = []
    if batch:
        yield batch


def _asked(search: Search) -> Select[Any]:
    asked = select(RunRow)
    for column, wanted in ((RunRow.serial, search.serial), (RunRow.procedure, search.procedure)):
        if wanted:
            asked = asked.where(column == wanted)
    if search.verdict:
        asked = asked.where(RunRow.verdict == search.verdict)
    return asked if search.since is None else asked.where(RunRow.started_utc >= search.since)


def _row(entry: Entry) -> RunRow:
    told = {name: getattr(entry, name) for name in _TOLD}
    values = [ValueRow(**{name: getattr(value, name) for name in _OF_VALUE}) for value in entry.values]
    stated = [CalibrationRow(**{name: getattr(one, name) for name in OF_CALIBRATION}) for one in entry.calibrations]
    return RunRow(folder=str(entry.folder), name=entry.folder.name, values=values, calibrations=stated, **told)


_TOLD = ("serial", "operator", "procedure", "bench", "started_utc", "outcome", "verdict", "instruments")
_OF_VALUE = ("name", "value", "std", "calibration_std", "unit", "low", "high", "relation", "verdict")
