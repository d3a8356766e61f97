"""Files that somebody else may have written: opened only below a root, parsed only within limits.

A run folder, an upload and an attachment can hold links, pipes, endless files and text that is nested a hundred
thousand deep. Whatever reads one of these goes through this module (docs/reference/recordings.md).
"""

from __future__ import annotations

import errno
import json
import os
import re
import stat
import sys
import tomllib
from collections.abc import Iterable
from functools import cache
from io import BufferedReader
from pathlib import Path, PurePosixPath
from typing import Any

from hil.errors import FileError

MOST_BYTES = 1 << 25
"""The largest file of words and figures that is read whole (JSON, TOML, events): 32 MiB."""

ANY_SIZE = 1 << 62
"""Of samples, which are read in pieces."""

UNASKED_BYTES = 1 << 28
"""What anybody's file may hold or unpack to, whatever its own size: 268 MB."""

MOST_TOML_BYTES = 1 << 20
MOST_LEVELS = 64

_PATH_FLAGS = os.O_PATH | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC
_FILE_FLAGS = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOCTTY
_LEAST_BYTES, _LARGEST_BYTES = 1 << 30, 1 << 34
_MOST_SHRUNK, _SPARSEST = 100, 64  # times what is stored: of what may unpack; of what a file says that it holds
_KINDS = (
    (stat.S_ISLNK, "a link, and links are not followed"), (stat.S_ISDIR, "a folder"), (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"), (stat.S_ISCHR, "a device"), (stat.S_ISBLK, "a device"),
)  # fmt: skip
# Atomic groups: a line of 100 kB is read once, whatever stands in it.
_KEY = r"""(?>[A-Za-z0-9_-]++|"[^"\n]*+"|'[^'\n]*+')"""
_SURROGATE = re.compile(r"\\u[dD][89a-fA-F]")
_MAYBE_HUGE = re.compile(r"[0-9]{308}|[eE]\+?[0-9]{3}")
_DOTTED = re.compile(rf"(?<![A-Za-z0-9_-]){_KEY}(?:[ \t]*+\.[ \t]*+{_KEY}){{{MOST_LEVELS}}}")


@cache
def most_bytes() -> int:
    """The largest recording that is read: a quarter of this computer's memory, within 1 and 16 GiB."""
    quarter = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 4
    return max(_LEAST_BYTES, min(quarter, _LARGEST_BYTES))


def most_unpacked(stored_bytes: int) -> int:
    """What a recording of so many bytes may unpack to: measured values shrink to a tenth, not to a thousandth."""
    return min(max(UNASKED_BYTES, _MOST_SHRUNK * stored_bytes), most_bytes())


def unpacked_allowed(stored_bytes: int) -> str:
    """For messages: what `most_unpacked` allows."""
    return f"{_size(stored_bytes)} may unpack to {_size(most_unpacked(stored_bytes))} on this computer"


def resolved(path: Path) -> Path:
    """Where a path leads. Raises `FileError` when its links go round in a circle, or the working folder is gone."""
    try:
        path.stat()
    except OSError as error:  # Python 3.13 resolves a circle to itself
        if error.errno == errno.ELOOP:
            raise FileError(f"{path}: its links go round in a circle; name a file or folder that is there") from None
    try:
        return path.resolve()
    except FileNotFoundError:
        raise FileError(f"{path}: the working folder is gone; go to one that is there") from None


def open_untrusted(root: str | Path, name: str | Path, most_bytes: int = MOST_BYTES) -> BufferedReader:
    """A regular file below a folder, open for reading; the caller closes it.

    No link is followed below `root`, and nothing but a regular file is opened, so that no pipe, socket or device
    can hold the reader up. `root` itself is trusted: who names it says where to look.

    Args:
        root: a folder.
        name: of the file, relative to it; may lead through folders.
        most_bytes: the largest size that is opened.

    Raises:
        FileNotFoundError: there is no such file.
        OSError: the system does not let it be read.
        FileError: it is no regular file, leads out of `root`, or is larger than allowed.
    """
    where = Path(root, name)
    handle = _opened(Path(root), name, where)
    try:
        _check(os.fstat(handle), where, most_bytes)
        return open(handle, "rb")  # noqa: PTH123  # a handle, not a path
    except BaseException:
        os.close(handle)
        raise


def read_untrusted(root: str | Path, name: str | Path, most_bytes: int = MOST_BYTES) -> bytes:
    """All of a regular file below a folder; raises as `open_untrusted`."""
    with open_untrusted(root, name, most_bytes) as file:
        return _all_of(file)


def read_untrusted_json(root: str | Path, name: str | Path, most_bytes: int = MOST_BYTES) -> Any:
    """What a JSON file below a folder says; raises as `open_untrusted` and `parse_json`."""
    return parse_json(read_untrusted(root, name, most_bytes), str(Path(root, name)))


def is_regular(root: str | Path, name: str | Path) -> bool:
    """Whether there is a regular file below a folder, without a link on the way."""
    try:
        handle = _opened(Path(root), name, Path(root, name))
    except (OSError, FileError):
        return False
    try:
        return stat.S_ISREG(os.fstat(handle).st_mode)
    finally:
        os.close(handle)


def open_small(path: Path, most_bytes: int = MOST_BYTES) -> BufferedReader:
    """A file that its user names, open for reading: a link leads where it leads, but the file has to be regular.

    Raises:
        OSError: it cannot be read.
        FileError: it is no regular file, or larger than allowed.
    """
    try:
        handle = os.open(path, _FILE_FLAGS & ~os.O_NOFOLLOW)  # noqa: TID251
    except OSError as error:
        if error.errno != errno.ENXIO:
            raise
        raise FileError(f"{path}: is a socket; only regular files are read here") from None
    try:
        _check(os.fstat(handle), path, most_bytes)
        return open(handle, "rb")  # noqa: PTH123  # a handle, not a path
    except BaseException:
        os.close(handle)
        raise


def read_small(path: Path, most_bytes: int = MOST_BYTES) -> bytes:
    """All of a file that its user names; raises as `open_small`."""
    with open_small(path, most_bytes) as file:
        return _all_of(file)


def _all_of(file: BufferedReader) -> bytes:
    return file.read(os.fstat(file.fileno()).st_size)  # what is written to it now is left for the next time


def read_text(path: Path) -> str:
    """The text of a file that its user names, in UTF-8 with its mark or without.

    Raises as `open_small`, and `FileError` for other bytes.
    """
    try:
        return read_small(path).decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        raise FileError(f"{path}: no text in UTF-8: {error.reason} at byte {error.start}") from None


def parse_json(text: str | bytes, where: str) -> Any:
    """The value of a JSON text.

    Args:
        text: of it.
        where: it stands, for the message.

    Raises:
        FileError: no JSON, larger than `MOST_BYTES`, nested deeper than `MOST_LEVELS`, or a number that no float holds.
    """
    if len(text) > MOST_BYTES:
        raise FileError(f"{where}: {_size(len(text))} of JSON; at most {_size(MOST_BYTES)} are read")
    try:
        text = text if isinstance(text, str) else text.decode(json.detect_encoding(text))
        content = json.loads(text, parse_constant=_refused)
        if _SURROGATE.search(text):  # half a character is none: what is made of it can be neither written nor sent
            json.dumps(content, ensure_ascii=False).encode()
    except RecursionError:
        raise FileError(_too_deep(where, "JSON")) from None
    except ValueError as error:  # a number of 5000 digits and what is no text are one too
        raise FileError(f"{where}: JSON was expected: {error}") from None
    levels = _levels(content, where, "JSON")
    if _MAYBE_HUGE.search(text) and any(
        _is_huge(value) for level in levels for item in level for value in _inside(item)
    ):
        raise FileError(f"{where}: JSON was expected: a number beyond ±{sys.float_info.max:.2g}")
    return content


def read_json(path: Path) -> Any:
    """What a JSON file says that its user names; raises as `read_small` and `parse_json`."""
    return parse_json(read_small(path), str(path))


def parse_toml(text: str, where: str) -> dict[str, Any]:
    """The table of a TOML text.

    Raises:
        FileError: no TOML, larger than `MOST_TOML_BYTES`, or nested deeper than `MOST_LEVELS`; names the line.
    """
    if len(text) > MOST_TOML_BYTES:
        raise FileError(f"{where}: {_size(len(text))} of TOML; at most {_size(MOST_TOML_BYTES)} are read")
    if found := _DOTTED.search(text):  # the parser's time grows with the square of a dotted key
        line = text.count("\n", 0, found.start()) + 1
        raise FileError(f"{where}: line {line}: a key of more than {MOST_LEVELS} parts; at most {MOST_LEVELS} are read")
    try:
        content = tomllib.loads(text)
    except RecursionError:
        raise FileError(_too_deep(where, "TOML")) from None
    except ValueError as error:  # of the TOML, or a number of 5000 digits
        raise FileError(f"{where}: {error}") from None
    _levels(content, where, "TOML")
    return content


def _opened(root: Path, name: str | Path, where: Path) -> int:
    *folders, last = _parts(name, where)
    place = os.open(root, os.O_PATH | os.O_DIRECTORY | os.O_CLOEXEC)  # noqa: TID251
    try:
        for folder in folders:
            inner = _open_at(place, folder, _PATH_FLAGS, where)
            os.close(place)
            place = inner
        handle = _open_at(place, last, _FILE_FLAGS, where)
        found = os.fstat(handle)
        if found.st_nlink > 1 and found.st_uid != os.fstat(place).st_uid:
            os.close(handle)
            raise FileError(f"{where}: is a hard link to a file of another user than its folder's; not read")
        return handle
    finally:
        os.close(place)


def _parts(name: str | Path, where: Path) -> tuple[str, ...]:
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts or not path.parts or "\0" in str(name):
        raise FileError(f"{where}: leads out of its folder; a name below it is allowed")
    return path.parts


def _open_at(place: int, name: str, flags: int, where: Path) -> int:
    try:
        return os.open(name, flags, dir_fd=place)  # noqa: TID251
    except OSError as error:
        if error.errno not in (errno.ELOOP, errno.ENOTDIR, errno.ENXIO):
            raise OSError(error.errno, error.strerror, str(where)) from None
        kind = _kind(os.stat(name, dir_fd=place, follow_symlinks=False).st_mode)
        raise FileError(f"{where}: '{name}' is {kind}; only regular files in folders are read here") from None


def _check(found: os.stat_result, where: Path, most_bytes: int) -> None:
    if not stat.S_ISREG(found.st_mode):
        raise FileError(f"{where}: is {_kind(found.st_mode)}; only regular files are read here")
    if found.st_size > most_bytes:
        raise FileError(f"{where}: has {_size(found.st_size)}; at most {_size(most_bytes)} are read")
    if found.st_size > UNASKED_BYTES and found.st_blocks * 512 * _SPARSEST < found.st_size:
        held = _size(found.st_blocks * 512)
        raise FileError(f"{where}: says that it has {_size(found.st_size)} and holds {held}; not read")


def _kind(mode: int) -> str:
    return next((text for is_kind, text in _KINDS if is_kind(mode)), "no folder")


def _levels(content: Any, where: str, kind: str) -> list[list[Any]]:
    """Tables and lists of what was parsed, those of each depth together; raises `FileError` where they go too deep."""
    found: list[list[Any]] = [[[content]]]
    for _ in range(MOST_LEVELS + 1):
        level: list[Any] = [value for item in found[-1] for value in _inside(item) if isinstance(value, dict | list)]
        if not level:
            return found
        found.append(level)
    raise FileError(_too_deep(where, kind))


def _inside(item: Any) -> Iterable[Any]:
    return item.values() if isinstance(item, dict) else item


def _is_huge(value: Any) -> bool:
    return isinstance(value, int | float) and abs(value) > sys.float_info.max


def _refused(constant: str) -> None:
    raise ValueError(f"{constant} is no number of JSON")


def _too_deep(where: str, kind: str) -> str:
    return f"{where}: {kind} nested more than {MOST_LEVELS} deep; at most {MOST_LEVELS} levels are read"


def _size(count: float) -> str:
    for unit in ("bytes", "kB", "MB"):
        if count < 1000:
            return f"{count:.4g} {unit}"
        count /= 1000
    return f"{count:.4g} GB"
