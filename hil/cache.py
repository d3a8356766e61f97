"""What takes seconds to make, kept on disk between programs under a hash of what it was made from.

The folder is HIL_CACHE_DIR, else the user's cache folder. Everything in it can be deleted at any time; what no program
has asked for in a quarter of a year, such as what an earlier version had made, goes when something new comes.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import stat
import tempfile
import time
import zipfile
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from importlib.metadata import version
from io import BytesIO
from pathlib import Path

import numpy as np
import platformdirs
from filelock import FileLock

from hil.arrays import Array
from hil.errors import FileError

Arrays = Mapping[str, Array]

_KEPT_S = 90 * 86400.0
_WRITTEN_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH


def cache_folder(kind: str) -> Path:
    """The folder for one kind of results, made if need be. Nobody else can write there: code is taken from it.

    Raises:
        OSError: it cannot be made.
        FileError: it belongs to somebody else, or others can put another in its place.
    """
    root = Path(os.environ.get("HIL_CACHE_DIR") or platformdirs.user_cache_dir("valve-hil"))
    folder = root / kind
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if not (found := root.stat()).st_mode & stat.S_ISVTX:  # in /tmp nobody moves what is another's
        _make_own(root, found, ~_WRITTEN_BY_OTHERS)
    found = folder.lstat()
    _make_own(folder, found, stat.S_IRWXU)
    # What was written while others of the group could reach it may be theirs; in a folder of one's own its mode is not.
    _forget_foreign(folder, stat.S_IWOTH | (stat.S_IWGRP if found.st_mode & stat.S_IRWXG else 0))
    return folder


def _make_own(folder: Path, found: os.stat_result, mode: int) -> None:
    """Take rights from others in a folder of one's own.

    Raises:
        FileError: it is another's.
    """
    is_own, is_open = found.st_uid == os.geteuid(), stat.S_IMODE(found.st_mode) & ~mode
    if not stat.S_ISDIR(found.st_mode) or not (is_own or (found.st_uid == 0 and not is_open & _WRITTEN_BY_OTHERS)):
        raise FileError(
            f"{folder}: belongs to user {found.st_uid} or can be written by others; compiled code is taken only from "
            "a folder of one's own: name one in HIL_CACHE_DIR"
        )
    if is_own and is_open:
        folder.chmod(stat.S_IMODE(found.st_mode) & mode)


def _forget_foreign(folder: Path, foreign_mode: int) -> None:
    """Take away what others wrote, or could write: it is made anew."""
    for path in (*folder.iterdir(), *folder.glob("__pycache__/*")):
        with suppress(FileNotFoundError):  # another program takes it away too
            found = path.lstat()
            if found.st_uid not in (os.geteuid(), 0) or found.st_mode & foreign_mode:
                shutil.rmtree(path) if stat.S_ISDIR(found.st_mode) else path.unlink()


@contextmanager
def one_at_a_time(path: Path) -> Iterator[None]:
    """Programs that need the same file at once, such as workers of a fleet on a new machine, wait for the first."""
    lock = path.with_suffix(".lock")
    with FileLock(lock) if os.access(path.parent, os.W_OK) else nullcontext():
        with suppress(OSError):
            os.utime(lock)
        yield


def forget_unused(folder: Path) -> None:
    """Take away what nobody has asked for in a long time: who asks stamps the lock of it."""
    for lock in folder.glob("*.lock"):
        with suppress(OSError):  # another program takes it away too
            if time.time() - lock.stat().st_mtime > _KEPT_S:
                for path in (*folder.glob(f"{lock.stem}.*"), *folder.glob(f"__pycache__/{lock.stem}.*")):
                    path.unlink()


def stamp(files: Collection[Path], tools: Collection[str]) -> str:
    """A hash of sources and of the versions of packages and Python: 16 hexadecimal digits."""
    digest = hashlib.sha256(" ".join([platform.python_version(), *map(version, tools)]).encode())
    for file in sorted(files):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def cached_arrays(kind: str, name: str, make: Callable[[], Arrays]) -> Arrays:
    """Named arrays, made at their first use on this machine; made each time where nothing can be kept.

    `name` has to differ with all that the arrays depend on, see `stamp`.
    """
    try:
        path = cache_folder(kind) / f"{name}.npz"
    except OSError:
        return make()
    with one_at_a_time(path):
        known = _read(path)
        if known is None:
            known = make()
            forget_unused(path.parent)
            _write(path, known)
    return known


def write_whole(path: Path, content: bytes) -> None:
    """A file that others never see half written."""
    with tempfile.NamedTemporaryFile("wb", dir=path.parent, suffix=".tmp", delete=False) as file:
        file.write(content)
    Path(file.name).replace(path)


def _read(path: Path) -> Arrays | None:
    """The arrays; None where there are none or the file is damaged."""
    try:  # numpy does not close what it opened and cannot read
        with path.open("rb") as file, np.load(file, allow_pickle=False) as found:
            return dict(found)
    except (OSError, ValueError, EOFError, zipfile.BadZipFile):
        return None


def _write(path: Path, arrays: Arrays) -> None:
    content = BytesIO()
    np.savez(content, **arrays)  # type: ignore[arg-type]  # numpy's stub takes names for options
    try:
        write_whole(path, content.getvalue())
    except OSError:  # a full disk: it is made anew next time
        return
