"""The loop over real links in wall-clock time: what is identified is the plant, not what the link does to it."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hil.bench.find import benches
from hil.bench.open import open_rig
from hil.bench.read import BenchFile, read_bench
from hil.clock import VirtualClock
from hil.daq.contract import Block, Waveform, joined
from hil.record.measurement import Measured
from hil.record.read import read_recording
from hil.session.procedure import load_procedure
from hil.signals.sine_fit import sine_fit
from tests.links import moved, served
from tests.simulated import FLOW, SPOOL, hpv41

BENCHES = ["hpv41-modbus-tcp", "hpv41-modbus-rtu", "hpv41-serial", "hpv41-canopen", "hpv41-mixed"]
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
def direct() -> dict[str, complex]:
    """The same sine on the plant behind a simulated DAQ, without any link: by response."""
    daq = hpv41({"flow": FLOW, "spool position": SPOOL}, clock=VirtualClock())
    block: Block = joined(list(daq.play(Waveform(RATE_HZ, {"command": command() / 10.0}))))
    driven = 10.0 * block.outputs["command"]
    return {
        name: response(block.time_s, driven, slope * block.inputs[name], 0.0)
        for name, slope in (("flow", 10.0), ("spool position", 12.5))
    }


@pytest.mark.parametrize("bench", BENCHES)
def test_response_over_a_link_is_the_direct_one(bench: str, direct: dict[str, complex], tmp_path: Path) -> None:
    text = benches()[bench].read_text(encoding="utf-8")
    quiet = [(f"noise = {std}", "noise = 0.01") for std in ("0.3", "0.1", "0.2") if f"noise = {std}" in text]
    with (
        served(bench, tmp_path, *quiet) as (file, _),
        open_rig(file, tmp_path / "run", {}, lambda _d, _t: None) as rig,
    ):
        rate_hz = rig.actual_rate_hz(RATE_HZ)
        recording = rig.play(command(), rate_hz, part={"kind": "sine"})
        name = rig.response.name
        delay_s = rig.promises["delay_s"][name]
    found = response(recording.time_s, recording.values("command"), recording.values(name), delay_s)
    ratio = found / direct[name]
    assert abs(ratio) == pytest.approx(1.0, abs=0.03)
    assert abs(np.angle(ratio, deg=True)) < 3.0
    header = read_recording(tmp_path / "run").meta["sampling"]
    assert header["timing"] == "polled"
    assert 0.0 < header["latency_s"] < 0.05
    assert 0.0 < header["delay_s"][name] < 0.05
    assert json.dumps(header)


def test_devices_are_served_in_a_process_of_their_own(tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_text(moved(benches()["hpv41-mixed"].read_text(encoding="utf-8"), tmp_path), encoding="utf-8")
    process = subprocess.Popen(
        [sys.executable, "-m", "hil", "devices", str(path)], stdout=subprocess.PIPE, text=True, encoding="utf-8"
    )
    assert process.stdout is not None
    try:
        told = [process.stdout.readline().strip() for _ in range(4)]
        daq = read_bench(path).open()
        block = joined(list(daq.play(Waveform(50.0, {"command": np.full(10, 30.0)}))))
        daq.close()
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(5.0)
        process.stdout.close()
    assert [line.partition(" at ")[0] for line in told[:3]] == [
        "valve: canopen_valve", "meter: modbus", "module: ascii_module",
    ]  # fmt: skip
    assert told[3] == "simulated; Ctrl-C ends it" and process.returncode == 0
    assert block.inputs["supply pressure"] == pytest.approx(4.0, abs=0.5)
    assert block.inputs["spool position"][-1] > 5.0
    assert not (tmp_path / "hil-module").is_symlink()


def test_step_response_of_the_procedure_is_the_direct_one(tmp_path: Path) -> None:
    def rise(file: BenchFile, folder: Path) -> Measured:
        with open_rig(file, folder, {"settings": {"band": 2.0}}, lambda _d, _t: None) as rig:
            procedure.run(rig, levels=(0.0, 60.0), hold_s=0.9, rate_hz=100.0)
        measured = procedure.evaluate(read_recording(folder)).measured
        return next(quantity for quantity in measured if quantity.name.startswith("rise"))

    procedure = load_procedure("step_response")
    with served("hpv41-modbus-tcp", tmp_path) as (file, _):
        linked = rise(file, tmp_path / "linked")
    plain = rise(read_bench(benches()["brevini-hpv41"]), tmp_path / "plain")
    assert linked.std and plain.std and 150.0 < plain.value < 450.0
    assert abs(linked.value - plain.value) < 3.0 * np.hypot(linked.std, plain.std) + 5.0
