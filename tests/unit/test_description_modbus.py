"""Descriptions of Modbus devices: what is wrong is told with its line; what is right is driven and read."""

from __future__ import annotations

import time
import tomllib
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest

from drivers import modbus
from hil.bench.fault import BenchError
from hil.bench.read import read_bench
from hil.daq.channel import Wiring
from hil.description.modbus_place import as_in_manuals, on_the_wire
from hil.description.read import read_description
from hil.errors import FileError, LinkError, SettingError
from tests.channels import inputs, outputs
from tests.described import EVERYTHING, bench, input_, is_told, output, passes, written
from tests.foreign_line import ForeignLine, Tables, serial_frame
from tests.links import free_port

SMALL = """\
protocol = "modbus"
summary = "small"

[modbus]
addresses = "wire"

[terminals.pressure]
direction = "in"
unit = "bar"
range = [0.0, 250.0]
table = "input"
address = 8
"""


@pytest.mark.parametrize(
    ("old", "new", "line", "text"),
    [
        ('"modbus"', '"profibus"', 1, "protocol: 'profibus' is not known; there are: "),
        ("address = 8", "adress = 8", 12, "terminals.pressure.adress: is not known here; did you mean 'address'?"),
        ("address = 8", "address = 70000", 12, "address 70000: on the wire there are 0 … 65535"),
        ('table = "input"\n', "", 11, 'terminals.pressure.address: table is missing: say table = "holding"'),
        ('table = "input"\naddress = 8', "address = 40009", 11,
         'a manual that says 40009 usually means a holding register with wire address 8: say addresses = "40001"'),
        ('"wire"', '"40001"', 12, "terminals.pressure.address: address 8 is that of a coil, not of an input register"),
        ('"wire"', '"manual"', 5, "modbus.addresses: "),
        ("[0.0, 250.0]", "[250.0, 0.0]", 10, "terminals.pressure.range: low 250 must be below high 0"),
        ('"bar"', '"baar"', 9, "terminals.pressure.unit: unknown unit"),
        ("address = 8", 'address = 8\ntype = "bit"', 13, "one bit is bit = …"),
        ("address = 8", "address = 8\nbits = [14, 17]", 13, "lowest and highest bit of 0 … 15, the lowest first"),
        ("address = 8", "address = 8\nraw = [0, 9]\nslope = 2.0", 7, "raw, or slope and offset, not both"),
        ("address = 8", 'address = 8\nbyte_order = "CDAB"', 13, "AB or BA for one register"),
        ("address = 8", "address = 8\ninvalid = { broken = '' }", 13, "'broken' is no count"),
        ("address = 8", "address = 8\nwrite = 6", 7, "write, read_back, close and sets belong to an output"),
        ('"in"', '"out"', 12, "a input one can only be read"),
        ("address = 8", 'address = 8\nsets = "current.carrier"', 13, "terminals.pressure.sets: "),
        ('"in"', '"out"\nsets = "coil.dither_hz"', 9, "no output 'coil'; there are: pressure"),
        ("address = 8", "address = 8\n[watchdog]\nexpires_to = 0.0", 13, "there is no output that it could be for"),
        ("address = 8", "address = 8\ncount = 2", 13, "2 terminals need {n} in their name, such as ai{n}"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_with_its_line(old, new, line, text, tmp_path):
    is_told(tmp_path, SMALL, old, new, text, line)


@pytest.mark.parametrize(
    ("value", "text"),
    [("{minutes}", "value: '{minutes}': a number, {tenths}, {seconds}, {ms} or {safe:TERMINAL}"),
     ("{safe:ao7}", "no output 'ao7'; there are: ao0")],
)  # fmt: skip
def test_watchdog_with_an_unknown_placeholder_or_output_is_told(value, text, tmp_path):
    more = 'direction = "out"\nrange = [0, 9]\ntable = "holding"\naddress = 0\n[watchdog]\narm = ['
    new = f'address = 8\n\n[terminals.ao0]\n{more}{{ address = 9, value = "{value}" }}]\n'
    is_told(tmp_path, SMALL, "address = 8\n", new, text, 20)


@pytest.mark.parametrize(
    ("said", "place"),
    [(1, ("coil", 0)), (9999, ("coil", 9998)), (10001, ("discrete", 0)), (30001, ("input", 0)), (40001, ("holding", 0)),
     (49999, ("holding", 9998)), (400001, ("holding", 0)), (465536, ("holding", 65535)), (300101, ("input", 100)),
     (20001, ("coil", 20000)), (50001, ("coil", 50000))],  # five digits without a table in front
)  # fmt: skip
def test_addresses_as_manuals_count(said, place):
    assert on_the_wire(said, None, "40001") == place
    assert on_the_wire(int(as_in_manuals(*place)), None, "40001") == place  # type: ignore[arg-type]


@pytest.mark.parametrize("said", [0, 40000, 400000, 465537, 1400001])
def test_addresses_that_no_manual_has(said):
    with pytest.raises(ValueError, match="as manuals count there are"):
        on_the_wire(said, None, "40001")


WIRING = Wiring(
    outputs({"u": "command"}, safe=2.0) | outputs(["level"], low=0.0) | outputs(["lamp", "relay"], "1", 0.0, 1.0),
    inputs([*(f"volts {i}" for i in (1, 2, 3)), "spool"]) | inputs(["end"], "1", 0.0, 1.0),
)


class Foreign(Tables):
    """Registers that share nothing with driver or twin, and coils beside them; readiness as 402-like drives have it."""

    def __init__(self) -> None:
        holding = dict.fromkeys((100, 101, 119, 300, 301, 302, 303, 309, 310, 311), 0) | {119: 0x00C0}
        inputs = dict.fromkeys((*range(6), 20, 21, 22, 23, 29, 200, 201), 0)
        super().__init__(holding, inputs)
        self.coils, self.asked, self.stuck = {16: 0, 3: 1}, [], False

    def answered(self, request: bytes) -> bytes:
        function, at = request[0], int.from_bytes(request[1:3], "big")
        self.asked.append((function, at, int.from_bytes(request[3:5], "big")))
        if function in (1, 2):
            return bytes([function, 1, self.coils[at]])
        if function == 15:
            self.coils[at] = request[6] & 1
            return request[:5]
        answer = super().answered(request)
        if self.holding[309] == 15:
            self.holding[310] = self.holding[310] & 0x80 | 7
        if self.holding[311] == 1 and not self.stuck:
            self.holding[310] &= 0x7F
            self.holding[311] = 2  # done
        self.inputs[200], self.inputs[201] = self.holding[100], self.holding[101]
        return answer


@contextmanager
def opened(device: Foreign, tmp_path: Path, **more: Any) -> Iterator[modbus.ModbusLink]:
    path = written(tmp_path, "everything.toml", EVERYTHING)
    with ForeignLine(device.on_tcp) as line:
        told = {"model": str(path), "address": f"127.0.0.1:{line.port}", "timeout_s": 1.0, "watchdog_s": 1.5, **more}
        with closing(modbus.open_link(modbus.Settings.model_validate(told), WIRING)) as link:
            yield link


def test_everything_against_a_device_that_shares_nothing(tmp_path, half_a_second_later):
    device = Foreign()
    device.holding[310] = 0x80  # it reports a fault
    with opened(device, tmp_path) as link:
        assert device.holding[311] == 2 and device.holding[310] == 7  # cleared, then enabled
        assert (device.holding[301], device.holding[302]) == (20000, 0)  # 2 V, low word first
        assert device.holding[300] == 1500
        assert (device.holding[100], device.holding[101]) == (20000, 0)  # safe before it obeyed
        link.drive({"command": -5.0, "lamp": 1.0, "level": 4.0, "relay": 1.0})
        assert (device.holding[101] << 16 | device.holding[100]) - (1 << 32) == -50000
        assert device.holding[119] == 100 << 8 | 0x00C0 | 1 << 5  # bits 6 and 7 are nobody's
        assert device.coils[16] == 1
        assert link.standing() == {"command": -5.0, "lamp": 1.0, "level": 4.0, "relay": 1.0}
        device.inputs |= {0: 0xE803, 2: 0x18FC, 4: 0xD007, 20: 0xF83F, 21: 0, 22: 0, 23: 0}
        device.asked.clear()
        assert link.read() == {"volts 1": 1.0, "volts 2": -1.0, "volts 3": 2.0, "spool": 1.5, "end": 1.0}
        assert (4, 0, 5) in device.asked  # one request across the gaps
        device.inputs[2] = 0x0080
        device.inputs[29] = 1 << 3
        read = link.read()
        assert str(read["volts 2"]) == str(read["spool"]) == "nan" and read["volts 1"] == 1.0
        device.holding[310] |= 0x80
        half_a_second_later()
        with pytest.raises(LinkError, match="the device reports a fault: over-temperature"):
            link.read()
        device.holding[310] = 7
        device.holding[100] += 9
        link.read()  # 0.9 mV beside it: close enough
        device.holding[100] += 9
        with pytest.raises(LinkError, match="command stands at"):
            link.read()
    assert device.holding[309] == 0  # disabled when it was let go of


def test_what_cannot_be_cleared_or_is_no_measurement_is_told_in_the_words_of_the_file(tmp_path):
    device = Foreign()
    device.holding[310], device.stuck = 0x80, True
    with (
        pytest.raises(LinkError, match="reports a fault and cannot be cleared: over-temperature"),
        opened(device, tmp_path),
    ):
        raise AssertionError("it was opened")
    device = Foreign()
    device.inputs[0] = 0x0080
    with (
        opened(device, tmp_path) as link,
        pytest.raises(LinkError, match=r"volts 1 reads no measurement from the first on: sensor broken"),
    ):
        link.read()


EVERYTHING_BENCH = (
    output("command", "command", role="command")
    + output("level", "level", low=0)
    + output("lamp", "lamp", "1")
    + output("relay", "relay", "1")
    + input_("volts", "volts 1", role="response")
    + input_("spool", "spool")
)


@pytest.mark.alone
@pytest.mark.slow
def test_everything_passes_the_checks_on_its_twin(tmp_path):
    written(tmp_path, "everything.toml", EVERYTHING)
    told = 'driver = "modbus"\nmodel = "everything.toml"\nwatchdog_s = 0.9\ntimeout_s = 0.3\nlongest_reply_s = 0.6\n'
    text = bench(f'{told}address = "127.0.0.1:{free_port()}"', EVERYTHING_BENCH, "volts")
    path = written(tmp_path, "bench.toml", text)
    passed = passes(path, "modbus")
    assert "has_the_watchdog_that_it_promises" in passed


def test_a_description_may_stand_in_the_bench_file_and_its_faults_have_their_line_there(tmp_path):
    inside = SMALL.replace('protocol = "modbus"\n', "").replace("[terminals", "[devices.io.description.terminals")
    inside = inside.replace("[modbus]", "[devices.io.description.modbus]")
    told = f'driver = "modbus"\naddress = "127.0.0.1:9"\n[devices.io.description]\n{inside}'
    channels = '[channels.p]\nrole = "response"\ndevice = "io"\nterminal = "pressure"\nunit = "bar"\n'
    other = '\n[devices.o]\ndriver = "modbus"\nmodel = "iologik-e1241"\naddress = "127.0.0.1:8"\n'
    command = output("command", "ao0", role="command", low=0).replace('device = "io"', 'device = "o"')
    path = written(tmp_path, "bench.toml", bench(told + other, channels + command, "p"))
    assert read_bench(path).devices["io"].terminals["pressure"].high == 250.0
    path.write_text(path.read_text("utf-8").replace("address = 8\n", "address = 80000\n"), encoding="utf-8")
    with pytest.raises(
        BenchError, match=r"bench.toml:18: devices.io.description.terminals.pressure.address: address 8"
    ):
        read_bench(path)


def test_a_file_of_another_protocol_or_none_is_told(tmp_path):
    settings = modbus.Settings(model=str(tmp_path / "no.toml"), address="127.0.0.1:502")
    assert "no such description; it is looked for beside" in next(modbus.faults(settings))[1]
    assert modbus.terminals(settings) == {}
    with pytest.raises(FileError, match="not a description"):
        read_description(written(tmp_path, "no.toml", "protocol = "))
    with pytest.raises(SettingError, match="model is missing"):
        modbus.open_link(modbus.Settings(address="127.0.0.1:502"), Wiring({}, {}))
    assert tomllib.loads(EVERYTHING)["protocol"] == "modbus"


def test_what_fits_into_no_request_is_told(tmp_path):
    text = SMALL.replace('"wire"', '"wire"\nlongest_read = 1').replace("address = 8", 'address = 8\ntype = "f32"')
    with pytest.raises(
        BenchError, match=r":14: terminals.pressure.type: 'f32' takes 2 registers, more than longest_read = 1"
    ):
        read_description(written(tmp_path, "acme.toml", text))


def test_echo_and_pause_are_those_of_the_description(tmp_path):
    path = written(tmp_path, "acme.toml", SMALL.replace('"wire"', '"wire"\necho = true\npause_s = 0.05'))
    device, asked_s = Tables(inputs={8: 77}), [0.0]

    def echoing(frame):
        early = time.monotonic() - asked_s[0] < 0.04
        asked_s[0] = time.monotonic()
        return frame if early else frame + device.on_serial(frame)

    wiring = Wiring({}, inputs({"p": "pressure"}, "bar", 0.0, 250.0))
    with ForeignLine(echoing, serial_frame) as line:
        told = {"model": str(path), "transport": "rtu", "address": f"socket://127.0.0.1:{line.port}", "timeout_s": 1.0}
        link = modbus.open_link(modbus.Settings.model_validate(told), wiring)
        assert [link.read()["pressure"] for _ in range(3)] == [77.0] * 3
        link.close()


def test_a_bit_of_a_register_is_digital_so_its_1_is_a_reading(tmp_path):
    text = SMALL.replace("[0.0, 250.0]", "[0.0, 1.0]").replace('unit = "bar"\n', "") + "bit = 3\n"
    port = read_description(written(tmp_path, "small.toml", text)).ports["pressure"]
    assert port.kind == "digital"
