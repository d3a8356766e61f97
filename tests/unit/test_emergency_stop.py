"""The hardware's own stop has a witness: its contact ends the run, stands in the record, tells a person from a link."""

from __future__ import annotations

import json
import re
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
import pytest

import hil
from hil.bench.fault import BenchError
from hil.bench.file import EMERGENCY_STOP
from hil.bench.find import benches
from hil.bench.protection import emergency_stops
from hil.bench.read import read_bench
from hil.bench.rehearsal import twin_of
from hil.clock import VirtualClock
from hil.daq.calibration import Calibration
from hil.daq.channel import Wiring
from hil.daq.contract import Block, Waveform
from hil.daq.polled import PolledDaq
from hil.daq.scaled import Scaled
from hil.errors import LinkError, TrippedError, with_notes
from hil.record.folder import read
from hil.safety.guard import Guard
from hil.safety.interlock import Band, Interlock, Watch
from hil.safety.protection import Protection
from tests.channels import inputs, outputs
from tests.driven import played
from tests.links import served

pytestmark = pytest.mark.usefixtures("unprinted")

DOCS = Path(__file__).parents[2] / "docs"
CONTACT = '[channels."emergency stop"]\ndevice = "{device}"\nterminal = "{terminal}"\nrole = "emergency stop"\n{more}\n'
PRESSED = '[simulation.instruments."emergency stop"]\nvalue = 8.0\npressed_s = {at}\n'


def bench(folder: Path, base: str, *, device: str = "daq", terminal: str = "ai6", more: str = "pressed_below = 5.0",
          pressed: float | None = None) -> Path:  # fmt: skip
    text = f'based_on = "{base}"\n' + CONTACT.format(device=device, terminal=terminal, more=more)
    path = folder / "bench.toml"
    path.write_text(text + ("" if pressed is None else PRESSED.format(at=pressed)), encoding="utf-8")
    return path


def judged(*readings: float, why: str = "") -> str:
    lock = Interlock("stop", "trip", Band("stop", low=0.5), is_emergency_stop=True)
    values, time_s = np.array(readings), 0.1 * np.arange(len(readings))
    block = Block(time_s, {"stop": values}, {}, invalid_reasons={"stop": why} if why else {})
    found = Watch(lock).judge(block)
    return "" if found is None else found.text


def test_a_person_is_told_from_a_link():
    assert judged(1.0, 1.0) == ""
    assert judged(1.0, 0.0) == "emergency stop 'stop': pressed at 0.100 s (its contact is open, 0)"
    assert judged(np.inf, np.inf) == "", "a closed contact may read the upper end of its range"
    assert "pressed at 0.100 s" in judged(np.inf, -np.inf)
    assert judged(1.0, np.nan, why="no answer").endswith(
        "could not be read at 0.100 s (no answer): the link died, nobody is known to have pressed"
    )


def test_a_pressed_stop_ends_a_simulated_run_and_stands_in_its_record(tmp_path, command_line):
    out = tmp_path / "run"
    bench_file = bench(tmp_path, "brevini-hpv41", pressed=3.0)
    ended = command_line("run", "step_response", "--bench", bench_file, "--out", out)
    said = "emergency stop 'emergency stop': pressed at 3.0"
    assert ended.status == 3 and said in ended.err
    recording = read(out)
    assert said in str(recording.meta["outcome"])
    assert any(event["event"] == "trip" and said in str(event["details"]) for event in recording.meta["events"])
    assert recording.values("emergency stop")[-1] < 5.0 < recording.values("emergency stop")[0]
    assert recording.meta["roles"][EMERGENCY_STOP] == "emergency stop"
    end = json.loads((out / "end.json").read_text(encoding="utf-8"))
    assert "safe" in str(end)


def test_a_stop_that_nobody_presses_lets_a_run_pass_and_a_rehearsal_too(tmp_path):
    file = read_bench(bench(tmp_path, "hpv41-modbus-tcp", device="io", terminal="ai3"))
    daq = twin_of(file).open()
    (block,) = daq.play(Waveform(100.0, {"command": np.zeros(5)}))
    daq.close()
    assert np.all(block.inputs["emergency stop"] > 5.0)


def test_the_twin_of_a_link_presses_it(tmp_path, monkeypatch):
    monkeypatch.setenv("HIL_STATE_DIR", str(tmp_path / "state"))  # no other test of this bench finds the trip
    contact = CONTACT.format(device="io", terminal="ai3", more="pressed_below = 5.0")
    changes = (
        ("[interlocks.over-pressure]", f"{contact}[interlocks.over-pressure]"),
        ("flow = { noise = 0.3 }", 'flow = { noise = 0.3 }\n"emergency stop" = { value = 8.0, pressed_s = 4.0 }'),
    )
    with served("hpv41-modbus-tcp", tmp_path, *changes) as (file, _), pytest.raises(TrippedError) as raised:
        hil.run("step_response", file.path, tmp_path / "run", levels=(0, 20), hold_s=60.0)
    assert "emergency stop 'emergency stop': pressed at " in str(raised.value)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ("safe = 0.0\npressed_below = 5.0", "an emergency stop is an input, without a safe value"),
        ("", "is no digital line: say pressed_below = …, in V, halfway"),
        ("pressed_below = 20.0", "20 V is not within what 'emergency stop' reads, -10 … 10 V"),
    ],
)
def test_a_contact_that_cannot_be_told_open_is_a_fault(tmp_path, more, said):
    with pytest.raises(BenchError) as raised:
        read_bench(bench(tmp_path, "brevini-hpv41", more=more))
    assert any(said in fault for fault in raised.value.faults)


def test_check_knows_the_role(tmp_path, command_line):
    status, with_notes, _ = command_line("check", bench(tmp_path, "brevini-hpv41"))
    assert status == 0
    assert "emergency stop (emergency stop): -10 … 10 V" in with_notes
    assert "trip     emergency stop: pressed below 5" in with_notes


def test_the_documented_bench_has_one(tmp_path):
    page = (DOCS / "explanation" / "safety.md").read_text(encoding="utf-8")
    (text,) = [block for block in re.findall(r"^```toml\n(.*?)^```", page, re.M | re.S) if "emergency stop" in block]
    (tmp_path / "bench.toml").write_text(text, encoding="utf-8")
    file = read_bench(tmp_path / "bench.toml")
    assert [lock.name for lock in emergency_stops(file.bench)] == ["emergency stop"]
    assert file.bench.name == read_bench(benches()["hpv41-modbus-tcp"]).bench.name


class Powered:
    """A device with one line each way, on a supply that a stop may cut."""

    watchdog_s = keep_alive_s = None

    def __init__(self, reads: float) -> None:
        self.reads, self.value, self.has_power, self.left = reads, 0.0, True, 10**9
        self.presses: list[Powered] = []

    def standing(self) -> dict[str, float]:
        return {"out": self.value}

    def drive(self, values: dict[str, float]) -> None:
        self._answer()
        self.value = values.get("out", self.value)

    def read(self) -> dict[str, float]:
        self._answer()
        return {"in": self.reads}

    def close(self) -> None:
        pass

    def _answer(self) -> None:
        self.left -= 1
        if not self.left:
            self.has_power = False
            for contact in self.presses:
                contact.reads = 0.0
        if not self.has_power:
            raise LinkError("no answer within 0.2 s")


@pytest.mark.parametrize(
    ("presses", "contact_lives", "kind", "says"),
    [
        (True, True, TrippedError, "emergency stop 'stop': pressed at {s} s (its contact is open, 0)*; io: no answer*"),
        (False, True, LinkError, "io: no answer*; emergency stop 'stop': nobody pressed (its contact is closed)*"),
        (False, False, LinkError, "io: no answer*; emergency stop 'stop': its contact could not be read (door: *"),
    ],
)
def test_a_stop_that_cuts_off_the_device_read_first_is_told_from_its_dead_link(presses, contact_lives, kind, says):
    clock = VirtualClock()
    io, door = Powered(5.0), Powered(8.0)
    wirings = {
        "io": Wiring(outputs({"command": "out"}), {}),
        "door": Wiring({}, inputs({"stop": "in"})),
    }
    daq = PolledDaq({"io": io, "door": door}, wirings, clock)
    lock = Interlock("stop", "trip", Band("stop", low=5.0), is_emergency_stop=True)
    events = []
    guard = Guard(
        Scaled(daq, dict.fromkeys(("command", "stop"), Calibration("V"))), Protection(100.0, interlocks=(lock,)),
        clock=clock, note=lambda event, **_: events.append(event),
    )  # fmt: skip
    guard.ready()
    io.left, io.presses = 5, [door] if presses else []
    door.left = 10**9 if contact_lives else 3
    with pytest.raises(kind) as raised:
        played(guard, Waveform(100.0, {"command": np.ones(20)}))
    assert fnmatch(with_notes(raised.value), says.format(s="*"))
    assert guard.latch.trips.keys() == ({"stop"} if presses else set())
    assert events == (["trip"] if presses else [])
    with pytest.raises(kind):
        guard.ready()
