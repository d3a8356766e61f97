"""The process that reads files of others: it imports their libraries, and makes a child for each file.

The child gives up the right to open anything (no handle is free, and Landlock), to write, and to use more memory and
time than a recording of this size needs, before it looks at the file. Started by `hil.record.confined`, with a socket
as its input.
"""

from __future__ import annotations

import ctypes
import importlib
import json
import os
import resource
import signal
import socket
import struct
from contextlib import suppress
from pathlib import Path
from typing import Any

from hil.errors import FileError, reason
from hil.record import exchange
from hil.record.confined import framed, most_cpu_s, sent
from hil.record.extra import library
from hil.untrusted import most_unpacked, unpacked_allowed

_COPIES = 2  # of the values: as the library holds them, and as they are sent
_SPARE_BYTES, _RESERVED_BYTES = 1 << 26, 1 << 31  # for what libraries touch, and reserve without touching it

_CREATE_RULESET, _RESTRICT_SELF, _VERSION = 444, 446, 1
_PR_SET_NO_NEW_PRIVS, _PR_SET_PDEATHSIG = 38, 1
_FILE_RIGHTS = {1: 0x1FFF, 2: 0x3FFF, 3: 0x7FFF, 4: 0x7FFF}  # of each version of Landlock
_ALL_FILE_RIGHTS, _NET_RIGHTS, _SCOPES = 0xFFFF, 0x3, 0x3


def main() -> None:
    """Answer requests until the asking program is gone."""
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for the children
    asked = socket.socket(fileno=os.dup(0))
    while True:
        message, handles, _, _ = socket.recv_fds(asked, 1 << 16, 2)
        if len(handles) != 2:
            return
        try:
            _answer_in_a_child(asked, json.loads(message), *handles)
        finally:
            for handle in handles:
                os.close(handle)


def _answer_in_a_child(asked: socket.socket, request: dict[str, str], file: int, answer: int) -> None:
    form = importlib.import_module(f"{exchange.__name__}.{request['format']}")
    path = Path(request["path"])
    try:
        for name in form.LIBRARIES:
            library(name, path)
    except (FileError, OSError) as error:
        _send(answer, framed({"error": reason(error)}))
        return
    if os.fork() == 0:  # noqa: TID251  # one thread, and nothing open but what the child is for
        with suppress(BaseException):
            asked.close()
            _send(answer, _read(form, path, file))
        os._exit(0)


def _read(form: Any, path: Path, file: int) -> list[bytes | memoryview]:
    stored_bytes = os.fstat(file).st_size
    is_confined = confine(stored_bytes)
    try:
        with open(file, "rb", closefd=False) as opened:  # a handle, not a path
            return sent(form.contents(path, opened), is_confined)
    except MemoryError:
        text = f"{path}: needs more memory than allowed; {unpacked_allowed(stored_bytes)}"
    except FileError as error:
        text = str(error)
    except Exception as error:  # a library raises what its parser happens to stumble over
        text = f"{path}: cannot be read as {form.KIND}: {reason(error)}"
    return framed({"error": text})


def confine(stored_bytes: int) -> bool:
    """Give up, for good, what reading an open file does not need; returns whether nothing else can be opened now.

    Args:
        stored_bytes: size of the file, on which memory and time depend that it may take.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    reserved, touched = _memory_bytes()
    memory = _COPIES * most_unpacked(stored_bytes) + _SPARE_BYTES
    cpu_s = most_cpu_s(stored_bytes)
    for limit, most in (
        (resource.RLIMIT_DATA, touched + memory), (resource.RLIMIT_AS, reserved + memory + _RESERVED_BYTES),
        (resource.RLIMIT_CPU, cpu_s), (resource.RLIMIT_FSIZE, 0), (resource.RLIMIT_CORE, 0),
    ):  # fmt: skip
        resource.setrlimit(limit, (most, most))
    is_confined = _give_up_files(libc)
    resource.setrlimit(resource.RLIMIT_NOFILE, (0, 0))  # with Landlock or without: no further handle
    return is_confined


def _give_up_files(libc: ctypes.CDLL) -> bool:
    version = libc.syscall(_CREATE_RULESET, None, ctypes.c_size_t(0), _VERSION)
    if version < 1:
        return False
    rights = struct.pack("QQQ", _FILE_RIGHTS.get(version, _ALL_FILE_RIGHTS), _NET_RIGHTS, _SCOPES)
    size = 8 if version < 4 else 16 if version < 6 else 24
    rules = libc.syscall(_CREATE_RULESET, rights, ctypes.c_size_t(size), 0)  # without an exception: nothing is allowed
    if rules < 0:
        return False
    libc.prctl(_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0)
    done = libc.syscall(_RESTRICT_SELF, rules, 0)
    os.close(rules)
    return bool(done == 0)


def _memory_bytes() -> tuple[int, int]:
    """(reserved, of one's own to write to) by this process."""
    pages = Path("/proc/self/statm").read_text(encoding="ascii").split()
    return int(pages[0]) * resource.getpagesize(), int(pages[5]) * resource.getpagesize()


def _send(answer: int, parts: list[bytes | memoryview]) -> None:
    stream = socket.socket(fileno=answer)
    for part in parts:
        stream.sendall(part)
    stream.detach()  # whose handle it is closes it


if __name__ == "__main__":
    main()
