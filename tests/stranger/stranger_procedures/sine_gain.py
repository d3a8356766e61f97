"""A slow sine, and the flow at full command: evaluated in no time."""

import numpy as np

from hil.record.measurement import Findings, Measurement
from hil.record.recording import Recording
from hil.rig import Rig

GAIN = Measurement("gain", "l/min", "flow at full command", low=40.0, high=60.0)
MEASUREMENTS = (GAIN,)


def run(rig: Rig) -> None:
    """Play two periods of 0.5 Hz."""
    rig.play(100.0 * np.sin(np.pi * np.arange(round(4.0 * rig.rate_hz)) / rig.rate_hz))


def evaluate(recording: Recording) -> Findings:
    command, flow = recording.values("command"), recording.values("flow")
    curve = {"command": command, "flow": flow, "units": {"command": "%", "flow": "l/min"}}
    gain = 100.0 * float(command @ flow / (command @ command))
    return Findings((GAIN.of(gain, 0.5),), {"flow_curve": curve}, deviations=("oil was not sampled",))
