"""A new run folder."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from hil.errors import FileError, StorageError
from hil.record.durable import sync_file, sync_folder
from hil.record.events import EVENTS_FILE
from hil.record.header import Header, write_header
from hil.record.samples import JOURNAL_FILE, ROWS_FILE


def make_folder(path: Path, header: Header) -> None:
    """Make a run folder with all its files; it appears whole or not at all.

    Raises:
        FileError: there is something of that name already.
        StorageError: it cannot be made.
    """
    if path.exists():
        raise FileError(f"{path}: exists already; a run is never written over another, choose another folder")
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        part.mkdir(parents=True)
        write_header(part, header)
        for name in (ROWS_FILE, JOURNAL_FILE, EVENTS_FILE):
            (part / name).touch()
        for file in part.iterdir():
            with file.open("r+b") as opened:
                sync_file(opened.fileno())
        sync_folder(part)
        part.rename(path)
        sync_folder(path.parent)
    except OSError as error:
        shutil.rmtree(part, ignore_errors=True)
        raise StorageError(f"{path}: the run folder cannot be made: {error.strerror}") from error
