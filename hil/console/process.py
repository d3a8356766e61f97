"""`hil …` as a process of its own, started with a list of arguments, never through a shell; it outlives the console."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hil.archive.place import VARIABLE as ARCHIVE
from hil.archive.place import Place
from hil.bench.audit import ACCOUNT
from hil.child import Process, child
from hil.errors import StorageError
from hil.language.choice import VARIABLE
from hil.language.words import spoken

_TAIL_BYTES = 16_384


@dataclass(slots=True)
class Started:
    """A process that this console started.

    Attributes:
        name: by which pages speak of it.
        process: it.
        log: what it prints.
        over_s: since when it is known to have ended.
    """

    name: str
    process: Process[bytes]
    log: Path
    over_s: float | None = None

    @property
    def exit_status(self) -> int | None:
        """None while it runs."""
        return self.process.poll()

    @property
    def lines(self) -> list[str]:
        """What it printed last."""
        return tail_lines(self.log)

    @property
    def last_line(self) -> str:
        """The last thing that it printed, without the name before an error; empty before the first."""
        return next((line for line in reversed(self.lines) if line.strip()), "").strip().removeprefix("hil: ")

    def end(self) -> None:
        """Ask it to end; it makes its own outputs safe. Not as Ctrl-C does, which a shell lets its jobs ignore."""
        self.process.terminate()


def start(name: str, arguments: Sequence[str], log: Path, account: str = "", place: Place | None = None) -> Started:
    """Start `hil ARGUMENTS…` for an account of the console, with its archive.

    Both go by the environment: everybody can read a command line, and the address of an archive may hold a password.

    Raises:
        StorageError: its log cannot be written.
    """
    try:
        log.parent.mkdir(parents=True, exist_ok=True)
        archive = {} if place is None else {ARCHIVE: place.address}
        with log.open("wb") as written:
            process = child(
                "hil", arguments,
                {"PYTHONUNBUFFERED": "1", "HIL_PROGRESS_S": "1", VARIABLE: spoken(), ACCOUNT: account, **archive},
                stdin=subprocess.DEVNULL, stdout=written, stderr=subprocess.STDOUT, start_new_session=True,
            )  # fmt: skip
    except OSError as error:
        raise StorageError(f"{log}: hil {arguments[0]} cannot be started: {error.strerror or error}") from error
    return Started(name, process, log)


def tail_lines(log: Path) -> list[str]:
    """The last lines of a log; none where it is not there."""
    try:
        with log.open("rb") as file:
            file.seek(max(0, log.stat().st_size - _TAIL_BYTES))
            return file.read().decode("utf-8", "replace").splitlines()
    except OSError:
        return []
