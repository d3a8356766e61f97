"""Getting written bytes onto the disk itself, so that they outlive a power cut."""

from __future__ import annotations

import errno
import os
import shutil
import sys
from collections.abc import Sequence
from io import FileIO
from pathlib import Path

from hil.clock import Flag
from hil.system import system

SYNC_INTERVAL_S = 1.0


def write_at(file: FileIO, position: int, data: bytes | memoryview) -> None:
    """Write all of `data` at a place of the file; the operating system has it when this returns."""
    file.seek(position)
    rest = memoryview(data)
    while rest:
        rest = rest[system.write(file, rest) :]


def sync_file(descriptor: int) -> None:
    """Return when a file's bytes are on the disk."""
    system.sync(descriptor)


def write_whole(path: Path, content: bytes | str, mode: int = 0o666) -> None:
    """Put a file in its place, on the disk itself, whole or not at all; raises `OSError`.

    A link, a pipe or a socket of that name is replaced, never written through: in a folder that somebody else made it
    would lead anywhere.
    """
    part = path.with_name(f"{path.name}.{system.pid()}-{system.thread_id()}.part")  # two threads write one name
    part.unlink(missing_ok=True)
    try:
        descriptor = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), mode)  # noqa: TID251
        with FileIO(descriptor, "wb") as file:
            write_at(file, 0, content.encode() if isinstance(content, str) else content)
            sync_file(descriptor)
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def write_named(path: Path, content: bytes | str) -> None:
    """Put a file where its user named it, whole or not at all: the one before stays when the disk is full.

    A link is followed, and a pipe or a device (`/dev/stdout`) written to. Raises `OSError`.
    """
    if path.exists() and not path.is_file():
        with path.open("wb") as stream:
            stream.write(content.encode() if isinstance(content, str) else content)
    else:
        write_whole(path.resolve(), content)


def is_deleted(file: FileIO) -> bool:
    """Whether an open file has no name any more: it can be written on, and is lost when it is closed."""
    return os.fstat(file.fileno()).st_nlink == 0


def is_at(file: FileIO, path: Path) -> bool:
    """Whether an open file is the one with this name now."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except OSError:
        return False


def place_of(file: FileIO) -> Path | None:
    """The name that an open file has now, where the system tells (Linux)."""
    try:
        place = Path(f"/proc/self/fd/{file.fileno()}").readlink()
    except OSError:
        return None
    return place if is_at(file, place) else None


def copy_open(file: FileIO, path: Path) -> None:
    """Write an open file anew under a name; raises `OSError`."""
    file.seek(0)
    with path.open("wb") as copy:
        shutil.copyfileobj(file, copy)


def sync_folder(folder: Path) -> None:
    """Return when a folder's entries (files made, renamed) are on the disk, where a file can be opened for that."""
    if sys.platform == "win32":  # folders cannot be opened there; NTFS journals its entries
        return
    try:
        descriptor = os.open(folder, os.O_RDONLY)  # noqa: TID251
    except OSError as error:
        if error.errno in (errno.EMFILE, errno.ENFILE):  # the entries come to the disk a little later
            return
        raise
    try:
        system.sync(descriptor)
    finally:
        os.close(descriptor)


class Syncer:
    """Brings files to the disk once a second, beside the thread that writes them.

    A sync takes milliseconds, on a memory card a good part of a second: too long for the loop that feeds an
    output. An error is kept and raised by the next `check` or `stop`.
    """

    def __init__(self, descriptors: Sequence[int], interval_s: float = SYNC_INTERVAL_S) -> None:
        self._descriptors = tuple(descriptors)
        self._interval_s = interval_s
        self._written, self._stop = Flag(), Flag()  # set where signals raise
        self._error: OSError | None = None
        self._thread = system.thread(self._run, name="hil-sync")
        self._thread.start()

    def written(self) -> None:
        """Say that there is something new to bring to the disk."""
        self._written.set()

    def check(self) -> None:
        """Raise the `OSError` that a sync met, if one did."""
        if self._error is not None:
            raise self._error

    def stop(self) -> None:
        """Sync a last time and end; raises like `check`."""
        self._stop.set()
        self._thread.join()
        self._sync()
        self.check()

    def _run(self) -> None:
        while not self._stop.wait(self._interval_s):
            if self._written.is_set():
                self._written.clear()
                self._sync()

    def _sync(self) -> None:
        try:
            for descriptor in self._descriptors:
                sync_file(descriptor)
        except OSError as error:
            self._error = self._error or error
