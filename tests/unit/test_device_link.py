"""What every device on a link goes through, tried on one that is a number in this process."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping
from contextlib import closing
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drivers.modbus import LineSettings, ModbusLink
from hil.daq.channel import Wiring
from hil.daq.contract import Waveform
from hil.daq.device_link import DeviceLink, ReadBackTimes, stands_as_driven
from hil.daq.polled import PolledDaq
from hil.errors import DeviceLostError, LinkError, SettingError
from hil.system import system
from tests.channels import inputs, outputs
from tests.driven import played
from tests.foreign_line import ForeignLine, Tables
from tests.modbus_pair import MODEL, WIRING

READS_OUTPUTS = 3
WATCHDOG_S = 0.2
CELL = Wiring(outputs({"u": "out"}), inputs({"x": "in"}))


class Unready(LinkError):
    """Of a cell that was asked to obey."""

    def __init__(self, cell: Cell) -> None:
        super().__init__(cell.fails)
        self.cell = cell


class Cell(DeviceLink):
    """A device that holds one number; it takes whole volts."""

    def __init__(self, wiring: Wiring = CELL, reads: float = 1.0, fails: str = "", **more: Any) -> None:
        self.holds, self.reads, self.fails = 0.0, reads, fails
        self.happened: list[str] = []
        super().__init__(wiring, **more)
        self._open()

    def standing(self) -> Mapping[str, float]:
        return {"out": self.holds}

    def close(self) -> None:
        self.happened.append("let go of")

    def _identified(self) -> str:
        return "cell 7"

    def _make_ready(self) -> None:
        if self.fails:
            raise Unready(self)

    def _forget(self) -> None:
        self.happened.append("forgot")

    def compared(self) -> Mapping[str, float]:
        """Read as after half a second."""
        self._checked_s = 0.0
        return self.read()

    def _put(self, values: Mapping[str, float]) -> Iterator[tuple[str, float]]:
        self.holds = float(round(values["out"]))
        self._watchdog.heard()
        yield "out", self.holds

    def _measured(self) -> Mapping[str, float]:
        if math.isinf(self.reads):
            raise self._failed("no answer")
        return {"in": self._none("in", "its wire is off") if math.isnan(self.reads) else self.reads}


def test_what_it_holds_is_what_it_was_driven_to_as_it_rounds():
    cell = Cell()
    cell.drive({"out": 2.7})
    assert cell.compared() == {"in": 1.0} and cell.identity == "cell 7"
    for elsewhere, said in ((0.0, "0 V"), (math.nan, "nan V")):
        cell.holds = elsewhere
        with pytest.raises(LinkError, match=f"out stands at {said}, not at 3 V as it was driven: the device restarted"):
            cell.compared()


def test_an_input_that_its_driver_leaves_out_is_named():
    """Also where the driver goes by the names of channels: `Wiring.inputs` has those."""
    cell = Cell(Wiring(outputs({"u": "out"}), inputs({"x": "in", "y": "beside"})))
    with pytest.raises(LinkError, match="its driver gives no reading of beside, which is in use"):
        cell.read()


def test_an_output_stands_within_what_was_driven_of_late_and_no_number_nowhere():
    assert stands_as_driven(2.0, (3.0, 1.0), 0.0) and stands_as_driven(3.4, (3.0, 1.0), 0.5)
    assert not stands_as_driven(3.6, (3.0, 1.0), 0.5) and not stands_as_driven(math.nan, (3.0,), 9.0)
    assert stands_as_driven(7.0, (), 0.0)


@pytest.fixture
def wait(monkeypatch):
    """Turns the clock of links on, by seconds; what they wait for passes at once."""
    clock = SimpleNamespace(now_s=0.0)

    def turned_on(by_s):
        clock.now_s += by_s

    monkeypatch.setattr(system, "now_s", lambda: clock.now_s)
    monkeypatch.setattr(system, "sleep", turned_on)
    return turned_on


def test_a_device_that_tells_late_is_not_suspected_and_one_that_is_pulled_at_now_and_then_is(wait):
    def pulled_at():
        for turn in range(1000):
            cell.holds = 0.0 if turn % 3 else 5.0
            cell.read()
            wait(0.01)

    cell = Cell(reports_each_s=0.02, longest_reply_s=0.3)
    cell.drive({"out": 5.0})
    cell.holds = 0.0
    cell.read()  # it may have been under way
    cell.holds = 5.0
    wait(0.5)
    assert cell.read() == {"in": 1.0}
    with pytest.raises(LinkError, match="out stands at 0 V, not at 5 V"):
        pulled_at()


def test_after_silence_nothing_is_driven_but_a_safe_value(wait):
    cell = Cell(watchdog_s=WATCHDOG_S, expires_to=0.0)
    cell.drive({"out": 5.0})
    wait(1.5 * WATCHDOG_S)
    with pytest.raises(LinkError, match=r"longer than its watchdog of 0\.2 s: the device makes its outputs safe then"):
        cell.drive({"out": 6.0})
    wait(1.5 * WATCHDOG_S)
    cell.drive({"out": 0.0})
    assert cell.holds == 0.0


class Stalling(Cell):
    """The program stands still once, between a request and its answer; what was driven afterwards."""

    stalls = ""

    def __init__(self, stalls: str) -> None:
        self.afterwards: list[float] = []
        super().__init__(watchdog_s=WATCHDOG_S, expires_to=0.0)
        self._left = stalls

    def _put(self, values: Mapping[str, float]) -> Iterator[tuple[str, float]]:
        yield from super()._put(values)
        self.afterwards += [] if self._left else [self.holds]
        self._stand_still("in driving")

    def _measured(self) -> Mapping[str, float]:
        self._stand_still("in reading")
        return super()._measured()

    def _stand_still(self, where: str) -> None:
        if self._left == where and self.holds:
            self._left = ""
            time.sleep(1.5 * WATCHDOG_S)


@pytest.mark.parametrize("where", ["in driving", "in reading"])
def test_a_program_that_stood_still_drives_nothing_on(where):
    cell = Stalling(where)
    with closing(PolledDaq({"cell": cell}, {"cell": CELL})) as daq:
        for _ in range(2):  # also who comes later, until outputs are safe
            with pytest.raises(LinkError, match="longer than its watchdog"):
                played(daq, Waveform(20.0, {"u": np.full(20, 5.0)}))
        daq.make_safe()
    assert set(cell.afterwards) == {0.0}


def test_an_input_without_a_measurement_is_told_and_refused_where_it_never_had_one():
    with pytest.raises(LinkError, match="in reads no measurement from the first on: its wire is off"):
        Cell(reads=math.nan).read()
    cell = Cell()
    cell.read()
    cell.reads = math.nan
    assert math.isnan(cell.read()["in"]) and cell.invalid_reasons == {"in": "its wire is off"}


def test_what_is_opened_is_the_device_that_is_meant_and_can_be_made_safe():
    with pytest.raises(SettingError, match="puts out at 1 V, but 'u' is safe at 0 V; take watchdog_s away"):
        Cell(watchdog_s=1.0, expires_to=1.0)
    with pytest.raises(DeviceLostError, match="another device answers: it says that it is cell 7"):
        Cell(Wiring(CELL.outputs, {}, known_as="cell 8"))
    with pytest.raises(Unready, match="it does not obey") as raised:
        Cell(fails="it does not obey")
    assert raised.value.cell.happened == ["let go of"]
    assert Cell(Wiring(CELL.outputs, {}, only_safe=True), fails="it does not obey").happened == []


@pytest.mark.usefixtures("wait")
def test_after_an_answer_that_did_not_come_what_is_late_passes_first():
    cell = Cell(longest_reply_s=2.0)
    cell.reads = math.inf
    with pytest.raises(LinkError, match="no answer"):
        cell.read()
    cell.reads = 2.0
    assert cell.read() == {"in": 2.0}
    assert cell.happened == ["forgot"]
    cell.read()
    assert cell.happened == ["forgot"]


def test_readings_come_after_one_slow_answer_and_not_after_two(monkeypatch):
    """By the clock of the device, which answers slowly twice: however slow this computer is."""
    device, clock = Tables(inputs={0: 20}, holding={8: 0}), SimpleNamespace(now_s=0.0, answer_s=0.0)
    monkeypatch.setattr(system, "now_s", lambda: clock.now_s)

    def answer(frame):
        clock.now_s += clock.answer_s
        return device.on_tcp(frame)

    with ForeignLine(answer) as line:
        link = ModbusLink(LineSettings(address=f"127.0.0.1:{line.port}"), WIRING, MODEL)
        link.drive({"q": 5.0})
        asked = []
        for answer_s, since_s in ((0.0, 0.6), (0.06, 0.6), (0.06, 2.1), (0.0, 0.6)):
            clock.answer_s, clock.now_s = answer_s, clock.now_s + since_s
            before = len(line.heard)
            assert link.read() == {"t": 20.0}
            asked.append(READS_OUTPUTS in [frame[7] for _, frame in line.heard[before:]])
        link.close()
    assert asked == [True, False, True, True]


@pytest.mark.parametrize("usual_s", [0.0005, 0.004, 0.1])
@pytest.mark.usefixtures("wait")
def test_a_line_that_was_always_that_slow_is_asked_twice_a_second(usual_s):
    times = ReadBackTimes()
    for _ in range(3):
        times.took(usual_s)
        assert times.is_due(-0.55) and not times.is_due(-0.45)
    times.took(max(5.0 * usual_s, 0.02))
    assert not times.is_due(-1.5) and times.is_due(-2.05)
