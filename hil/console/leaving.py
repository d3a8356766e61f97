"""A console that is told to end by SIGTERM, as a service is: its runs end with it, and it leaves after their watchdogs.

Whatever ends the console's group of processes when it is gone then finds nothing that drives, or that makes safe.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from urllib.parse import urlsplit

from hil.bench.fail_safe_shutdown import LONGEST_S
from hil.console.process import Started
from hil.console.underway import control_of

_CONNECTS_S = 0.5


class Leaving:
    """Ends runs in order.

    Args:
        runs: that this console has started, by their folders.
    """

    def __init__(self, runs: Mapping[Path, Started]) -> None:
        self._runs = dict(runs)
        self._until_s = time.monotonic() + LONGEST_S
        for run in self._runs.values():
            if run.exit_status is None:
                run.end()

    @property
    def is_over(self) -> bool:
        """Whether runs and their watchdog processes are gone; also when they had all the time that these take."""
        self._runs = {folder: run for folder, run in self._runs.items() if run.exit_status is None or _listens(folder)}
        return not self._runs or time.monotonic() > self._until_s


def _listens(folder: Path) -> bool:
    """Whether the watchdog of a run that has ended is still at work: then stop can be asked of it."""
    with suppress(OSError, ValueError):
        place = urlsplit(str(control_of(folder).get("stop_url", "")))
        with socket.create_connection((place.hostname or "", place.port or 0), _CONNECTS_S):
            return True
    return False
