"""Several devices on one serial line: one port, one after the other; twins on one pseudo terminal."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest

from drivers import modbus
from drivers._ports import serial_port
from drivers._shared_port import shared_port
from hil.daq.address import Port
from hil.daq.channel import Wiring
from hil.errors import DeviceLostError, LinkError
from sim_devices import modbus as twin
from sim_devices._quirks import Quirks
from tests.channels import inputs, outputs

ANALOGUE = {
    "summary": "two registers", "modbus": {"addresses": "wire"},
    "terminals": {
        "out": {"direction": "out", "unit": "V", "range": [0, 10], "table": "holding", "address": 0, "slope": 0.01},
        "in": {"direction": "in", "unit": "V", "range": [0, 10], "table": "input", "address": 0, "slope": 0.01},
    },
}  # fmt: skip
DRIVEN = Wiring(outputs({"u": "out"}, low=0.0), {})
READ = Wiring({}, inputs({"y": "in"}, low=0.0))


class Terminals:
    """What a twin has at its terminals."""

    def __init__(self) -> None:
        from hil.clock import RealClock

        self.clock, self.at, self.quirks = RealClock(), {"out": 0.0, "in": 2.5}, Quirks()

    def drive(self, values: dict[str, float]) -> None:
        self.at.update(values)

    def read(self) -> dict[str, float]:
        return {"in": self.at["in"]}

    def number(self, terminal: str) -> float:
        return self.at[terminal]

    def standing(self, terminal: str) -> float:
        return self.at[terminal]


@contextmanager
def line(folder: Path, **second: Any) -> Iterator[tuple[Any, Any, list[Terminals], list[Any]]]:
    """The first device is driven, the second read: (link, link, what is at their terminals, their twins)."""
    told = {"description": ANALOGUE, "transport": "rtu", "address": str(folder / "tty"), "timeout_s": 1.0,
            "longest_reply_s": 1.0}  # fmt: skip
    worlds = [Terminals(), Terminals()]
    with ExitStack() as stack:
        served = [twin.serve({**told, "unit_id": i + 1}, world, Quirks()) for i, world in enumerate(worlds)]  # type: ignore[arg-type]
        for one in served:
            stack.callback(one.close)
        first = modbus.open_link(modbus.Settings.model_validate({**told, "unit_id": 1}), DRIVEN)
        stack.callback(first.close)
        other = modbus.open_link(modbus.Settings.model_validate({**told, "unit_id": 2, **second}), READ)
        stack.callback(other.close)
        yield first, other, worlds, served


def test_two_devices_on_one_line_are_driven_and_read_in_turn(tmp_path):
    with line(tmp_path) as (first, other, worlds, _served):
        first.drive({"out": 7.0})
        assert other.read() == {"in": 2.5}
        assert first.standing() == {"out": 7.0} and worlds[0].at["out"] == 7.0 and worlds[1].at["out"] == 0.0
        first.close()
        worlds[1].at["in"] = 3.5
        assert other.read() == {"in": 3.5}  # who is left keeps the port
    assert not (tmp_path / "tty").exists()


def test_a_late_answer_of_one_is_not_taken_by_the_other(tmp_path):
    with line(tmp_path) as (first, other, _worlds, served):
        served[1].behaviour.quirks = Quirks(late_s=1.5)
        with pytest.raises(LinkError, match=r"no valid answer within 1 s"):
            other.read()
        served[1].behaviour.quirks = Quirks()
        assert first.standing() == {"out": 0.0}  # waited until the late one had passed
        assert other.read() == {"in": 2.5}


@pytest.mark.parametrize(
    ("otherwise", "said"),
    [
        ({"baud": 9600}, "baudrate 19200 on it, this one with 9600"),
        ({"parity": "E"}, "parity N on it, this one with E"),
    ],
)
def test_two_ways_to_speak_on_one_line_are_refused(tmp_path, otherwise, said):
    with pytest.raises(DeviceLostError, match=said), line(tmp_path, **otherwise):
        raise AssertionError("it was opened")


class Broken:
    """A port whose adapter was pulled."""

    baudrate = 9600
    in_waiting = 0
    is_closed = False

    def read(self, _size: int) -> bytes:
        raise OSError("gone")

    def close(self) -> None:
        self.is_closed = True


def test_a_port_that_broke_is_opened_anew_though_another_has_it_still(tmp_path):
    path, broken = str(tmp_path / "tty"), Broken()
    one, two = (shared_port(path, {"baudrate": 9600}, lambda: broken) for _ in range(2))
    assert one is two
    with pytest.raises(OSError, match="gone"):
        one.read(1)
    one.let_go()
    assert broken.is_closed
    anew = shared_port(path, {"baudrate": 9600}, Broken)
    assert anew is not two
    two.let_go()
    assert shared_port(path, {"baudrate": 9600}, Broken) is anew
    anew.let_go()
    anew.let_go()


def test_a_shorter_quiet_of_one_does_not_end_the_longer_of_another(tmp_path):
    one, other = (shared_port(str(tmp_path / "port"), {"baudrate": 9600}, Broken) for _ in range(2))
    one.quiet_until_s = 5.0
    other.quiet_until_s = 2.0
    assert one.quiet_until_s == 5.0
    other.quiet_until_s = 7.0
    assert one.quiet_until_s == 7.0
    one.let_go()
    other.let_go()


def test_what_came_before_a_request_is_not_its_answer():
    device, ours = os.openpty()
    port = serial_port(Port(os.ttyname(ours)), 1.0, 9600, "N", exclusive=None)
    try:
        os.write(device, b"+07.500\r")  # late, to an earlier request
        time.sleep(0.05)
        port.write(b"#01\r")
        assert os.read(device, 16) == b"#01\r"
        os.write(device, b"+01.000\r")
        answer, until_s = b"", time.monotonic() + 10.0
        while not answer.endswith(b"\r") and time.monotonic() < until_s:
            answer += port.read(1.0)
        assert answer == b"+01.000\r"
    finally:
        port.let_go()
        os.close(device)
        os.close(ours)
