"""Run folders of a unit for passports, made in no time: a slow sine through a first-order lag."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from hil.findings.collect import results_of
from hil.findings.results import write_results
from hil.record.folder import read, write
from hil.record.measurement import Findings, Measurement
from hil.record.recording import Channel, Recording

GAIN = Measurement("gain", "l/min", "flow at full command", low=40.0, high=60.0)


def run_of(folder: Path, serial: str = "SN-7", *, gain: float = 50.0, hour: int = 9, name: str = "run",
           outcome: str = "completed", measured: Measurement = GAIN, simulated: bool = False,
           plant: str = "") -> Path:  # fmt: skip
    """A closed run folder with its results."""
    time_s = np.arange(400) * 0.01
    command = 100.0 * np.sin(2.0 * np.pi * 0.5 * time_s)
    flow = 0.01 * gain * command
    at = folder / name
    line = {"slope": 10.0, "offset": 0.0, "uncertainty": 0.2, "raw_unit": "V", "date": "2026-03-01", "source": "PTB 1"}
    meta = {
        "procedure": "step_response", "operator": "A. Muster", "bench": "test bench",
        "started_utc": datetime(2026, 11, 24, hour, tzinfo=UTC).isoformat(), "outcome": outcome,
        "stopped_utc": datetime(2026, 11, 24, hour, 5, tzinfo=UTC).isoformat(),
        "valve": {"name": "HPV41", "serial": serial}, "conditions": {"fluid_temperature_c": 40.0},
        "instruments": [{"name": "flow meter", "serial": "F-1", "calibrated": "2026-03-01", "due": "2027-03-01"}],
        "roles": {"command": "command", "response": "flow"}, "simulated": simulated, "plant": plant,
    }  # fmt: skip
    channels = {
        "command": Channel("command", "%", command),
        "flow": Channel("flow", "l/min", flow, "turbine", line),
    }
    at.parent.mkdir(parents=True, exist_ok=True)
    write(Recording(str(at), time_s, channels, meta), at)
    curve = {"command": command, "flow": flow, "units": {"command": "%", "flow": "l/min"}}
    findings = Findings((measured.of(gain, 0.5),), {"flow_curve": curve}, deviations=("oil was not sampled",))
    write_results(results_of(read(at), findings), at)
    return at
