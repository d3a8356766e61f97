"""Enter runs into the index, find them again, and make the index anew from the folders."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from sqlalchemy import Select, delete, false, select
from sqlalchemy.orm import Session

from hil.archive.database import DamagedIndexError, is_refusal, opened, refused_by
from hil.archive.entry import Entry, entry_of, run_folders, this_host
from hil.archive.place import INDEX_FILE, Place
from hil.archive.tables import OF_CALIBRATION, CalibrationRow, RunRow, ValueRow
from hil.errors import ArchiveError, FileError
from hil.record.measurement import Measured

_BATCH = 500


@dataclass(frozen=True, slots=True)
class Search:
    """Which runs are looked for; what is None or empty is not asked."""

    serial: str = ""
    procedure: str = ""
    since: datetime | None = None
    verdict: str = ""


def enter(place: Place, folders: Iterable[Path]) -> list[str]:
    """Enter run folders into the index; one that is in it already is entered anew.

    Returns:
        Why runs were left out: their folders cannot be read, or the database refuses what they say.

    Raises:
        ArchiveError: the index cannot be written.
    """
    left_out: list[str] = []
    entries = list(_readable(folders, left_out))
    if entries:
        with _writing(place) as session:
            _add(session, place, entries, left_out)
    return left_out


@contextmanager
def _writing(place: Place) -> Iterator[Session]:
    """A transaction that writes, from its first statement on: one that began by reading could not wait for another."""
    with opened(place) as engine, Session(engine) as session, session.begin():
        session.execute(delete(RunRow).where(false()))
        yield session


def _at_their_places(session: Session, entries: Sequence[Entry]) -> list[int]:
    """What stands in the index for the folders of entries; a shared folder under another computer's name too."""
    by_folder = {str(entry.folder): entry for entry in entries}
    asked = select(RunRow.id, RunRow.host, RunRow.folder, RunRow.started_utc).where(RunRow.folder.in_(by_folder))
    every, here = _is_of_one_bench(session), this_host()
    return [
        key for key, host, folder, started in session.execute(asked)
        if every or host in (None, here) or started == by_folder[folder].started_utc
    ]  # fmt: skip


def _is_of_one_bench(session: Session) -> bool:
    """Whether all runs are this bench's, whatever its computer was called when it entered them."""
    return session.get_bind().dialect.name == "sqlite"


def _add(session: Session, place: Place, entries: Sequence[Entry], left_out: list[str]) -> int:
    """Add entries, together or else one by one; one that the database refuses keeps no other out."""
    try:
        with session.begin_nested():
            _forget(session, _at_their_places(session, entries))
            session.add_all([_row(entry) for entry in entries])
        session.expunge_all()
        return len(entries)
    except Exception as error:
        if not is_refusal(error):
            raise
        if len(entries) > 1:
            return sum(_add(session, place, [entry], left_out) for entry in entries)
        left_out.append(f"{entries[0].folder}: {refused_by(place, error)}")
        return 0


def find_runs(place: Place, search: Search, *, values: bool = False) -> list[Entry]:
    """Runs by what was asked, the oldest first; with their measured values when these are wanted.

    Raises:
        ArchiveError: the index cannot be read.
    """
    with opened(place, make=False) as engine, Session(engine) as session:
        wanted = _asked(search)
        of_runs = _values_of(session, wanted) if values else {}
        asked = wanted.with_only_columns(RunRow.id, RunRow.folder, *(getattr(RunRow, name) for name in _OF_RUN))
        found = session.execute(asked.order_by(RunRow.started_utc, RunRow.id))
        return [
            Entry(folder=Path(folder), values=tuple(of_runs.get(key, ())), **dict(zip(_OF_RUN, columns, strict=True)))
            for key, folder, *columns in found
        ]


def _values_of(session: Session, wanted: Select[Any]) -> dict[int, list[Measured]]:
    """Measured values of the runs that are wanted, by the run's number."""
    runs = wanted.with_only_columns(RunRow.id).scalar_subquery()
    columns = [getattr(ValueRow, name) for name in _OF_VALUE]
    asked = select(ValueRow.run_id, *columns).where(ValueRow.run_id.in_(runs)).order_by(ValueRow.id)
    found: dict[int, list[Measured]] = {}
    for run, *fields in session.execute(asked):
        found.setdefault(run, []).append(Measured(**dict(zip(_OF_VALUE, fields, strict=True))))
    return found


def rebuild(place: Place, folders: Sequence[Path]) -> tuple[int, list[str]]:
    """Make the index anew from run folders: (runs entered, why others were left out).

    What stands in it for folders outside those that are searched, or on other computers, stays.

    Args:
        place: the archive.
        folders: where runs lie, at any depth. Those in which runs of this computer lay are searched too.

    Raises:
        ArchiveError: the index cannot be written.
        FileError: a folder cannot be read.
    """
    if not any(folder.is_dir() for folder in folders) and place.is_away:
        raise ArchiveError(f"archive {place}: there is no such folder")
    left_out: list[str] = []
    _clear_unreadable(place)
    with _writing(place) as session:
        known = _of_this_computer(session)
        roots = {folder.resolve() for folder in folders}
        roots |= {path.parent for path in known.values() if path.parent.is_dir()}
        _forget(session, [key for key, path in known.items() if roots & {path, *path.parents}])
        entered: set[tuple[object, ...]] = set()
        count = 0
        for batch in _batches(_readable(_below(sorted(roots)), left_out)):
            count += _add(session, place, batch, left_out)
            entered |= {entry.identity for entry in batch}
        _forget(session, _moved(session, entered))
    return count, left_out


def _of_this_computer(session: Session) -> dict[int, Path]:
    """Folders of runs that this computer entered, by the number of the run; of who did not say, those that are here."""
    found = session.execute(select(RunRow.id, RunRow.host, RunRow.folder)).all()
    every, here = _is_of_one_bench(session), this_host()
    return {
        key: Path(folder) for key, host, folder in found
        if every or host == here or (host is None and Path(folder).is_dir())
    }  # fmt: skip


def _moved(session: Session, entered: set[tuple[object, ...]]) -> list[int]:
    """Numbers of runs of this computer that were entered from another folder now, and are not in theirs any more."""
    left = [key for key, path in _of_this_computer(session).items() if not path.is_dir()]
    rows = (session.get_one(RunRow, key) for key in left)
    return [row.id for row in rows if (row.name, row.started_utc, row.serial, row.procedure, row.bench) in entered]


def _forget(session: Session, keys: Sequence[int]) -> None:
    for start in range(0, len(keys), _BATCH):
        session.execute(delete(RunRow).where(RunRow.id.in_(keys[start : start + _BATCH])))
    session.expunge_all()


def _clear_unreadable(place: Place) -> None:
    """Remove a damaged index from the archive's own folder: everything in it stands in the folders."""
    if place.folder is None:
        return
    try:
        with opened(place):
            pass
    except DamagedIndexError:
        for path in place.folder.glob(f"{INDEX_FILE}*"):
            path.unlink(missing_ok=True)


def _below(roots: Iterable[Path]) -> Iterator[Path]:
    """Run folders, each once."""
    return iter(dict.fromkeys(folder for root in roots for folder in run_folders(root)))


def _readable(folders: Iterable[Path], left_out: list[str]) -> Iterator[Entry]:
    for folder in folders:
        try:
            yield entry_of(folder)
        except FileError as error:  # a header that a power cut tore keeps no other run out
            left_out.append(str(error))


def _batches(entries: Iterator[Entry]) -> Iterator[list[Entry]]:
    batch: list[Entry] = []
    for entry in entries:
        batch.append(entry)
        if len(batch) == _BATCH:
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
    columns = {name: getattr(entry, name) for name in _OF_RUN}
    values = [ValueRow(**{name: getattr(value, name) for name in _OF_VALUE}) for value in entry.values]
    stated = [CalibrationRow(**{name: getattr(one, name) for name in OF_CALIBRATION}) for one in entry.calibrations]
    return RunRow(folder=str(entry.folder), name=entry.folder.name, values=values, calibrations=stated, **columns)


_OF_RUN = (
    "host", "serial", "operator", "procedure", "bench", "started_utc", "outcome", "verdict", "instruments", "simulated",
)  # fmt: skip
_OF_VALUE = ("name", "value", "std", "calibration_std", "unit", "low", "high", "relation", "verdict")
