"""Every driver opens a device with its outputs alone, as the watchdog process does, and makes it safe."""

import numpy as np
import pytest

from drivers import ni
from hil.bench.find import benches
from hil.bench.read import read_bench
from hil.daq.contract import Waveform
from tests.contract.test_drivers import CASES
from tests.links import patient_valve, served
from tests.ni_board import plugged_in
from tests.waits import until

ONE_EACH = {CASES[case][0]: case for case in reversed(CASES) if case != "ascii inputs"}


@pytest.mark.parametrize("driver", ONE_EACH)
def test_outputs_alone_are_made_safe(driver, tmp_path):
    _, bench, changes = CASES[ONE_EACH[driver]]
    patient_valve(tmp_path)
    with served(bench, tmp_path, *changes) as (file, devices):
        outputs = {name: entry for name, entry in file.bench.channels.items() if entry.is_output}
        (name,) = {entry.device for entry in outputs.values()}
        assert file.bench.devices[name].driver == driver
        field = next(iter(devices.values())).side.field
        daq = file.devices[name].open(outputs)
        assert daq.inputs == {} and set(daq.outputs) == set(outputs)
        (channel,) = daq.outputs.values()
        half = channel.safe + 0.5 * (channel.high - channel.safe)
        rate_hz = daq.actual_rate_hz(20.0)
        for _ in daq.play(Waveform(rate_hz, {channel.name: np.full(4, half)})):
            pass
        near = 0.01 * (channel.high - channel.low)

        def arrives(at):
            """Sooner or later: on CAN nobody says when a command was obeyed."""
            until(lambda: abs(field.levels[channel.name] - at) <= near)

        arrives(half)
        daq.make_safe()
        arrives(channel.safe)
        daq.close()
        arrives(channel.safe)


def test_ni_board_too(monkeypatch):
    board = plugged_in(monkeypatch)
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
