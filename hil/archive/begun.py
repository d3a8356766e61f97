"""Runs that have begun and were not entered yet: one that is killed enters nothing, and is found by its mark."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from hil.archive.place import Place
from hil.errors import FileError, StorageError
from hil.record.run_folder.header import END_FILE, HEADER_FILE
from hil.record.run_folder.process_liveness import is_alive
from hil.record.state import OWNER_ALONE, keep, state_path
from hil.untrusted import read_json

_KIND = "begun"


@dataclass(frozen=True, slots=True)
class Begun:
    """A run that has begun.

    Attributes:
        folder: of the run.
        mark: the file that says so.
        is_over: whether it was closed, or its process is gone.
    """

    folder: Path
    mark: Path
    is_over: bool

    @property
    def is_there(self) -> bool:
        """Whether it has recorded anything, and was not removed."""
        return (self.folder / HEADER_FILE).is_file()


def mark_begun(place: Place, folder: Path) -> None:
    """Keep, outside the archive, that a run begins there; a mark that cannot be written hinders no run."""
    with suppress(StorageError):
        content = {"archive": str(place), "run": str(folder.resolve()), "pid": os.getpid()}
        keep(_mark(folder), json.dumps(content), mode=OWNER_ALONE)


def forget_begun(folder: Path) -> None:
    """The run was entered, or never was one."""
    with suppress(OSError):
        _mark(folder).unlink(missing_ok=True)


def begun_in(place: Place) -> Iterator[Begun]:
    """Runs of an archive that began on this computer and were not entered since."""
    with suppress(OSError):
        for path in sorted(_mark(Path()).parent.glob("*.json")):
            with suppress(OSError, FileError, ValueError, KeyError, TypeError):
                content = read_json(path)
                folder = Path(content["run"])
                if content["archive"] in (str(place), place.url):  # earlier versions wrote the address as it was
                    yield Begun(folder, path, (folder / END_FILE).exists() or not is_alive(int(content["pid"])))


def _mark(folder: Path) -> Path:
    return state_path(_KIND, hashlib.sha256(str(folder.resolve()).encode()).hexdigest()[:32], ".json")
