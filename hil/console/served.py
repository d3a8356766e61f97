"""Simulated devices that this console started: each bench's in a process of its own, found again after a restart."""

from __future__ import annotations

import json
import os
import signal
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from hil.console.process import start, tail_lines
from hil.console.site import NotHereError
from hil.errors import FileError, SettingError
from hil.record.process_liveness import is_alive
from hil.untrusted import read_untrusted_json


@dataclass(frozen=True, slots=True)
class Served:
    """The devices of a bench, simulated.

    Attributes:
        bench: by name.
        pid: of the process that serves them.
        quirks: their misbehaviour, as it was asked for.
        log: what the process says.
    """

    bench: str
    pid: int
    quirks: tuple[str, ...]
    log: Path

    @property
    def is_alive(self) -> bool:
        """Whether they are served."""
        return is_alive(self.pid) and _is_ours(self.pid)

    @property
    def lines(self) -> list[str]:
        """Where each is served, or why it is not."""
        return tail_lines(self.log)


def serve(state: Path, bench: str, path: Path, quirks: list[str]) -> Served:
    """Start the devices of a bench.

    Raises:
        SettingError: they are served already.
        StorageError: the process cannot be started.
    """
    folder = state / "devices"
    if any(one.bench == bench and one.is_alive for one in served(state)):
        raise SettingError(f"the devices of bench '{bench}' are served already; end them first")
    log = folder / f"{bench}.log"
    made = start(f"devices-{bench}", ["devices", str(path), *(f"--quirk={quirk}" for quirk in quirks)], log)
    content = {"bench": bench, "pid": made.process.pid, "quirks": quirks}
    (folder / f"{bench}.json").write_text(json.dumps(content), encoding="utf-8")
    return Served(bench, made.process.pid, tuple(quirks), log)


def served(state: Path) -> list[Served]:
    """Every bench whose devices were started here, living or dead."""
    found = []
    for path in sorted((state / "devices").glob("*.json")):
        with suppress(OSError, FileError, ValueError, KeyError, TypeError):
            content = read_untrusted_json(path.parent, path.name)
            found.append(
                Served(str(content["bench"]), int(content["pid"]), tuple(content["quirks"]), path.with_suffix(".log"))
            )
    return found


def end(state: Path, bench: str) -> None:
    """End the devices of a bench, as Ctrl-C does.

    Raises:
        NotHereError: none of that bench are served by this console.
    """
    found = next((one for one in served(state) if one.bench == bench and one.is_alive), None)
    if found is None:
        raise NotHereError(f"no devices of bench '{bench:.80}' are served here")
    with suppress(ProcessLookupError):
        os.kill(found.pid, signal.SIGINT)


def _is_ours(pid: int) -> bool:
    """Whether the process serves devices, and is not another that has the number now."""
    try:
        return b"\0devices\0" in Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return not Path("/proc/self").exists()  # where nobody can look
