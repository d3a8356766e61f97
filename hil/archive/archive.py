"""Enter runs into the index, find them again, and make the index anew from the folders."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from itertools import islice
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Select, Table, delete, insert, select

from hil.archive.database import WRITES, DamagedIndexError, is_refusal, opened, refused_by
from hil.archive.entry import Entry, entry_of, run_folders, this_host
from hil.archive.place import INDEX_FILE, Place
from hil.archive.tables import CALIBRATION, OF_CALIBRATION, OF_RUN, OF_VALUE, RUN, VALUE
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
        with _writing(place) as index:
            _add(index, place, entries, left_out)
    return left_out


@contextmanager
def _writing(place: Place) -> Iterator[Connection]:
    """A transaction that writes, from its beginning on."""
    with opened(place) as engine, engine.execution_options(**{WRITES: True}).begin() as index:
        yield index


def _at_their_places(index: Connection, entries: Sequence[Entry]) -> list[int]:
    """What stands in the index for the folders of entries; a shared folder under another computer's name too."""
    by_folder = {str(entry.folder): entry for entry in entries}
    asked = select(*RUN.c["id", "host", "folder", "started_utc"]).where(RUN.c.folder.in_(by_folder))
    every, here = _is_of_one_bench(index), this_host()
    return [
        key for key, host, folder, started in index.execute(asked)
        if every or host in (None, here) or started == by_folder[folder].started_utc
    ]  # fmt: skip


def _is_of_one_bench(index: Connection) -> bool:
    """Whether all runs are this bench's, whatever its computer was called when it entered them."""
    return index.dialect.name == "sqlite"


def _add(index: Connection, place: Place, entries: Sequence[Entry], left_out: list[str]) -> int:
    """Add entries, together or else one by one; one that the database refuses keeps no other out."""
    try:
        with index.begin_nested():
            _forget(index, _at_their_places(index, entries))
            _insert(index, entries)
        return len(entries)
    except Exception as error:
        if not is_refusal(error):
            raise
        if len(entries) > 1:
            return sum(_add(index, place, [entry], left_out) for entry in entries)
        left_out.append(f"{entries[0].folder}: {refused_by(place, error)}")
        return 0


def find_runs(place: Place, search: Search, *, values: bool = False) -> list[Entry]:
    """Runs by what was asked, the oldest first; with their measured values when these are wanted.

    Raises:
        ArchiveError: the index cannot be read.
    """
    with opened(place, make=False) as engine, engine.connect() as index:
        wanted = _asked(search)
        of_runs = _values_of(index, wanted) if values else {}
        asked = wanted.with_only_columns(*RUN.c["id", "folder", *OF_RUN])
        found = index.execute(asked.order_by(RUN.c.started_utc, RUN.c.id))
        return [
            Entry(folder=Path(folder), values=tuple(of_runs.get(key, ())), **dict(zip(OF_RUN, columns, strict=True)))
            for key, folder, *columns in found
        ]


def _values_of(index: Connection, wanted: Select[Any]) -> dict[int, list[Measured]]:
    """Measured values of the runs that are wanted, by the run's number."""
    runs = wanted.with_only_columns(RUN.c.id).scalar_subquery()
    asked = select(*VALUE.c["run_id", *OF_VALUE]).where(VALUE.c.run_id.in_(runs)).order_by(VALUE.c.id)
    found: dict[int, list[Measured]] = {}
    for run, *fields in index.execute(asked):
        found.setdefault(run, []).append(Measured(**dict(zip(OF_VALUE, fields, strict=True))).renamed)
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
    with _writing(place) as index:
        known = _of_this_computer(index)
        roots = {folder.resolve() for folder in folders}
        roots |= {path.parent for path in known.values() if path.parent.is_dir()}
        _forget(index, [key for key, path in known.items() if roots & {path, *path.parents}])
        entered: set[tuple[object, ...]] = set()
        count = 0
        entries = _readable(_below(sorted(roots)), left_out)
        for batch in iter(lambda: list(islice(entries, _BATCH)), []):
            count += _add(index, place, batch, left_out)
            entered |= {entry.identity for entry in batch}
        _forget(index, _moved(index, entered))
    return count, left_out


def _of_this_computer(index: Connection) -> dict[int, Path]:
    """Folders of runs that this computer entered, by the number of the run; of who did not say, those that are here."""
    found = index.execute(select(*RUN.c["id", "host", "folder"])).all()
    every, here = _is_of_one_bench(index), this_host()
    return {
        key: Path(folder) for key, host, folder in found
        if every or host == here or (host is None and Path(folder).is_dir())
    }  # fmt: skip


def _moved(index: Connection, entered: set[tuple[object, ...]]) -> list[int]:
    """Numbers of runs of this computer that were entered from another folder now, and are not in theirs any more."""
    left = {key for key, path in _of_this_computer(index).items() if not path.is_dir()}
    rows = index.execute(select(*RUN.c["id", "name", "started_utc", "serial", "procedure", "bench"]))
    return [key for key, *identity in rows if key in left and tuple(identity) in entered]


def _forget(index: Connection, keys: Sequence[int]) -> None:
    for start in range(0, len(keys), _BATCH):
        index.execute(delete(RUN).where(RUN.c.id.in_(keys[start : start + _BATCH])))


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


def _asked(search: Search) -> Select[Any]:
    asked = select(RUN)
    for name in ("serial", "procedure", "verdict"):
        if wanted := getattr(search, name):
            asked = asked.where(RUN.c[name] == wanted)
    return asked if search.since is None else asked.where(RUN.c.started_utc >= search.since)


def _insert(index: Connection, entries: Sequence[Entry]) -> None:
    """Entries with the rows that belong to each."""
    runs = [{"folder": str(entry.folder), "name": entry.folder.name, **_fields(entry, OF_RUN)} for entry in entries]
    made = index.scalars(insert(RUN).returning(RUN.c.id, sort_by_parameter_order=True), runs)
    keyed = list(zip(made, entries, strict=True))
    _insert_rows(index, VALUE, [{"run_id": key, **_fields(v, OF_VALUE)} for key, e in keyed for v in e.values])
    stated = [{"run_id": key, **_fields(one, OF_CALIBRATION)} for key, entry in keyed for one in entry.calibrations]
    _insert_rows(index, CALIBRATION, stated)


def _insert_rows(index: Connection, table: Table, rows: Sequence[dict[str, Any]]) -> None:
    if rows:
        index.execute(insert(table), rows)


def _fields(of: object, names: Iterable[str]) -> dict[str, Any]:
    return {name: getattr(of, name) for name in names}
