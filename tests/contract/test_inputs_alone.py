"""A device that is opened with its inputs alone is read and left as it is: no output moves."""

from __future__ import annotations

import pytest

from hil.bench.find import benches
from hil.bench.read import BenchFile, read_bench
from hil.daq.contract import Waveform
from tests.driven import played
from tests.links import PATIENT, served
from tests.ni_board import plugged_in
from tests.recorded_line import recorded


@pytest.mark.parametrize("bench", ["hpv41-modbus-tcp", "hpv41-serial", "hpv41-canopen", "hpv41-j1939",
                                   "cummins-efc-modbus"])  # fmt: skip
def test_every_device_is_read_and_left_as_it_is(bench, tmp_path):
    with served(bench, tmp_path, *PATIENT) as (file, devices):
        driven = [_counted(device) for device in devices.values()]
        for name, device in file.devices.items():
            inputs = _inputs_of(file, name)
            if not inputs:
                continue
            daq = device.open(inputs)
            assert daq.outputs == {} and daq.levels == {}
            blocks = list(daq.play(Waveform(daq.actual_rate_hz(10.0), {}, 3)))
            assert sum(map(len, blocks)) == 3 and set(blocks[0].inputs) == set(inputs)
            daq.close()
        assert driven == [[] for _ in devices]


def _inputs_of(file: BenchFile, device: str) -> dict[str, object]:
    return {name: c for name, c in file.bench.channels.items() if c.device == device and not c.is_output}


def _counted(device: object) -> list[object]:
    """What a device is told to drive from now on, beyond its coming back to rest by itself."""
    told: list[object] = []
    drive = device.side.drive  # type: ignore[attr-defined]
    device.side.drive = lambda values: (told.append(values), drive(values))  # type: ignore[attr-defined]
    return told


def test_ni_board_too(monkeypatch):
    board = plugged_in(monkeypatch)
    file = read_bench(benches()["hpv41-usb-6211"])
    board.levels["ao0"] = 3.0
    daq = file.devices["daq"].open(_inputs_of(file, "daq"))
    blocks = list(daq.play(Waveform(1000.0, {}, 8), 4))
    assert [len(block) for block in blocks] == [4, 4] and daq.outputs == {}
    daq.close()
    assert (board.levels["ao0"], board.open) == (3.0, 0)


def test_a_simulated_device_too():
    file = read_bench(benches()["brevini-hpv41"])
    (name,) = file.devices
    daq = file.devices[name].open(_inputs_of(file, name))
    (block,) = daq.play(Waveform(100.0, {}, 50))
    assert len(block) == 50 and abs(block.inputs["flow"].mean()) < 0.5


def test_on_canopen_nothing_but_uploads_is_sent(tmp_path):
    with served("hpv41-canopen", tmp_path, *PATIENT) as (file, _):
        (name,) = (name for name, device in file.bench.devices.items() if device.driver == "canopen_valve")
        port = str(file.bench.devices[name].settings["address"]).rpartition(":")[2]
        with recorded(file, int(port)) as (through, line):
            daq = through.devices[name].open(_inputs_of(through, name))
            played(daq, Waveform(daq.actual_rate_hz(10.0), {}, 2))
            daq.close()
    assert line.can_frames
    assert all(0x600 < to < 0x680 and data[0] & 0xE0 in (0x40, 0x60) for to, data in line.can_frames)
