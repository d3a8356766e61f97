"""`hil` and `python -m hil`."""

import ctypes
import gc
import os
import signal
import sys
import threading
from contextlib import suppress
from pathlib import Path

# `python -m hil` looks for modules in the working folder first; the script `hil` does not, and nothing else does.
if __name__ == "__main__" and not sys.flags.safe_path and Path(sys.path[0]) != Path(__file__).parents[1]:
    del sys.path[0]

from hil.cli.app import main as run
from hil.safety.interrupt import ignore_signals, status_of, terminable

# Fits multiply small matrices in threads of their own. A threaded BLAS beneath them waits for cores that are
# busy: with other work on both cores one fit took 18 s instead of 1. Read when numpy is first imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# The first model that pydantic builds looks for its plugins in every installed package. No command has one.
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")

# What a command loads, modules and compiled models, stays to its end. Python's usual thresholds look through all of it
# for garbage again and again: a fifth of a short command's time, and pauses while a valve stands open.
gc.set_threshold(20_000, 10, 10)

# glibc gives an array back when it is freed only if it is larger than the largest that was freed before, up to 32 MB.
# Those of a long recording lie between, and what is kept of them is in pieces: a quarter of the memory of `hil demo`.
_MMAP_THRESHOLD, _LARGE_ARRAY = -3, 8 << 20  # malloc.h
with suppress(AttributeError, OSError, TypeError):  # another C library
    ctypes.CDLL(None).mallopt(_MMAP_THRESHOLD, _LARGE_ARRAY)


_LEAVES_S = 5.0  # so long threads and children that a procedure has left behind are waited for


def main() -> None:
    """Entry point of the console script."""
    _stand_in_for_closed_streams()
    for name in ("SIGTTOU", "SIGTTIN"):  # in the background of a terminal: to write, or to read nothing, stops no run
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    with terminable():
        try:
            status = run()
        except KeyboardInterrupt as stopped:  # before any command had begun
            status = status_of(stopped)
        ignore_signals()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):
            stream.flush()
    if _is_program():
        leaving = threading.Timer(_LEAVES_S, os._exit, [status])
        leaving.daemon = True
        leaving.start()
    sys.exit(status)


def _stand_in_for_closed_streams() -> None:
    """Who starts this may have closed a stream: no file of a run takes its number, and nobody writes to None."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            stream = open(os.devnull, "w" if number else "r", encoding="utf-8")  # noqa: PTH123, SIM115  # the lowest free number
            os.set_inheritable(stream.fileno(), True)  # children have it too
            setattr(sys, name, stream)


def _is_program() -> bool:
    """Whether this is the whole program, and not called by another one."""
    return __name__ == "__main__" or Path(getattr(sys.modules["__main__"], "__file__", None) or "").stem == "hil"


if __name__ == "__main__":
    main()
