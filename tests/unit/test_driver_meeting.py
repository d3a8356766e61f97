"""Another device that answers on a new connection is written nothing; one that hangs up at rest is met again."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import can
import pytest

from drivers import ascii_module, scpi, text
from drivers._can import gone
from drivers.modbus import LineSettings, ModbusLink
from hil.daq.channel import Wiring
from hil.daq.link import Link
from hil.daq.polled import PolledDaq
from hil.errors import DeviceLostError, HardwareError, LinkError
from tests.channels import outputs
from tests.described import written
from tests.foreign_line import ForeignLine, Tables, ended, serial_frame, tcp_frame
from tests.modbus_pair import MODEL
from tests.modbus_pair import WIRING as PAIR
from tests.waits import until

CALM = {"timeout_s": 1.0, "longest_reply_s": 1.0}
SUPPLY = """\
protocol = "text"
summary = "one output"
[text]
hello = "WHO?"
identity = "{any}"
[terminals.out]
direction = "out"
unit = "V"
range = [0, 10]
tell = "SET {value:.3f}"
reply = "OK"
ask = "SET?"
answer = "{value}"
"""


@dataclass
class Place:
    """A device that answers at a place, and which one it is.

    Attributes:
        who: it is.
        at: where its output was put last; writes: how often.
    """

    who: str = "one"
    at: float = 0.0
    writes: int = 0

    def put(self, value: float) -> None:
        self.at, self.writes = value, self.writes + 1

    def instrument(self, came: bytes) -> bytes:
        """SCPI."""
        answers = []
        for unit in came.decode().strip().split(";"):
            header, _, value = unit.lstrip(":").partition(" ")
            if header == "SOUR:CURR":
                self.put(float(value))
            told = {"*IDN?": f"Maker,DC-1,{self.who},1.0", "SOUR:CURR?": f"{self.at:.5f}",
                    "SYST:ERR?": '+0,"No error"'}  # fmt: skip
            answers += [told[header]] if header in told else []
        return (";".join(answers) + "\n").encode() if answers else b""

    def module(self, came: bytes) -> bytes:
        """An ASCII module; another one is of another kind."""
        request = came.decode().strip()
        if request.startswith("#01C"):
            self.put(float(request[5:]))
        kind = "4024" if self.who == "one" else "4021"
        answers = {"#01C0": "!01", "$016C": f"!01{self.at:+07.3f}", "$01M": f"!01{kind}", "$018C": "!01C032"}
        return f"{answers.get(request[:5], answers.get(request[:4], '?01'))}\r".encode()

    def supply(self, came: bytes) -> bytes:
        """Lines of text."""
        request = came.decode().strip()
        if request.startswith("SET "):
            self.put(float(request[4:]))
            return b"OK\n"
        return f"{self.who if request == 'WHO?' else self.at}\n".encode()

    def coupler(self, frame: bytes) -> bytes:
        """Modbus TCP."""
        return self._tables(frame[7], lambda tables: tables.on_tcp(frame))

    def coupler_on_serial(self, frame: bytes) -> bytes:
        """Modbus RTU."""
        return self._tables(frame[1], lambda tables: tables.on_serial(frame))

    def _tables(self, function: int, asked: Callable[[Tables], bytes]) -> bytes:
        tables = Tables(holding={8: round(self.at)}, inputs={0: 20}, identity=self.who)
        answer = asked(tables)
        if function in (6, 16):
            self.put(float(tables.holding[8]))
        return answer


def output(name: str, unit: str, high: float) -> Wiring:
    return Wiring(outputs([name], unit, 0.0, high), {})


@dataclass(frozen=True)
class Carrier:
    """How a link of some kind is opened at a port, and the output on it."""

    answer: Callable[[Place], Callable[[bytes], bytes]]
    whole: Callable[[bytes], int]
    opened: Callable[[int, Path], Link]
    wiring: Wiring

    @property
    def name(self) -> str:
        return next(iter(self.wiring.outputs))


AO0, OUT = output("ao0", "V", 10.0), output("out", "V", 10.0)
COIL, Q = output("current", "A", 3.0), Wiring(PAIR.outputs, {})


def at(port: int, driver: Any, wiring: Wiring, **more: object) -> Any:
    settings = driver.Settings.model_validate({"address": f"socket://127.0.0.1:{port}", **CALM, **more})
    return driver.open_link(settings, wiring)


def coupler_at(port: int, _folder: Path) -> Link:
    return ModbusLink(LineSettings.model_validate({"address": f"127.0.0.1:{port}", **CALM}), Q, MODEL)


def coupler_on_serial_at(port: int, _folder: Path) -> Link:
    told = {"address": f"socket://127.0.0.1:{port}", "transport": "rtu", **CALM}
    return ModbusLink(LineSettings.model_validate(told), Q, MODEL)


def supply_at(port: int, folder: Path) -> Link:
    link: Link = at(port, text, OUT, model=str(written(folder, "supply.toml", SUPPLY)))
    return link


CARRIERS: Mapping[str, Carrier] = {
    "modbus": Carrier(lambda place: place.coupler, tcp_frame, coupler_at, Q),
    "modbus on a serial line": Carrier(
        lambda place: place.coupler_on_serial, serial_frame, coupler_on_serial_at, Q
    ),
    "scpi": Carrier(
        lambda place: place.instrument, ended(b"\n"),
        lambda port, _: at(port, scpi, COIL, model="dc-source"), COIL,
    ),
    "text": Carrier(lambda place: place.supply, ended(b"\n"), supply_at, OUT),
    "ascii": Carrier(
        lambda place: place.module, ended(b"\r"),
        lambda port, _: at(port, ascii_module, AO0, model="adam-4024"), AO0,
    ),
}  # fmt: skip


@contextmanager
def stood(carrier: Carrier, folder: Path) -> Iterator[tuple[Place, ForeignLine, Any, PolledDaq]]:
    """A device, its line, the link to it, and the DAQ of that."""
    place = Place()
    with ForeignLine(carrier.answer(place), carrier.whole) as line:
        link = carrier.opened(line.port, folder)
        daq = PolledDaq({"device": link}, {"device": carrier.wiring})
        try:
            yield place, line, link, daq
        finally:
            with suppress(HardwareError):
                daq.close()


@pytest.mark.parametrize("carrier", CARRIERS.values(), ids=CARRIERS)
def test_another_device_on_a_new_connection_is_written_nothing(carrier, tmp_path):
    with stood(carrier, tmp_path) as (place, line, link, daq):
        link.drive({carrier.name: 1.0})
        assert place.at == 1.0
        place.who, written_before = "another", place.writes
        hang_up(line, link)
        for _ in range(3):
            with pytest.raises(DeviceLostError):
                daq.make_safe()
            answer = daq.read_back()[carrier.name]
            assert answer.at is None and "another device answers" in answer.why
        assert (place.at, place.writes) == (1.0, written_before)
        place.who = "one"  # it is back
        daq.make_safe()
        assert place.at == 0.0 and daq.read_back()[carrier.name].at == 0.0


@pytest.mark.parametrize("carrier", CARRIERS.values(), ids=CARRIERS)
def test_a_device_that_hangs_up_at_rest_is_connected_again(carrier, tmp_path):
    with stood(carrier, tmp_path) as (place, line, link, _):
        hang_up(line, link)
        link.renew()
        link.drive({carrier.name: 1.0})
        assert place.at == 1.0
        link.drive({carrier.name: 0.0})
        place.who = "another"
        hang_up(line, link)
        with pytest.raises(HardwareError, match="another device answers"):
            link.renew()


def hang_up(line: ForeignLine, link: Any) -> None:
    """Every connection is closed, and the link can know."""
    line.reset()
    until(lambda: link.line.is_hung_up)


def test_a_question_that_a_module_leaves_unanswered_keeps_no_safe_value_waiting():
    place = Place(at=5.0)

    def answer(came):
        return b"" if came.startswith(b"$018C") else place.module(came)

    with ForeignLine(answer, ended(b"\r")) as line:
        wiring = Wiring(AO0.outputs, {}, only_safe=True)
        link = at(line.port, ascii_module, wiring, model="adam-4024")
        link.drive({"ao0": 0.0})
        assert place.at == 0.0 and not any(request.startswith(b"$018C") for _, request in line.heard)
        link.close()


@pytest.mark.parametrize("known_as", ["one", ""])
def test_who_hangs_up_when_it_is_asked_who_it_is_is_written_nothing_where_that_matters(known_as):
    place, asked = Place(who="another", at=5.0), []

    def answer(frame):
        if frame[7] != 43:
            return place.coupler(frame)
        asked.append(frame)
        return None if len(asked) == 1 else place.coupler(frame)

    with ForeignLine(answer) as line:
        wiring = Wiring(Q.outputs, {}, only_safe=True, known_as=known_as)
        settings = LineSettings.model_validate({"address": f"127.0.0.1:{line.port}", **CALM})
        for again in range(2):
            with pytest.raises(DeviceLostError) if known_as else nullcontext(), suppress(LinkError):
                link = ModbusLink(settings, wiring, MODEL)
                link.close()
                assert again or not link.identity
        assert (place.writes > 0) == (not known_as)


def test_what_a_serial_adapter_holds_goes_when_its_bus_is_given_up():
    flushed = []

    class Port:
        def reset_output_buffer(self):
            flushed.append(True)

    class Adapter:
        serialPortOrig = Port()  # as python-can names it

    assert "full queue" in str(gone(Adapter(), "slcan:/dev/ttyACM0", can.CanError("full queue"))) and flushed
