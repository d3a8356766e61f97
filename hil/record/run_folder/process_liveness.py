"""Whether the process of a run, or of a console, is still there."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path


def is_alive(pid: int) -> bool:
    """Whether a process is there and does more than wait to be buried."""
    if pid <= 0:  # a group of processes
        return False
    try:
        os.kill(pid, 0)  # noqa: TID251
    except PermissionError:
        return True
    except (OSError, OverflowError):  # no number of a process
        return False
    with suppress(OSError, IndexError):
        return Path(f"/proc/{pid}/stat").read_bytes().rpartition(b")")[2].split()[0] not in (b"Z", b"X")
    return True
