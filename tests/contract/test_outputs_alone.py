"""Every driver opens a device with its outputs alone, as the watchdog process does, and makes it safe."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import nidaqmx
import nidaqmx.system
import numpy as np
import pytest

from drivers import ni
from hil.bench.find import benches
from hil.bench.read import read_bench
from hil.catalog import entries
from hil.daq.contract import Waveform
from tests.links import PATIENT, patient_valve, served
from tests.ni_board import Board, Device, Task

# By driver: the bench that is served for it, and how its text is changed so that the driver has the command.
BENCHES: dict[str, tuple[str, tuple[tuple[str, str], ...]]] = {
    "modbus": ("hpv41-modbus-tcp", ()),
    "ascii_module": ("hpv41-serial", ()),
    "scpi": (
        "hpv41-serial",
        (
            (('[devices.module]\ndriver = "ascii_module"\nmodel = "adam-4024"\naddress = "socket://127.0.0.1:14001"\n'
             "watchdog_s = 1.0\n\n"), ""),
            ('device = "module"\nterminal = "ao0"', 'device = "scanner"\nterminal = "dac4"'),
        ),
    ),
    "canopen_valve": ("hpv41-canopen", ()),
    "j1939_valve": ("hpv41-j1939", ()),
    "pwm_amplifier": ("cummins-efc-modbus", ()),
    "text": (
        "hpv41-serial",
        (
            (('[devices.module]\ndriver = "ascii_module"\nmodel = "adam-4024"\naddress = "socket://127.0.0.1:14001"\n'
             "watchdog_s = 1.0\n\n"),
             '[devices.module]\ndriver = "text"\nmodel = "tti-ql355"\naddress = "/tmp/supply"\n\n'),
            ('device = "module"\nterminal = "ao0"', 'device = "module"\nterminal = "voltage"'),
            ("low = -100.0", "low = 0.0"),
        ),
    ),
    "can": ("hpv41-j1939", (('driver = "j1939_valve"', 'driver = "can"\nmodel = "patient.toml"'), ("valve = 1\n", ""))),
    "canopen": (
        "hpv41-canopen",
        (
            ('driver = "canopen_valve"', 'driver = "canopen"\nmodel = "io-401"'),
            ('unit = "%"\nsafe = 0.0', 'unit = "%"\ncalibration = { slope = 10.0 }\nsafe = 0.0'),
            ('unit = "%"\nsource = "spool', 'unit = "%"\ncalibration = { slope = 12.5 }\nsource = "spool'),
            ('"set point"', '"ao1"'),
            ('"actual value"', '"ai1"'),
        ),
    ),
}  # fmt: skip


def test_every_driver_is_opened_so() -> None:
    assert {*BENCHES, "ni"} == {entry.name for entry in entries("drivers")}


@pytest.mark.parametrize("driver", BENCHES)
def test_outputs_alone_are_made_safe(driver: str, tmp_path: Path) -> None:
    bench, changes = BENCHES[driver]
    patient_valve(tmp_path)
    with served(bench, tmp_path, *changes, *PATIENT) as (file, devices):
        outputs = {name: entry for name, entry in file.bench.channels.items() if entry.is_output}
        (name,) = {entry.device for entry in outputs.values()}
        assert file.bench.devices[name].driver == driver
        field = next(iter(devices.values()))._side._field
        daq = file.devices[name].open(outputs)
        assert daq.inputs == {} and set(daq.outputs) == set(outputs)
        (channel,) = daq.outputs.values()
        half = channel.safe + 0.5 * (channel.high - channel.safe)
        rate_hz = daq.actual_rate_hz(20.0)
        for _ in daq.play(Waveform(rate_hz, {channel.name: np.full(4, half)})):
            pass
        near = 0.01 * (channel.high - channel.low)
        assert arrives(lambda: field.levels[channel.name], half, near)
        daq.make_safe()
        assert arrives(lambda: field.levels[channel.name], channel.safe, near)
        daq.close()
        assert arrives(lambda: field.levels[channel.name], channel.safe, near)


def arrives(level: Callable[[], float], at: float, near: float) -> bool:
    """Whether an output stands there, sooner or later: on CAN nobody says when a command was obeyed."""
    deadline_s = time.monotonic() + 600.0
    while abs(level() - at) > near and time.monotonic() < deadline_s:
        time.sleep(0.005)
    return abs(level() - at) <= near


def test_ni_board_too(monkeypatch: pytest.MonkeyPatch) -> None:
    board = Board()
    for kind in (Task, Device):
        monkeypatch.setattr(kind, "board", board, raising=False)
    monkeypatch.setattr(nidaqmx, "Task", Task)
    monkeypatch.setattr(nidaqmx.system, "Device", Device)
    file = read_bench(benches()["hpv41-usb-6211"])
    assert file.devices["daq"].module is ni
    daq = file.devices["daq"].open({name: entry for name, entry in file.bench.channels.items() if entry.is_output})
    assert daq.inputs == {}
    for _ in daq.play(Waveform(1000.0, {"command": np.full(4, 5.0), "enable": np.ones(4)})):
        pass
    assert (board.levels["ao0"], board.levels["port1/line0"]) == (5.0, 1.0)
    daq.make_safe()
    daq.close()
    assert (board.levels["ao0"], board.levels["port1/line0"], board.open) == (0.0, 0.0, 0)
