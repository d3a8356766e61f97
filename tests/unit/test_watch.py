"""`hil watch`: the words for a reading, and that looking at a bench writes nothing to its devices."""

from __future__ import annotations

import csv
import json
import math
import struct
from collections.abc import Callable, Generator, Iterable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hil.bench.find import benches
from hil.bench.manual.inputs import inputs_of
from hil.bench.manual.reading import Followed
from hil.bench.read import read_bench
from hil.errors import LinkError, SettingError
from sim_devices._quirks import Quirks
from tests.bench_files import bench_file
from tests.described import bench, input_, output, written
from tests.foreign_line import ForeignLine, ended, tcp_frame
from tests.links import PATIENT, served
from tests.recorded_line import recorded


def _state(raw: Iterable[float], folder: Path, channel: str = "flow", **more: Any) -> str:
    path = bench_file(folder / "bench.toml", "brevini-hpv41", channels={channel: more})
    followed = Followed(channel, read_bench(path))
    values = np.array(list(raw))
    followed.take(np.arange(len(values)) * 0.1, values)
    return followed.reading(0.0).state


def test_readings_in_words(tmp_path):
    assert _state([1.0, 1.1, 1.0], tmp_path) == "ok"
    assert _state([1.0, 1.1, math.nan], tmp_path) == "no measurement"
    assert _state([1.0, 11.0], tmp_path).startswith("over-range: at the upper end")
    assert _state([1.0] * 80, tmp_path).startswith("frozen: unchanged for 7.9 s")
    assert _state([1.0] * 80 + [1.1], tmp_path) == "ok"


def test_a_live_zero_tells_a_broken_wire(tmp_path):
    live = {"slope": 31.25, "offset": -62.5}
    broken = _state([1.7, 1.71], tmp_path, "supply pressure", calibration=live)
    assert broken.startswith("open wire: below 1.8 V")
    assert _state([1.9, 1.91], tmp_path, "supply pressure", calibration=live) == "ok"


def test_a_bench_is_looked_at_and_nothing_is_written(tmp_path):
    with served("hpv41-modbus-tcp", tmp_path, *PATIENT) as (file, devices):
        (device,) = devices.values()
        with recorded(file, device.port) as (through, line), inputs_of(through) as looked:
            for _ in range(3):
                readings = looked.look(0.2)
        assert {reading.state for reading in readings} == {"ok"}, readings
        assert line.modbus_functions <= {3, 4, 43} and 4 in line.modbus_functions
        assert device.side.field.levels["command"] == 0.0


def test_a_device_that_does_not_answer_is_stale_and_then_back(tmp_path):
    with served("hpv41-modbus-tcp", tmp_path, *PATIENT) as (file, devices):
        (device,) = devices.values()
        with inputs_of(file, ["flow"]) as looked:
            looked.look(0.2)
            device.behaviour.quirks = Quirks(silent=True)
            states = (looked.look(0.2)[0].state for _ in range(100))
            assert next(state for state in states if "no valid answer" in state).startswith("stale: ")
            assert list(looked.failures) == [*file.devices]
            device.behaviour.quirks = Quirks()
            assert any(looked.look(0.3)[0].state == "ok" for _ in range(100))
            assert not looked.failures


_MODULE = """\
protocol = "modbus"
summary = "two inputs"
[modbus]
addresses = "wire"
[terminals."in{n}"]
count = 2
direction = "in"
unit = "V"
range = [0, 10]
table = "input"
address = 0
slope = 0.001
invalid = { "0x8000" = "open wire", "0x8001" = "sensor fault" }
[terminals.command]
direction = "out"
unit = "V"
range = [-10, 10]
table = "holding"
address = 0
type = "s16"
slope = 0.001
"""
_METER = """\
protocol = "scpi"
summary = "two inputs"
[terminals."in{n}"]
count = 2
direction = "in"
unit = "V"
range = [0, 10]
ask = "READ{n}?"
[terminals.command]
direction = "out"
unit = "V"
range = [-10, 10]
tell = "SOUR {value:.3f}"
"""


def _looked_at(folder: Path, description: str, device: str, answer: Callable[[bytes], bytes]) -> Generator[list[str]]:
    """The states of both inputs, look by look."""
    written(folder, "two.toml", description)
    with ForeignLine(answer, tcp_frame if "modbus" in description else ended(b"\n")) as line:
        entry = device.format(line.port)
        channels = (
            output("command", "command", role="command")
            + input_("flow", "in0", role="response")
            + input_("pressure", "in1")
        )
        path = written(folder, "bench.toml", bench(f'{entry}\nmodel = "two.toml"', channels, "flow"))
        with inputs_of(read_bench(path), ["flow", "pressure"]) as looked:
            while True:
                states = [reading.state for reading in looked.look(0.06)]
                if not any("no sample yet" in state for state in states):
                    yield states


def test_words_of_a_count_are_those_of_now_from_the_first_look_on(tmp_path):
    counts = [5000, 0x8000]

    def answer(came):
        counts[0] ^= 1
        if came[7] == 43:
            return came[:4] + struct.pack(">HBBB", 3, came[6], 43 | 0x80, 1)
        return came[:4] + struct.pack(">HBBBHH", 7, came[6], 4, 4, *counts)

    entry = 'driver = "modbus"\naddress = "127.0.0.1:{}"'
    with closing(_looked_at(tmp_path, _MODULE, entry, answer)) as states:
        assert next(states) == ["ok", "no measurement: open wire"]
        counts[1] = 4000
        assert next(states) == ["ok", "ok"]
        counts[1] = 0x8001
        assert next(states) == ["ok", "no measurement: sensor fault"]


def test_words_of_an_answer_are_those_of_now(tmp_path):
    said = ["1.5", "9.91E37"]

    def answer(came):
        text = came.decode()
        if "*IDN" in text:
            return b'A,B,1,1;0,"No error"\n' if "SYST" in text else b"A,B,1,1\n"
        return f'{said[0]};{said[1]};0,"No error"\n'.encode() if "READ" in text else b'0,"No error"\n'

    entry = 'driver = "scpi"\naddress = "socket://127.0.0.1:{}"'
    with closing(_looked_at(tmp_path, _METER, entry, answer)) as states:
        assert next(states) == ["ok", "no measurement: the instrument answers 9.91E37"]
        said[1] = "-9.9E37"
        assert next(states) == ["ok", "over-range: at the lower end"]
        said[:] = "NAN", "2.0"
        assert next(states) == ["no measurement: the instrument answers NAN", "ok"]


def test_what_cannot_be_looked_at():
    file = read_bench(benches()["brevini-hpv41"])
    with pytest.raises(SettingError, match="is an output"), inputs_of(file, ["command"]):
        pass


def test_command_line(tmp_path, command_line):
    out = tmp_path / "rows.csv"
    found = command_line("watch", "brevini-hpv41", "--seconds", "1", "--json", "--csv", out)
    told = json.loads(found.out)
    assert found.status == 0 and told["schema"] == "hil.watch/1"
    assert {c["name"]: c["state"] for c in told["channels"]}["flow"] == "ok"
    rows = list(csv.reader(out.read_text(encoding="utf-8").splitlines()))
    assert rows[0][:2] == ["time [s]", "flow [l/min]"] and len(rows) == 3
    nobody = bench_file(tmp_path / "nobody.toml", "hpv41-modbus-tcp", devices={"io": {"address": "127.0.0.1:1"}})
    found = command_line("watch", nobody, "--seconds", "0.5")
    assert found.status == LinkError.exit_status and "no measurement: io: 127.0.0.1:1" in found.out
