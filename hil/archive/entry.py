"""What the index keeps of a run folder, read from its small files alone."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from pydantic import TypeAdapter

from hil.errors import FileError, reason
from hil.findings.results import read_results
from hil.record.measurement import FINDINGS_FILE, RESULTS_FILE, Measured, Verdict
from hil.record.run_folder.header import HEADER_FILE, read_end, read_header, stated
from hil.record.run_folder.instruments import StatedCalibration, calibrations_of, instruments_mark
from hil.record.run_folder.seal import check_seal
from hil.record.simulated import is_simulated
from hil.untrusted import MOST_LEVELS, is_regular, read_untrusted_json

UNFINISHED = "not closed"
"""The outcome of a run that is under way, or was killed."""


@dataclass(frozen=True, slots=True)
class Entry:
    """A run as the index knows it. `serial` and `operator` are empty where nobody stated them.

    `host` is the computer on which the folder lies, None where an earlier version entered the run.
    `instruments` is a mark that runs share when one bench measured them with the same calibrations; None where an
    earlier version entered the run. `simulated` likewise, where its folder could not be asked.
    """

    folder: Path
    serial: str
    operator: str
    procedure: str
    bench: str
    started_utc: datetime
    outcome: str
    verdict: Verdict | None
    values: tuple[Measured, ...]
    instruments: str | None = None
    calibrations: tuple[StatedCalibration, ...] = ()
    host: str | None = None
    simulated: bool | None = None

    @property
    def is_of_another_host(self) -> bool:
        """Whether the folder lies on another computer."""
        return self.host not in (None, this_host())

    @property
    def identity(self) -> tuple[object, ...]:
        """What tells a run from all others, wherever its folder lies."""
        return self.folder.name, self.started_utc, self.serial, self.procedure, self.bench


def this_host() -> str:
    """The name of this computer."""
    return socket.gethostname()[:255]


def entry_of(folder: Path) -> Entry:
    """The entry of a run folder.

    Raises:
        FileError: not a run folder, its results cannot be read, or one of the two was changed after it was sealed.
    """
    check_seal(folder, HEADER_FILE)
    header, end = read_header(folder), read_end(folder)
    verdict, values = _found(folder)
    meta = header.meta
    return Entry(
        folder=folder.resolve(),
        serial=stated(meta, "valve", "serial"),
        operator=stated(meta, "operator"),
        procedure=stated(meta, "procedure"),
        bench=stated(meta, "bench"),
        started_utc=header.started_utc,
        outcome=UNFINISHED if end is None else end.outcome,
        verdict=verdict,
        values=tuple(value.renamed for value in values),
        instruments=instruments_mark(header),
        calibrations=calibrations_of(header),
        host=this_host(),
        simulated=is_simulated(meta),
    )


def _found(folder: Path) -> tuple[Verdict | None, tuple[Measured, ...]]:
    """(verdict, measured values) as they were kept at the end of the run; runs of 0.1.0 kept `findings.json` alone."""
    older = folder / FINDINGS_FILE
    if (folder / RESULTS_FILE).exists():
        check_seal(folder, RESULTS_FILE)
        results = read_results(folder / RESULTS_FILE)
        return results.verdict, results.values
    if not older.exists():
        return None, ()
    try:
        content = read_untrusted_json(folder, FINDINGS_FILE)
        return content["verdict"], TypeAdapter(tuple[Measured, ...]).validate_python(content["measured"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise FileError(f"{older}: not what this program writes: {reason(error):.120}") from None


def run_folders(below: Path, levels: int = MOST_LEVELS) -> Iterator[Path]:
    """Every run folder in a folder, at so many levels; a run folder holds no others.

    One further down that cannot be listed is among them: who reads it hears why.

    Raises:
        FileError: the folder itself cannot be listed.
    """
    if is_regular(below, HEADER_FILE):
        yield below
        return
    try:
        inner = sorted(path for path in below.iterdir() if path.is_dir() and not path.is_symlink())
    except OSError as error:
        if levels == MOST_LEVELS:
            raise FileError(f"{below}: cannot be read: {error.strerror}") from None
        yield below
        return
    for path in inner if levels else ():
        yield from run_folders(path, levels - 1)
