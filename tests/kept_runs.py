"""Run folders of three samples with results, as `hil run` leaves them: for what reads results alone."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hil.findings.collect import results_of
from hil.findings.results import write_results
from hil.record.folder import write
from hil.record.measurement import Findings, Measured
from hil.record.recording import Channel, Recording


def kept_run(folder: Path, measured: Sequence[Measured], serial: str = "A7", day: int = 1, **meta: object) -> Path:
    """A run of a unit that began on a day of January, with what was measured; `meta` goes into its header."""
    flow = {"flow": Channel("flow", "l/min", np.zeros(3))}
    usual = {"procedure": "step", "valve": {"serial": serial}, "started_utc": f"2026-01-{day:02}T00:00:00+00:00",
             "outcome": "completed"}  # fmt: skip
    recording = Recording(str(folder), np.arange(3.0), flow, {**usual, **meta})
    write(recording, folder)
    write_results(results_of(recording, Findings(tuple(measured))), folder)
    return folder
