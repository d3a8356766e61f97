"""Open and write recordings whatever they are stored as: the name picks the format, none means a run folder."""

from __future__ import annotations

import importlib
import os
import pkgutil
import re
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import BinaryIO

from hil.catalog import tables
from hil.errors import FileError, reason, storing
from hil.record import exchange
from hil.record.extra import check_installed
from hil.record.foreign import check_read
from hil.record.gathered import open_recording
from hil.record.reading import AS_IT_IS, Reading
from hil.record.recording import Recording
from hil.record.resampled import resampled
from hil.record.table.about import described
from hil.record.table.assemble import assemble
from hil.record.table.named import as_stated, with_stated_units
from hil.record.table.response_table import ResponseTable

_LONGEST_BEGINNING, _LONGEST_TEXT = 32, 4096
_NO_TEXT = re.compile(rb"[\x00-\x08\x0e-\x1a\x1c-\x1f]")
ANY_TEXT = ".txt"
"""The ending whose reader takes texts under endings that nobody knows."""
_DAMAGED = (ArithmeticError, EOFError, LookupError, MemoryError, RecursionError, TypeError, ValueError, zlib.error)


@cache
def formats() -> dict[str, ModuleType]:
    """File name endings and the module that reads them; formats import their library when used."""
    modules = [
        importlib.import_module(f"{exchange.__name__}.{found.name}")
        for found in pkgutil.iter_modules(exchange.__path__)
    ]
    return {suffix: module for module in modules for suffix in module.SUFFIXES}


def _by_content(file: BinaryIO) -> ModuleType | None:
    """The module of a file that says by its first bytes what it is, whatever its name says."""
    start = os.pread(file.fileno(), _LONGEST_BEGINNING, 0)
    for module in formats().values():
        if hasattr(module, "BEGINNING") and re.match(module.BEGINNING, start, re.DOTALL):
            return module
    return None


def _by_ending(path: Path) -> ModuleType | None:
    """The module of a file whose name says what it is; of two endings the longer one counts."""
    endings = [ending for ending in formats() if path.name.lower().endswith(ending)]
    return formats()[max(endings, key=len)] if endings else None


def format_of(path: Path) -> ModuleType:
    """The exchange module for a file name.

    Raises:
        FileError: the ending is none that is known.
    """
    found = _by_ending(path)
    if found is None:
        raise FileError(f"{path}: {_unknown_kind()}")
    return found


def _unknown_kind() -> str:
    return f"unknown kind of recording; known endings: {', '.join(sorted(formats()))}"


def _is_text(file: BinaryIO) -> bool:
    start = os.pread(file.fileno(), _LONGEST_TEXT, 0)
    return bool(start) and not _NO_TEXT.search(start)


def read_recording(path: str | Path, reading: Reading | None = None) -> Recording:
    """Read a recording from a file or a run folder; NaN is where a sample of a run is no measurement.

    Args:
        path: of it.
        reading: what its user says about its time, names and units.

    Raises:
        FileError: it does not exist or is not what its name says; names file, line or channel, and what helps.
    """
    found = read_any(path, reading)
    if isinstance(found, ResponseTable):
        raise FileError(
            f"{path}: a table of a frequency response, not samples in time; `hil identify`, `hil compare` and "
            "`hil convert` take such tables, with the plant 'transfer-function'"
        )
    return found


def read_any(path: str | Path, reading: Reading | None = None) -> Recording | ResponseTable:
    """Read a recording, or the table of a frequency response; an installed table by its bare name.

    Raises:
        FileError: as `read_recording`.
    """
    reading = reading or AS_IT_IS
    return as_stated(recorded(path), reading) if Path(path).is_dir() else read_file(path, reading)


@contextmanager
def _undamaged(path: str | Path) -> Iterator[None]:
    """Whatever a reader stumbles over in a file that was cut off or made by hand is a `FileError`."""
    try:
        yield
    except _DAMAGED as error:
        raise FileError(f"{path}: cannot be read, it is damaged or no recording: {reason(error)}") from error


def recorded(folder: str | Path) -> Recording:
    """A run as it was recorded, with all that `hil.record.folder.read` says of it. Raises `FileError` likewise."""
    from hil.record.folder import read

    with _undamaged(folder):
        return read(Path(folder))


def read_file(path: str | Path, reading: Reading) -> Recording | ResponseTable:
    """The recording or the table in a file; an installed table by its bare name. Raises `FileError`."""
    with _undamaged(path):
        path = Path(path)
        if not path.exists() and len(path.parts) == 1:
            path = tables().get(path.name, path)
        if not path.exists():
            raise FileError(f"{path}: no such file or folder")
        by_ending = _by_ending(path)
        with open_recording(path) as file:
            form = _by_content(file)
            if form is None:
                check_read(path, file, by_ending=by_ending is None)
                is_text = _is_text(file) and (by_ending is None or hasattr(by_ending, "OR_TEXT"))
                form = formats()[ANY_TEXT] if is_text else by_ending
            if form is None:
                raise FileError(f"{path}: {_unknown_kind()}")
            if not os.fstat(file.fileno()).st_size:
                raise FileError(f"{path}: the file is empty")
            if not hasattr(form, "contents"):
                found = form.read(path, reading)
            else:
                from hil.record.confined import confined_contents

                for name in form.LIBRARIES:
                    check_installed(name, path)
                with form.files_of(path, file) if hasattr(form, "files_of") else nullcontext(file) as gathered:
                    inside = confined_contents(form, path, gathered)
                if hasattr(form, "assembled"):
                    found = form.assembled(path, inside, reading)
                else:
                    found = assemble(str(path), *described(*inside), reading)
        return with_stated_units(found, reading) if isinstance(found, Recording) else found


def write_recording(recording: Recording, path: str | Path) -> None:
    """Write a recording in the format that the file's name says; a name without an ending is a run folder.

    The file appears when it is complete; one of that name is replaced only then. A run folder is never replaced.

    Raises:
        FileError: unknown ending, or the run folder exists.
        StorageError: it could not be written.
    """
    path = Path(path)
    if not path.suffix:
        from hil.record.folder import write

        write(recording, path)
        return
    form = format_of(path)
    if not hasattr(form, "write"):
        raise FileError(f"{path}: recordings of this kind are read but not written; write .csv, .tdms or .mf4 instead")
    part = path.with_name(f".part-{path.name}")
    try:
        with storing(path):
            form.write(resampled(recording), part)  # one row for each sample
            part.replace(path)
    finally:
        part.unlink(missing_ok=True)
