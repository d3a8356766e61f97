"""Files that a library parses are read in a process that can open nothing: no link in one leads anywhere.

HDF5, MATLAB, MDF, TDMS and Parquet are read by libraries that follow what a file says: other files, code, sizes. One
process for each program imports them (`confined_reader`); for each file it makes a child that has this file alone, and
little enough memory and time. What comes back are figures and texts, never objects.
"""

from __future__ import annotations

import atexit
import json
import logging
import os
import socket
import subprocess
import threading
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from hil.child import Process, child
from hil.errors import FileError, StorageError, naming
from hil.record.plain import to_json
from hil.record.table.columns import Column, Contents, Table
from hil.untrusted import most_bytes, most_unpacked, parse_json, unpacked_allowed

_PLAIN_KINDS = "biufcmMUSV"  # kinds of numpy that hold no objects
_LONGEST_WAIT_S = 900.0
_COUNT_BYTES = 8
_CPU_S, _BYTES_PER_CPU_S = 1, 1_000_000
_ALONE = {
    "ARROW_DEFAULT_MEMORY_POOL": "system",
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "NUMEXPR_NUM_THREADS": "1",
    "HDF5_PLUGIN_PRELOAD": "::",
}


def confined_contents(form: ModuleType, path: Path, file: BinaryIO) -> Contents:
    """What is in a file, read in a process that can open nothing.

    Args:
        form: the module of `hil.record.exchange` that reads it.
        path: as its user knows it.
        file: it, open.

    Raises:
        FileError: it cannot be read, or needs more memory or time than allowed.
        StorageError: no such process can be started.
    """
    stored_bytes = os.fstat(file.fileno()).st_size
    here, there = socket.socketpair()
    with here, there:
        _ask({"format": form.__name__.rpartition(".")[2], "path": str(path)}, file.fileno(), there.fileno())
        there.close()
        here.settimeout(_LONGEST_WAIT_S)
        with here.makefile("rb") as answer, naming(str(path)):
            try:
                count = int.from_bytes(_read_exactly(answer, _COUNT_BYTES), "little")
                head = parse_json(_read_exactly(answer, min(count, most_bytes())), "the answer of its reader")
                arrays = list(_arrays(answer, head.get("arrays", ()), most_unpacked(stored_bytes)))
            except (OSError, EOFError):
                raise FileError(
                    "its reader ended without an answer: the file is damaged, or needs more memory or time than "
                    f"allowed; {unpacked_allowed(stored_bytes)}, within {most_cpu_s(stored_bytes)} s of processor"
                ) from None
    if "error" in head:
        raise FileError(str(head["error"]))
    if not head["is_confined"]:
        _say_unconfined()
    tables = [
        Table(
            table["name"],
            [Column(heading, arrays[at], unit) for heading, at, unit in table["columns"]],
            None if table["time"] is None else arrays[table["time"]],
            table["assumed"],
        )
        for table in head["tables"]
    ]
    return tables, head["about"]


def most_cpu_s(stored_bytes: int) -> int:
    """The processor time in s that a file of so many bytes may take."""
    return _CPU_S + stored_bytes // _BYTES_PER_CPU_S


def sent(contents: Contents, is_confined: bool) -> list[bytes | memoryview]:
    """Contents as bytes, for `confined_contents`."""
    tables, about = contents
    arrays: dict[int, int] = {}
    kept: list[NDArray[Any]] = []

    def number(values: NDArray[Any] | None) -> int | None:
        if values is None:
            return None
        if id(values) not in arrays:  # one array that several tables share stays one
            arrays[id(values)] = len(kept)
            kept.append(values)
        return arrays[id(values)]

    described = [
        {
            "name": table.name, "assumed": table.assumed, "time": number(table.time_s),
            "columns": [[c.heading, number(c.values), c.unit] for c in table.columns],
        }
        for table in tables
    ]  # fmt: skip
    plain = [_plain(values) for values in kept]
    shapes = [[values.dtype.str, list(values.shape)] for values in plain]
    head = {"tables": described, "about": about, "arrays": shapes, "is_confined": is_confined}
    return [*framed(head), *(values.view(np.uint8).reshape(-1).data for values in plain if values.size)]


def framed(head: Mapping[str, Any]) -> list[bytes | memoryview]:
    """A head as bytes, after their count."""
    text = to_json(head).encode()
    return [len(text).to_bytes(_COUNT_BYTES, "little"), text]


def _plain(values: NDArray[Any]) -> NDArray[Any]:
    """An array without objects: texts as texts, and whatever is neither text nor number as nothing."""
    values = np.asarray(values)
    if values.dtype.kind == "O" and all(isinstance(one, str | bytes) for one in values.flat):
        texts = [one.decode(errors="replace") if isinstance(one, bytes) else one for one in values.flat]
        values = np.array(texts, dtype=np.str_).reshape(values.shape)
    if (
        values.dtype.hasobject
        or values.dtype.names
        or values.dtype.kind not in _PLAIN_KINDS
        or not values.dtype.itemsize
    ):
        values = np.zeros(values.shape, dtype="V1")
    return np.ascontiguousarray(values).reshape(values.shape)


def _arrays(answer: BinaryIO, kinds: Sequence[tuple[str, Sequence[int]]], most: int) -> Iterator[NDArray[Any]]:
    for kind, shape in kinds:
        dtype = np.dtype(kind)
        if dtype.kind not in _PLAIN_KINDS or dtype.names or dtype.subdtype or dtype.hasobject:
            raise FileError(f"its reader sent '{kind:.20}', which is no kind of figures")
        size = dtype.itemsize * int(np.prod(shape, dtype=object))
        if not 0 <= size <= most:
            raise FileError(f"an array of {size / 1e9:.3g} GB; {most / 1e9:.3g} GB of it may still be read")
        most -= size
        found = np.empty(size, dtype=np.uint8)
        if answer.readinto(found.data) != size:  # type: ignore[attr-defined]
            raise EOFError
        yield found.view(dtype).reshape(shape)


def _read_exactly(answer: BinaryIO, count: int) -> bytes:
    found = answer.read(count)
    if len(found) != count:
        raise EOFError
    return found


@cache
def _say_unconfined() -> None:
    logging.getLogger(__name__).warning(
        "this kernel has no Landlock: what parses files of others opens no other file, but might run a program"
    )


class _Reader:
    """The process that makes a child for each file, and the socket on which it is asked."""

    def __init__(self) -> None:
        self.socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            # A session of its own: Ctrl-C is the asking program's. It ends when that program is gone.
            self.process: Process[bytes] = child(
                "hil.record.confined_reader", environment=_ALONE, stdin=theirs.fileno(), stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL, start_new_session=True, cwd=os.sep,
            )  # fmt: skip
        self.pid = os.getpid()
        atexit.register(self.end)

    def end(self) -> None:
        """End it; a fork of this program leaves it alone."""
        if self.pid == os.getpid():
            self.socket.close()
            self.process.kill()
            self.process.wait()

    @property
    def is_ours(self) -> bool:
        """Whether it lives, and was started by this process and not by one that this is a fork of."""
        return self.pid == os.getpid() and self.process.poll() is None


_lock = threading.Lock()
_readers: list[_Reader] = []


def _ask(request: Mapping[str, str], *handles: int) -> None:
    message = [json.dumps(request).encode()]
    with _lock:
        if not (_readers and _readers[0].is_ours):
            _readers[:] = [_started()]
        try:
            socket.send_fds(_readers[0].socket, message, handles)
        except OSError:  # it was ended
            _readers[:] = [_started()]
            socket.send_fds(_readers[0].socket, message, handles)


def _started() -> _Reader:
    try:
        return _Reader()
    except OSError as error:
        raise StorageError(f"the process that reads files cannot be started: {error.strerror or error}") from error
