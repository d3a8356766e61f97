"""The loop over real links in wall-clock time: what is identified is the plant, not what the link does to it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from hil.bench.find import benches
from hil.bench.read import BenchFile, read_bench
from hil.clock import VirtualClock
from hil.daq.contract import Block, Waveform
from hil.errors import LinkError, RangeError
from hil.record.read import read_recording
from hil.record.recording import Array, Recording
from hil.session.procedure import load_procedure
from hil.signals.sine_fit import sine_fit
from tests import link_page
from tests.driven import played, silent_rig
from tests.fault_page import PAGE
from tests.links import CALM, answered, bench_text, devices_of, moved, served
from tests.simulated import FLOW, SPOOL, hpv41

BENCHES = ["hpv41-modbus-tcp", "hpv41-modbus-rtu", "hpv41-serial", "hpv41-canopen", "hpv41-mixed"]
FREQUENCY_HZ = 1.0
RATE_HZ = 20.0
JUDGED = ("block_s = 0.1", "block_s = 0.5")  # how often inputs are is not what is tried, and asks for a fast host
IDLE = ("sample_rate_hz = 20", "sample_rate_hz = 5")  # between tests; a busy host may offer less than a test asks for
SECONDS = 3.5
SETTLE_S = 0.5
STALLED_RAD = 0.02  # standard uncertainty beyond which the host, not the link, decides what 20 ms (0.13 rad) are worth
TRIES = 5
UNEVEN = 0.2  # of the delay: a stamp lies in the middle of an exchange, the device acts somewhere within it
LEVEL = 0.01  # of the response: converters


@dataclass(frozen=True)
class Response:
    """Response over command, by how much it may be wrong, and what the link did meanwhile."""

    value: complex
    std: float
    delay_s: float

    @property
    def allowed(self) -> float:
        """How far it may be from the direct one."""
        uneven = UNEVEN * 2.0 * np.pi * FREQUENCY_HZ * self.delay_s
        return 3.0 * self.std + (uneven + LEVEL) * abs(self.value)

    @property
    def stalled(self) -> bool:
        return self.std > STALLED_RAD * abs(self.value)


def command(rate_hz: float = RATE_HZ) -> Array:
    time_s = np.arange(round(SECONDS * rate_hz)) / rate_hz
    return 60.0 + 15.0 * np.sin(2.0 * np.pi * FREQUENCY_HZ * time_s)


def response(time_s: Array, driven: Array, read_s: Array, read: Array) -> Response:
    """At the frequency of the sine, whole periods of it, each channel at its own stamps.

    With as many harmonics as the rate allows that a busy host has left.
    """
    last = time_s >= time_s[0] + SETTLE_S
    harmonics = min(3, int(0.49 / FREQUENCY_HZ / np.diff(time_s).mean()))
    told, answered = (
        sine_fit(stamps[last] - time_s[0], values[last], FREQUENCY_HZ, harmonics=harmonics)
        for stamps, values in ((time_s, driven), (read_s, read))
    )
    size = answered.amplitude / told.amplitude
    std = size * float(np.hypot(told.phase_std_rad, answered.phase_std_rad))
    return Response(answered.phasor / told.phasor, std, float(np.mean(read_s - time_s)))


@cache
def direct(name: str, rate_hz: float = RATE_HZ) -> complex:
    """The same sine on the plant behind a simulated DAQ, without any link."""
    signal, slope = {"flow": (FLOW, 10.0), "spool position": (SPOOL, 12.5)}[name]
    daq = hpv41({name: signal}, clock=VirtualClock())
    block: Block = played(daq, Waveform(rate_hz, {"command": command(rate_hz) / 10.0}))
    return response(block.time_s, 10.0 * block.outputs["command"], block.time_s, slope * block.inputs[name]).value


def linked(file: BenchFile, folder: Path, rate_hz: float = RATE_HZ) -> tuple[Response, Recording, float]:
    """The same over a link, and at which rate; several times, while the recording shows that the host stalled.

    A host that is too busy for a rate is asked for half of it. What a stalled one measured counts within its own
    uncertainty, which is large.
    """
    for attempt in range(TRIES):
        try:
            with silent_rig(file, folder / f"run {attempt}") as rig:
                name = rig.response.name
                played = rig.play(command(rate_hz), rig.actual_rate_hz(rate_hz), part={"kind": "sine"})
        except (LinkError, RangeError) as error:
            if attempt == TRIES - 1:
                raise
            rate_hz /= 2.0 if isinstance(error, RangeError) else 1.0
            continue
        found = response(played.time_s, played.values("command"), played.stamps(name), played.values(name))
        if not found.stalled:
            break
    return found, read_recording(folder / f"run {attempt}"), rate_hz


@pytest.mark.parametrize("bench", BENCHES)
def test_response_over_a_link_is_the_direct_one(bench, tmp_path):
    with served(bench, tmp_path, *CALM, JUDGED, IDLE) as (file, _):
        found, recording, rate_hz = linked(file, tmp_path)
    name = recording.meta["roles"]["response"]
    assert abs(found.value - direct(name, rate_hz)) < found.allowed
    header = recording.meta["sampling"]
    assert header["timing"] == "polled"
    assert header["latency_s"] > 0.0
    assert header["delay_s"][name] > 0.0
    assert header["read_at"] == 0.0
    assert json.dumps(header)


def test_delay_of_a_slow_device_is_taken_out(tmp_path):
    rate_hz = 12.5
    with served("hpv41-modbus-tcp", tmp_path, *CALM, JUDGED, IDLE, quirks={"io": {"late_s": 0.02}}) as (file, _):
        found, _, rate_hz = linked(file, tmp_path, rate_hz)
    plain = direct("flow", rate_hz)
    uncorrected = found.value * np.exp(2j * np.pi * FREQUENCY_HZ * found.delay_s)
    assert found.delay_s > 0.015
    assert abs(found.value - plain) < found.allowed
    assert found.stalled or found.allowed < abs(uncorrected - plain)


def test_devices_are_served_in_a_process_of_their_own(tmp_path):
    path = tmp_path / "bench.toml"
    path.write_text(moved(answered(bench_text("hpv41-mixed", *CALM)), tmp_path), encoding="utf-8")
    with devices_of(path) as (process, told):
        daq = read_bench(path).open()
        block = played(daq, Waveform(10.0, {"command": np.full(10, 30.0)}))
        daq.close()
    assert [line.partition(" at ")[0] for line in told[:3]] == [
        "valve: canopen_valve", "meter: modbus", "module: ascii_module",
    ]  # fmt: skip
    assert told[3] == "simulated; Ctrl-C ends it" and process.returncode == 0
    assert block.inputs["supply pressure"] == pytest.approx(4.0, abs=0.5)
    assert block.inputs["spool position"][-1] > 5.0
    assert not (tmp_path / "hil-module").is_symlink()


def test_step_response_of_the_procedure_is_the_direct_one(tmp_path):
    def rise(file, folder):
        with silent_rig(file, folder, {"settings": {"band": 2.0}}) as rig:
            procedure.run(rig, levels=(0.0, 60.0), hold_s=0.9, rate_hz=100.0)
        measured = procedure.evaluate(read_recording(folder)).measured
        return next(quantity for quantity in measured if quantity.name.startswith("rise"))

    procedure = load_procedure("step_response")
    plain = rise(read_bench(benches()["brevini-hpv41"]), tmp_path / "plain")
    assert plain.std and 150.0 < plain.value < 450.0
    off = []
    with served("hpv41-modbus-tcp", tmp_path, JUDGED) as (file, _):
        for attempt in range(TRIES):  # a host that stalls, within the flank or throughout, says nothing of the link
            try:
                linked = rise(file, tmp_path / f"linked {attempt}")
            except LinkError:
                if attempt == TRIES - 1 and not off:
                    raise
                continue
            off.append(abs(linked.value - plain.value) / (3.0 * np.hypot(linked.std, plain.std) + 5.0))
            if off[-1] < 1.0:
                break
    assert min(off) < 1.0


SHORT = {**link_page.WHOLE, "frequencies": (0.5, 1.1, 1.7, 2.9, 4.1, 4.9), "measure_s": 6.0}


@pytest.mark.alone
@pytest.mark.slow
def test_frequency_response_of_the_procedure_over_a_serial_line_is_the_direct_one(tmp_path):
    plain = link_page.direct("flow", tmp_path, SHORT)
    seen = link_page.over("hpv41-modbus-rtu", tmp_path, SHORT)
    off = {name: figure.off_by(plain[name]) for name, figure in seen.corrected.items()}
    assert max(map(abs, off.values())) < 4.0, off
    # Read later than stamped, the valve seems to lag less: both figures are of the same samples, so noise cancels.
    assert seen.uncorrected["−90° bandwidth"].value > seen.corrected["−90° bandwidth"].value


def test_the_page_of_links_names_what_is_off():
    text = PAGE.read_text(encoding="utf-8").partition(f"\n## {link_page.TITLE}\n")[2]
    table, _, short = text.partition("\n### What falls short\n")
    rows = [line.strip("| ").split(" | ") for line in table.splitlines() if line.startswith("| ")]
    start = [name for name, *_ in rows].index("figure")
    links, figures = rows[start][3:], rows[start + 1 :]
    assert links == list(link_page.LINKS.values()) and len(figures) == 7
    for name, _, _, *cells in figures:
        for link, cell in zip(links, cells, strict=True):
            off = cell.partition("; ")[2].partition(" ")[0]
            named = f"{link}: {name.partition(' [')[0]} {off}" in " ".join(short.split())
            assert named == (abs(float(off)) > link_page.CLEAR), (link, name)
