"""Run folders of a unit for passports, made in no time: a slow sine through a gain.

Their procedure is a stranger's (`tests/stranger`): a test that uses them asks for the fixture `stranger`.
"""

from __future__ import annotations

import sys
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from hil.catalog import entries
from hil.findings.collect import results_of
from hil.findings.results import write_results
from hil.record.folder import read, write
from hil.record.recording import Channel, Recording
from hil.record.run_folder.seal import seal_folder
from hil.session.results import evaluated_anew, judged_by


def run_of(folder: Path, serial: str = "SN-7", *, gain: float = 50.0, hour: int = 9, name: str = "run",
           outcome: str = "completed", limited: bool = True, simulated: bool = False,
           plant: str = "") -> Path:  # fmt: skip
    """A closed run folder with its results, sealed; on no audit trail."""
    time_s = np.arange(400) * 0.01
    command = 100.0 * np.sin(2.0 * np.pi * 0.5 * time_s)
    flow = 0.01 * gain * command
    at = folder / name
    line = {"slope": 10.0, "offset": 0.0, "uncertainty": 0.2, "raw_unit": "V", "date": "2026-03-01", "source": "PTB 1"}
    meta = {
        "procedure": "sine_gain", "operator": "A. Muster", "bench": "test bench",
        "started_utc": datetime(2026, 11, 24, hour, tzinfo=UTC).isoformat(), "outcome": outcome,
        "stopped_utc": datetime(2026, 11, 24, hour, 5, tzinfo=UTC).isoformat(),
        "valve": {"name": "HPV41", "serial": serial}, "conditions": {"fluid_temperature_c": 40.0},
        "instruments": [{"name": "flow meter", "serial": "F-1", "calibrated": "2026-03-01", "due": "2027-03-01"}],
        "limits": {} if limited else {"gain": {"low": None, "high": None}},
        "roles": {"command": "command", "response": "flow"}, "simulated": simulated, "plant": plant,
    }  # fmt: skip
    channels = {
        "command": Channel("command", "%", command),
        "flow": Channel("flow", "l/min", flow, "turbine", line),
    }
    at.parent.mkdir(parents=True, exist_ok=True)
    write(Recording(str(at), time_s, channels, meta), at)
    recording = read(at)
    findings = evaluated_anew(recording, at)
    write_results(results_of(recording, findings), at)
    seal_folder(at, judged_by(recording, at))
    return at


def installed() -> None:
    """Their procedure, for a program that is no test."""
    sys.path.insert(0, str(Path(__file__).parent / "stranger"))
    entries.cache_clear()
