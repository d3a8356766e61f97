"""Writing to a terminal or a pipe without being held up by who reads it: stopped by Ctrl-S, full, or gone."""

from __future__ import annotations

import os
import select
import sys
import time
from contextlib import suppress
from typing import IO

from hil.printable import printable

_CHUNK_BYTES = 512  # bytes: what can be written there takes so many without waiting


def write(text: str, within_s: float, stream: IO[str] | None = None) -> bool:
    """Write a text to stderr as it can be shown, or to another stream as it is; whether all of it was taken in time.

    Safe in the handler of a signal: it goes past the buffers of Python, which may be in use just then.
    """
    text, stream = (printable(text), sys.stderr) if stream is None else (text, stream)
    try:
        place, encoding = stream.fileno(), getattr(stream, "encoding", None) or "utf-8"
    except (AttributeError, OSError, ValueError):  # closed, or no stream of the system
        with suppress(AttributeError, OSError, ValueError):
            stream.write(text)
        return True
    left, until_s = memoryview(text.encode(encoding, "hil.escaped")), time.monotonic() + within_s
    with suppress(OSError, ValueError):
        while left and _takes(place, until_s - time.monotonic()):
            left = left[os.write(place, left[:_CHUNK_BYTES]) :]
    return not left


def _takes(place: int, within_s: float) -> bool:
    if not hasattr(select, "poll"):  # a system that tells of sockets only
        return True
    poll = select.poll()
    poll.register(place, select.POLLOUT)
    return bool(poll.poll(max(0.0, 1000.0 * within_s)))
