"""Runs that could not be entered when they ended; they are entered the next time somebody can.

An archive's own folder among them stands for all runs in it: its index was made by a run that ended, which does not
wait until the others are read.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TypeVar

from hil.archive.archive import enter, rebuild
from hil.archive.begun import begun_in
from hil.archive.place import Place, archive_place
from hil.errors import ArchiveError, FileError, StorageError, reason
from hil.record.run_folder.header import HEADER_FILE
from hil.record.state import keep, state_path
from hil.untrusted import read_json

Found = TypeVar("Found")


def enter_or_keep(place: Place, folder: Path) -> str:
    """Enter a run, and those that wait; what kept a run from that, in one sentence, or nothing.

    Never raises: a run is not lost or late because of its index. One that is refused does not wait: it would be again.
    """
    waiting = [*waiting_for(place), *([place.folder] if place.is_unmade and place.folder else []), folder.resolve()]
    try:
        left_out = enter(place, [path for path in waiting if (path / HEADER_FILE).is_file()])
    except Exception as error:
        keep_waiting(place, waiting)
        return f"{reason(error)}; the run is safe in {folder} and will be entered later"
    keep_waiting(place, [path for path in waiting if path == place.folder])
    return "; ".join(f"not in the archive: {text}" for text in left_out)


def searched(archive: str, search: Callable[[Place], Found], notes: Callable[[str], object]) -> Found:
    """What a search finds once the runs that waited are entered; `notes` gets why some could not be.

    Raises:
        ArchiveError: the archive cannot be searched; that says as well why nothing could be entered.
    """
    place = archive_place(archive)
    try:
        left_out = catch_up(place)
    except ArchiveError as error:
        left_out = [str(error)]
    found = search(place)
    for text in left_out:
        notes(text)
    return found


def catch_up(place: Place) -> list[str]:
    """Enter the runs that wait, and those that have begun; an index that is missing is made anew from the folders.

    Returns:
        Why runs among them were left out: their folders cannot be read, or the database refuses them.

    Raises:
        ArchiveError: the index cannot be written.
    """
    known = waiting_for(place)
    if place.folder is not None and (place.is_unmade or place.folder in known):
        rebuild(place, [place.folder])
    begun = list(begun_in(place))
    waiting = [path for path in known if (path / HEADER_FILE).is_file()]
    waiting += [one.folder for one in begun if one.is_there and one.folder not in waiting]
    left_out = enter(place, waiting)
    keep_waiting(place, [])
    for one in begun:
        if one.is_over:
            one.mark.unlink(missing_ok=True)
    return left_out


def waiting_for(place: Place) -> list[Path]:
    """Folders of the runs that wait to be entered."""
    found: list[Path] = []
    for path in _paths(place):
        with suppress(OSError, FileError, TypeError):
            found += map(Path, read_json(path))
    return list(dict.fromkeys(found))


def keep_waiting(place: Place, folders: Sequence[Path]) -> None:
    """Have these, and no others, wait to be entered."""
    path, before = _paths(place)
    with suppress(OSError, StorageError):
        if folders:
            keep(path, json.dumps(list(dict.fromkeys(map(str, folders)))))
        else:
            path.unlink(missing_ok=True)
        before.unlink(missing_ok=True)


def _paths(place: Place) -> tuple[Path, Path]:
    """Where the runs that wait for an archive are listed, and where versions before listed them.

    Its own name says less than its hash: `runs/a` and `runs-a` were one there, and a long one could not be kept.
    """
    name = str(place)
    digest = hashlib.sha256(name.encode()).hexdigest()[:32]
    return state_path("archive", digest, ".json"), state_path("archive", name, ".json")
