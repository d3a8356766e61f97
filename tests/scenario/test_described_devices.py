"""Devices of public manuals, EDS and DBC files, described without code: by hand on a socket or bus, and their twins."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import can
import pytest

from drivers import ascii_module, canopen, modbus, scpi, text
from drivers import can as can_driver
from hil.daq.channel import InputChannel, OutputChannel, Terminal, Wiring
from hil.description.find import descriptions
from hil.description.read import read_description
from hil.errors import LinkError
from tests.described import bench, input_, output, passes, written
from tests.foreign_line import ForeignLine, Tables, ended
from tests.links import free_port

DRIVERS: dict[str, ModuleType] = {
    "modbus": modbus, "scpi": scpi, "text": text, "ascii_module": ascii_module, "can": can_driver, "canopen": canopen,
}  # fmt: skip
OF_NO_MAKER = {"pwm-amplifier", "flow-meter", "scanner", "dc-source"}
DEVICES = [name for name in descriptions() if name not in OF_NO_MAKER]


def wired(ports: dict[str, Terminal], *names: str) -> Wiring:
    chosen = {name: ports[name] for name in names}
    return Wiring(
        {n: OutputChannel(n, n, t.kind, t.unit, t.low, t.high) for n, t in chosen.items() if t.direction == "out"},
        {n: InputChannel(n, n, t.kind, t.unit, t.low, t.high) for n, t in chosen.items() if t.direction == "in"},
    )


@contextmanager
def opened(name: str, address: str, *terminals: str, **more: Any) -> Iterator[Any]:
    told = read_description(descriptions()[name])
    driver = DRIVERS[told.protocol]
    settings = driver.Settings.model_validate({"model": name, "address": address, "timeout_s": 1.0, **more})
    with closing(driver.open_link(settings, wired(told.ports, *terminals))) as link:
        yield link


def test_ten_devices_and_three_of_each_kind_of_bus():
    kinds = [read_description(descriptions()[name]).protocol for name in DEVICES]
    by_bus = {
        "modbus": "modbus",
        "can": "can",
        "canopen": "can",
        "text": "text",
        "scpi": "text",
        "ascii_module": "text",
    }
    counts = {bus: sum(by_bus[kind] == bus for kind in kinds) for bus in ("modbus", "can", "text")}
    assert len(DEVICES) >= 10 and min(counts.values()) >= 3


class WithCoils(Tables):
    """Registers and coils over a plain socket."""

    def __init__(self, coils: dict[int, int], **more: Any) -> None:
        super().__init__(**more)
        self.coils = coils

    def answered(self, request: bytes) -> bytes:
        if request[0] not in (1, 5):
            return super().answered(request)
        function, at, count = struct.unpack(">BHH", request[:5])
        if function == 1:
            bits = sum(self.coils[at + i] << i for i in range(count))
            return bytes([1, (count + 7) // 8]) + bits.to_bytes((count + 7) // 8, "little")
        self.coils[at] = int(count == 0xFF00)
        return request[:5]


def test_modbus_modules_against_registers_on_a_socket(half_a_second_later):
    wago = Tables(holding={0: 0, 0x0200: 0}, inputs={0: 0x4000, 1: 0xC000})
    wago_answer = wago.answered

    def image(request):
        """What is written at 0 is read back at 0x0200."""
        answer = wago_answer(request)
        wago.holding[0x0200] = wago.holding[0]
        return answer

    wago.answered = image  # type: ignore[method-assign]
    with ForeignLine(wago.on_tcp) as line, opened("wago-750", f"127.0.0.1:{line.port}", "ao0", "ai0", "ai1") as link:
        link.drive({"ao0": -5.0})
        assert wago.holding[0] == 0xC000 and link.standing() == pytest.approx({"ao0": -5.0}, abs=1e-3)
        assert link.read() == pytest.approx({"ai0": 5.0, "ai1": -5.0}, abs=1e-3)

    moxa = WithCoils(dict.fromkeys((0x1010, 0x1020), 0), holding={0x0400: 0})
    with ForeignLine(moxa.on_tcp) as line, opened("iologik-e1241", f"127.0.0.1:{line.port}", "ao0") as link:
        link.drive({"ao0": 10.0})
        assert moxa.holding[0x0400] == 4095 and link.standing() == {"ao0": 10.0}
        moxa.coils[0x1010] = 1
        half_a_second_later()
        with pytest.raises(LinkError, match="ao0: the device itself has made it safe"):
            link.read()

    inputs = Tables(inputs={3: 0x8000})
    with ForeignLine(inputs.on_tcp) as line, opened("iologik-e1240", f"127.0.0.1:{line.port}", "ai3") as link:
        assert link.read() == pytest.approx({"ai3": 5.0}, abs=1e-3)

    adam = WithCoils({0: 1, 1: 0, 16: 0}, holding={0: 0xFFFF, 5: 0x8000, 11: 0, 20: 0, 25: 0})
    with (
        ForeignLine(adam.on_tcp) as line,
        opened("adam-6024", f"127.0.0.1:{line.port}", "ai0", "ai5", "ao1", "di0", "di1", "do0") as link,
    ):
        link.drive({"ao1": 2.5, "do0": 1.0})
        assert adam.holding[11] == 1024 and adam.coils[16] == 1
        assert link.read() == pytest.approx({"ai0": 10.0, "ai5": 0.0, "di0": 1.0, "di1": 0.0}, abs=1e-3)
        assert link.standing() == pytest.approx({"ao1": 2.5, "do0": 1.0}, abs=3e-3)
        adam.holding[25] = 4  # AI status of channel 5, 40026: over low
        assert math.isnan(link.read()["ai5"]) and link.invalid_reasons == {"ai5": "over low"}


def answering(answers: Callable[[str], str], end: str, answer_end: str) -> ForeignLine:
    def answer(came: bytes) -> bytes:
        said = answers(came.decode().removesuffix(end))
        return f"{said}{answer_end}".encode() if said else b""

    return ForeignLine(answer, ended(end.encode()))


def test_text_instruments_against_strings_on_a_socket():
    supply = {"volts": "0.000"}

    def ql355(line):
        if line.startswith("V1 "):
            supply["volts"] = line[3:]
        return {"*IDN?": "THURLBY THANDAR, QL355, 279730, 1.04", "V1?": f"V1 {supply['volts']}", "V1O?": "11.997V",
                "I1O?": "0.503A"}.get(line, "")  # fmt: skip

    with (
        answering(ql355, "\n", "\r\n") as line,
        opened(
            "tti-ql355", f"socket://127.0.0.1:{line.port}", "voltage", "measured voltage", "measured current"
        ) as link,
    ):
        link.drive({"voltage": 12.0})
        assert link.standing() == {"voltage": 12.0} and supply["volts"] == "12.000"
        assert link.read() == {"measured voltage": 11.997, "measured current": 0.503}

    point = {"at": "+000.00"}

    def alicat(line):
        if line.startswith("AS"):
            point["at"] = f"{float(line[2:]):+07.2f}"
        return f"A +013.87 +023.60 +021.30 +020.05 {point['at']} Air" if line[:1] == "A" else ""

    with (
        answering(alicat, "\r", "\r") as line,
        opened(
            "alicat-mc", f"socket://127.0.0.1:{line.port}", "set point", "pressure", "mass flow", "temperature"
        ) as link,
    ):
        link.drive({"set point": 20.0})
        assert point["at"] == "+020.00" and link.standing() == {"set point": 20.0}
        assert link.read() == {"pressure": 13.87, "mass flow": 20.05, "temperature": 23.6}

    volts = {"204": "+0.00000000E+00"}

    def agilent(line):
        units = [unit.strip(":") for unit in line.split(";")]
        for unit in units:
            if unit.startswith("SOUR:VOLT "):
                volts["204"] = f"{float(unit[10:].split(',')[0]):+.8E}"
        known = {
            "*IDN?": "HEWLETT-PACKARD,34970A,0,13-2-2", "SYST:ERR?": '+0,"No error"', "SOUR:VOLT? (@204)": volts["204"],
            "MEAS:VOLT:DC? 10,(@101)": "-2.50012300E+00", "MEAS:VOLT:DC? 10,(@120)": "+9.90000000E+37",
        }  # fmt: skip
        told = [known.get(unit) for unit in units]
        return ";".join(one for one in told if one is not None)

    with (
        answering(agilent, "\n", "\n") as line,
        opened("agilent-34970a", f"socket://127.0.0.1:{line.port}", "dac4", "in1", "in20") as link,
    ):
        link.drive({"dac4": -3.3})
        assert volts["204"] == "-3.30000000E+00" and link.standing() == {"dac4": -3.3}
        assert link.read() == {"in1": -2.500123, "in20": float("inf")}


def test_ascii_modules_against_strings_on_a_socket():
    last = {"0": "+00.000"}

    def module(line):
        if line.startswith("#01C0"):
            last["0"] = line[5:]
            return "!01"
        return {"$01M": "!014024", "$018C0": "!01C032", "$016C0": f"!01{last['0']}"}.get(line, "")

    with (
        answering(module, "\r", "\r") as line,
        opened("adam-4024", f"socket://127.0.0.1:{line.port}", "ao0") as link,
    ):
        link.drive({"ao0": -7.25})
        assert last["0"] == "-07.250" and link.standing() == {"ao0": -7.25}
    said = {"$01M": "!014017", "$012": "!01080600", "#01": ">+07.211+07.234+07.210+07.211+07.211+07.211+07.211+02.500"}
    with (
        answering(lambda line: said.get(line, ""), "\r", "\r") as line,
        opened("adam-4017", f"socket://127.0.0.1:{line.port}", "ai1", "ai7") as link,
    ):
        assert link.read() == {"ai1": 7.234, "ai7": 2.5}


def test_broadcasts_of_j1939_against_frames_on_a_bus(tmp_path):
    bus = can.Bus(interface="virtual", channel=tmp_path.name)
    terminals = ("hydraulic temperature", "engine oil pressure", "fuel pressure", "engine speed")
    try:
        with opened("j1939-fluids", f"virtual:{tmp_path.name}", *terminals) as link:
            frames = {
                0x18FE6800: "5D FF FF FF FF FF FF FF", 0x18FEEF00: "FF FF FF 64 FF FF FF FF",
                0x0CF00400: "FF FF FF 68 13 FF FF FF", 0x0CF00401: "FF FF FF 00 00 FF FF FF",
            }  # fmt: skip
            for identifier, data in frames.items():
                bus.send(can.Message(arbitration_id=identifier, data=bytes.fromhex(data), is_extended_id=True))
            read = link.read()
            assert read.pop("fuel pressure") != 0.0  # not available
            assert read == {"hydraulic temperature": 53.0, "engine oil pressure": 400.0, "engine speed": 621.0}
            assert bus.recv(0.02) is None  # who only listens sends nothing
    finally:
        bus.shutdown()


@pytest.mark.alone
@pytest.mark.slow
@pytest.mark.parametrize("name", DEVICES)
def test_each_passes_the_checks_on_its_twin(name, tmp_path):
    told = read_description(descriptions()[name])
    passed = passes(written(tmp_path, "bench.toml", bench_of(name, told, tmp_path)), told.protocol)
    assert passed >= {"says_what_it_is", "says_soon_that_nobody_is_there"}


def bench_of(name: str, told: Any, folder: Path) -> str:
    """A bench of one output and one input of the device; what it has none of comes from another one."""
    address = {
        "modbus": f"127.0.0.1:{free_port()}",
        "can": f"virtual:{folder.name}",
        "canopen": f"virtual:{folder.name}",
    }
    quick = {"modbus": 'timeout_s = 0.1\nlongest_reply_s = 0.2\n', "can": "timeout_s = 0.15\nlongest_reply_s = 0.4\n",
             "canopen": "node = 5\n"}.get(told.protocol, "timeout_s = 0.15\nlongest_reply_s = 0.3\n")  # fmt: skip
    where = address.get(told.protocol, f"socket://127.0.0.1:{free_port()}")
    device = f'driver = "{told.protocol}"\nmodel = "{name}"\n{quick}address = "{where}"'
    ports = {way: next(((n, p) for n, p in told.ports.items() if p.direction == way), None) for way in ("out", "in")}
    channels = ""
    if ports["out"] is not None:
        terminal, port = ports["out"]
        channels += output("command", terminal, port.unit, "command", max(port.low, -10.0), min(port.high, 10.0))
        channels = channels.replace("slope = 10.0", f"slope = {100.0 / min(port.high, 10.0):g}")
    if ports["in"] is not None:
        terminal, port = ports["in"]
        channels += input_("reading", terminal, port.unit, "response", 0.75 * port.low + 0.25 * port.high)
    if None in ports.values():
        device += f'\n\n[devices.other]\ndriver = "modbus"\nmodel = "wago-750"\naddress = "127.0.0.1:{free_port()}"\n'
    if ports["out"] is None:
        channels += output("command", "ao0", "V", "command").replace('device = "io"', 'device = "other"')
    if ports["in"] is None:
        channels += input_("reading", "ai0", "V", "response").replace('device = "io"', 'device = "other"')
    return bench(device, channels, "reading")
