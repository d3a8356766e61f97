"""The loop over real links in wall-clock time: what is identified is the plant, not what the link does to it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from hil.bench.open import open_rig
from hil.clock import VirtualClock
from hil.daq.contract import Block, Waveform, joined
from hil.record.read import read_recording
from hil.signals.sine_fit import sine_fit
from tests.links import served
from tests.simulated import hpv41

BENCHES = ["hpv41-modbus-tcp", "hpv41-modbus-rtu", "hpv41-serial"]
FREQUENCY_HZ = 2.0
RATE_HZ = 100.0
SECONDS = 1.5


def command() -> np.ndarray:
    time_s = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ
    return 60.0 + 15.0 * np.sin(2.0 * np.pi * FREQUENCY_HZ * time_s)


def response(time_s: np.ndarray, driven: np.ndarray, flow: np.ndarray, delay_s: float) -> complex:
    """Flow over command at the frequency of the sine, from its last samples, [l/min per %]."""
    last = time_s > time_s[-1] - 1.2 / FREQUENCY_HZ
    told, answered = (
        sine_fit(time_s[last] - time_s[0] + late, values[last], FREQUENCY_HZ, harmonics=2).phasor
        for values, late in ((driven, 0.0), (flow, delay_s))
    )
    return answered / told


@pytest.fixture(scope="module")
def direct() -> complex:
    """The same sine on the plant behind a simulated DAQ, without any link."""
    daq = hpv41(clock=VirtualClock())
    block: Block = joined(list(daq.play(Waveform(RATE_HZ, {"command": command() / 10.0}))))
    return response(block.time_s, 10.0 * block.outputs["command"], 10.0 * block.inputs["flow"], 0.0)


@pytest.mark.parametrize("bench", BENCHES)
def test_response_over_a_link_is_the_direct_one(bench: str, direct: complex, tmp_path: Path) -> None:
    quiet = [(f"noise = {std}", "noise = 0.01") for std in ("0.3", "0.1", "0.2")]
    with served(bench, tmp_path, *quiet) as (file, _), open_rig(file, tmp_path / "run", {}, lambda _d, _t: None) as rig:
        rate_hz = rig.actual_rate_hz(RATE_HZ)
        recording = rig.play(command(), rate_hz, part={"kind": "sine"})
        delay_s = rig.promises["delay_s"]["flow"]
    found = response(recording.time_s, recording.values("command"), recording.values("flow"), delay_s)
    assert abs(found / direct) == pytest.approx(1.0, abs=0.03)
    assert abs(np.angle(found / direct, deg=True)) < 3.0
    header = read_recording(tmp_path / "run").meta["sampling"]
    assert header["timing"] == "polled"
    assert 0.0 < header["latency_s"] < 0.05
    assert 0.0 < header["delay_s"]["flow"] < 0.05
    assert json.dumps(header)
