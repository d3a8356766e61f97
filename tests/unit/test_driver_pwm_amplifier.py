"""The PWM current amplifier and its twin: what is set, restart, watchdog, faults, and a coil measured over it."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from drivers import pwm_amplifier
from hil.clock import VirtualClock
from hil.daq.channel import OutputChannel, Pwm, Wiring
from hil.errors import LinkError, SettingError
from hil.record.read import read_recording
from hil.session.procedure import load_procedure
from sim_devices._field import Field, Side
from sim_devices._modbus_described import DescribedBank
from sim_devices._modbus_frames import Refused
from sim_devices._modbus_table import serve_registers
from sim_devices._quirks import Quirks
from sim_devices._simulation import Simulation
from sim_devices._twin import described_in
from tests.channels import inputs
from tests.links import PATIENT, opened, served
from tests.waits import until

OUT = OutputChannel("current", "current", "pwm_current", "A", 0.0, 3.0, pwm=Pwm(1000.0, 125.0, 0.02))
WIRING = Wiring(
    {"current": OUT}, inputs(["coil current"], "A", 0.0, 3.3) | inputs(["coil voltage"], low=0.0, high=36.0)
)
SIMULATION = Simulation.model_validate({
    "plant": "efc-drive",
    "instruments": {
        "current": {"direction": "out", "signal": "current", "unit": "A"},
        "coil current": {"signal": "current", "unit": "A"}, "coil voltage": {"signal": "coil voltage", "unit": "V"},
    },
})  # fmt: skip


class Amplifier(DescribedBank):
    """The described amplifier, which may have other faults too, one bit each."""

    status = 0

    def __init__(self, terminals: Side) -> None:
        super().__init__(terminals, described_in({"model": "pwm-amplifier"}, "modbus"), {})

    def input(self, address: int) -> int:
        return super().input(address) | (self.status if address == 2 else 0)


def side(clock: VirtualClock | None = None) -> Side:
    return Field(SIMULATION, {"amplifier": WIRING}, clock).side("amplifier")


@contextmanager
def linked(channel: OutputChannel = OUT, **settings: Any) -> Iterator[tuple[Any, Amplifier]]:
    """A driver's link to a served twin."""
    terminals = side()
    told = {"timeout_s": 1.0, "longest_reply_s": 1.0, "watchdog_s": 60.0, "address": "127.0.0.1:0", **settings}
    amplifier = Amplifier(terminals)
    with closing(serve_registers(amplifier, told, terminals, Quirks())) as server:
        checked = pwm_amplifier.Settings.model_validate({**told, "address": server.where})
        with closing(pwm_amplifier.open_link(checked, replace(WIRING, outputs={"current": channel}))) as link:
            yield link, amplifier


def test_current_carrier_and_dither_are_what_the_bench_says():
    with linked() as (link, amplifier):
        link.drive({"current": 1.2344})
        assert [amplifier.holding(address) for address in range(5)] == [1234, 1000, 1250, 20, 600]
        assert amplifier.side.standing("current") == pytest.approx(1.234)
        stands = {"current": 1.234, "carrier": 1000.0, "dither": 125.0, "peak of the dither": 0.02}
        assert link.standing() == pytest.approx(stands)


def test_without_dither_there_is_none():
    with linked(replace(OUT, pwm=Pwm(400.0))) as (_, amplifier):
        assert [amplifier.holding(address) for address in (1, 2, 3)] == [400, 100, 0]


def test_dither_moves_the_coil_only_once_it_is_set():
    clock = VirtualClock()
    terminals = side(clock)
    amplifier = Amplifier(terminals)
    amplifier.write(0, 1500)

    def swing():
        clock.now_s += 0.5
        readings = []
        for _ in range(40):
            clock.now_s += 0.001
            readings.append(terminals.number("coil current"))
        return float(np.ptp(readings))

    assert swing() < 1e-3
    for address, count in ((2, 1250), (3, 20)):
        amplifier.write(address, count)
    assert swing() == pytest.approx(0.04, rel=0.2)
    amplifier.restart()
    amplifier.write(0, 1500)
    assert swing() < 1e-3


@pytest.mark.parametrize(
    ("pwm", "text"),
    [
        (Pwm(20_000.0), r"'current': pwm.carrier_hz = 20000 Hz; the amplifier makes 100 … 5000 Hz"),
        (Pwm(1000.0, 5.0, 0.1), r"pwm.dither_hz = 5 Hz; the amplifier makes 10 … 500 Hz"),
        (Pwm(1000.0, 100.0, 0.7), r"pwm.dither_amplitude = 0.7 A; the amplifier makes 0 … 0.5 A"),
    ],
)
def test_what_it_does_not_make_is_refused_before_it_is_connected(pwm, text):
    settings = pwm_amplifier.Settings(address="127.0.0.1:1")
    with pytest.raises(SettingError, match=text):
        pwm_amplifier.open_link(settings, replace(WIRING, outputs={"current": replace(OUT, pwm=pwm)}))


@pytest.mark.parametrize(
    ("status", "text"),
    [
        (0b0010, "^the device reports a fault: the coil is open$"),
        (0b1100, "^the device reports a fault: the coil is shorted, it is too hot$"),
        (0x10, "^the device reports a fault: a fault that its description does not name$"),
        (None, "carrier stands at 100 Hz, not at 1000 Hz as it was driven"),  # it restarts
    ],
)
def test_faults_that_it_reports_and_a_restart_are_errors(status, text):
    with linked() as (link, amplifier):
        link.drive({"current": 0.0})
        if status is None:
            amplifier.restart()
        else:
            amplifier.status = status
        with pytest.raises(LinkError, match=text):
            _read_until_looked_at(link)


def _read_until_looked_at(link: Any) -> None:
    until(lambda: link.read() is None)


def test_expired_watchdog_lets_no_current_through_until_it_is_set_anew():
    clock = VirtualClock()
    amplifier = Amplifier(side(clock))
    amplifier.heard()
    amplifier.write(4, 3)
    amplifier.write(0, 1500)
    clock.now_s += 0.29
    amplifier.tick()
    assert amplifier.side.standing("current") == 1.5
    clock.now_s += 0.02
    amplifier.tick()
    assert amplifier.side.standing("current") == 0.0 and amplifier.input(2) == 0b0001
    amplifier.write(0, 1500)
    assert amplifier.side.standing("current") == 0.0
    amplifier.write(4, 3)
    amplifier.write(0, 1500)
    assert amplifier.side.standing("current") == 1.5 and amplifier.input(2) == 0


@pytest.mark.parametrize(
    ("address", "count", "code"), [(0, 3001, 3), (1, 99, 3), (1, 5001, 3), (2, 5001, 3), (3, 501, 3), (5, 0, 2)]
)
def test_twin_refuses_what_is_out_of_range(address, count, code):
    amplifier = Amplifier(side(VirtualClock()))
    with pytest.raises(Refused) as refused:
        amplifier.may_write(address, count)
    assert refused.value.code == code


def test_driver_after_the_watchdog_expired_drives_again_when_it_is_opened_anew():
    with linked(watchdog_s=1.0) as (link, amplifier):
        link.drive({"current": 1.0})
        until(lambda: amplifier.side.standing("current") == 0.0)
        time.sleep(0.1)
        with pytest.raises(LinkError, match="longer than its watchdog"):
            link.read()
        link.drive({"current": 0.0})  # what is safe is always taken
        link.drive({"current": 1.0})
        with pytest.raises(LinkError, match="its watchdog expired"):
            _read_until_looked_at(link)
        assert amplifier.side.standing("current") == 0.0
    with linked() as (link, amplifier):
        link.drive({"current": 1.0})
        assert amplifier.side.standing("current") == 1.0


def test_coil_of_an_efc_is_measured_over_the_link(tmp_path):
    procedure = load_procedure("electrical_check")
    with served("cummins-efc-modbus", tmp_path, *PATIENT) as (file, _):
        settings = {"repeats": 2, "hold_s": 0.4}
        with opened(file, tmp_path / "run", {"settings": settings}) as rig:
            procedure.run(rig, **settings)
        measured = procedure.evaluate(read_recording(tmp_path / "run")).measured
    resistance = next(quantity for quantity in measured if quantity.name.startswith("coil_resistance"))
    assert resistance.std is not None
    assert abs(resistance.value - 2.1) < 3.0 * resistance.std + 0.03
