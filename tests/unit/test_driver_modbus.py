"""The Modbus driver and its twin: against frames from the specification, and against each other in trouble."""

from __future__ import annotations

import socket
import struct
import threading
import time
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers import modbus
from drivers._registers import encodings
from hil.daq.channel import OutputChannel, Wiring
from hil.daq.contract import Waveform
from hil.daq.device_link import DeviceWatchdog
from hil.daq.polled import PolledDaq
from hil.description.named import Described, description_of
from hil.errors import DeviceLostError, HardwareError, LinkError, SettingError
from sim_devices import modbus as twin
from sim_devices._modbus_described import DescribedBank
from sim_devices._modbus_frames import RtuFrames, TcpFrames, answered, crc16
from sim_devices._quirks import Quirks
from sim_devices._twin import described_in
from tests.channels import inputs, outputs
from tests.driven import played
from tests.foreign_line import ForeignLine
from tests.linked import linked as linked_to
from tests.linked import simulation, turned
from tests.waits import until

pytestmark = pytest.mark.xdist_group("waits for lines")  # for clocks: on one worker, beside others that compute

SIMULATION = simulation("read back", "level", slope=10.0, flow=1.0)


def output(low: float = -10.0, safe: float = 0.0) -> dict[str, OutputChannel]:
    return outputs({"command": "ao0"}, low=low, safe=safe)


OUT = output()
IN = inputs({"read back": "ai0"})
WAGO = Wiring(OUT, IN)


def linked(wiring: Wiring = WAGO, quirks: Quirks | None = None, **settings: Any) -> Any:
    told = {"model": "wago-750", "timeout_s": 1.0, "longest_reply_s": 1.0, "address": "127.0.0.1:0", **settings}
    return linked_to(modbus, twin, SIMULATION, wiring, told, quirks)


class Manual:
    """Registers as in the examples of the Modbus application protocol specification V1.1b3, section 6."""

    def __init__(self) -> None:
        self.written: dict[int, int] = {}
        self.table = {107: 0x022B, 108: 0x0000, 109: 0x0064}

    def holding(self, address: int) -> int:
        return self.table[address]

    def input(self, address: int) -> int:
        return {8: 0x000A}[address]

    def coil(self, address: int) -> bool:
        bits = 0b101_01101011_11001101  # 20 … 27, 28 … 35, 36 … 38
        return bool(bits >> (address - 19) & 1)

    def may_write(self, address: int, count: int) -> None:
        pass

    def write(self, address: int, count: int) -> None:
        self.written[address] = count

    def write_coil(self, address: int, on: bool) -> None:
        self.written[address] = on

    def heard(self) -> None:
        pass

    restart = tick = heard


EXAMPLES = {  # request and answer as printed in the specification
    "read coils": ("01 00 13 00 13", "01 03 CD 6B 05"),
    "read holding registers": ("03 00 6B 00 03", "03 06 02 2B 00 00 00 64"),
    "read input register": ("04 00 08 00 01", "04 02 00 0A"),
    "write single coil": ("05 00 AC FF 00", "05 00 AC FF 00"),
    "write single register": ("06 00 01 00 03", "06 00 01 00 03"),
    "write multiple registers": ("10 00 01 00 02 04 00 0A 01 02", "10 00 01 00 02"),
}


@pytest.mark.parametrize("name", EXAMPLES)
def test_twin_answers_as_the_specification_prints(name):
    request, answer = (bytes.fromhex(text) for text in EXAMPLES[name])
    assert answered(request, Manual()).hex(" ") == answer.hex(" ")  # type: ignore[arg-type]


def test_checksum_and_frame_of_the_serial_line_guide():
    """02 07 → CRC 41 12, low byte first: appendix B of the Modbus serial line guide V1.02."""
    assert crc16(bytes.fromhex("02 07")).hex(" ") == "41 12"
    frames = RtuFrames(Manual(), 0x11)  # type: ignore[arg-type]
    request = bytes.fromhex("11 03 00 6B 00 03 76 87")
    noise = b"\x00\xff\x11"
    assert frames.request_in(noise + request + b"\x11") == (request, b"\x11")
    answer = frames.answer(request)
    assert answer == bytes.fromhex("11 03 06 02 2B 00 00 00 64") + crc16(answer[:-2])


def test_full_scale_counts_of_the_coupler():
    register = encodings(description_of(Described(model="wago-750"), "modbus"))["ao0"]
    assert [register.count_of(volts) for volts in (10.0, 0.0, -10.0)] == [0x7FFF, 0, 0x8001]
    assert register.value_of([0x8001]) == pytest.approx(-10.0)


SERVER = {"transport": "rtu", "address": "socket://127.0.0.1:0"}


@pytest.fixture
def port(tmp_path):
    return {"transport": "rtu", "address": str(tmp_path / "tty")}


@pytest.fixture(params=["tcp", "rtu over a serial server", "rtu on a port"])
def line(request, port):
    return {"tcp": {}, "rtu on a port": port}.get(request.param, SERVER)


@pytest.mark.parametrize("quirk", ["late_s", "silent", "cut"])
def test_bad_answer_is_an_error_and_the_next_one_is_right(line, quirk):
    check_bad_answer(line, quirk)


def test_garbled_answer_on_a_serial_line_is_an_error(port):
    """A frame on TCP has no checksum of its own."""
    for line in (SERVER, port):
        check_bad_answer(line, "garbled")


def check_bad_answer(line: dict[str, Any], quirk: str) -> None:
    with linked(**line) as (link, served, _):
        link.drive({"ao0": 5.0})
        served.behaviour.quirks = Quirks.model_validate({quirk: 1.5 if quirk == "late_s" else True, "answers": 1})
        with pytest.raises(HardwareError):
            link.read()
        link.drive({"ao0": -5.0})
        time.sleep(0.003)
        assert link.read()["ai0"] == pytest.approx(-5.0, abs=1e-3)


def test_late_answer_is_never_taken_for_the_next_one(port):
    """On a serial line an answer has no number. The library alone takes the old reading for the new one."""
    from pymodbus.client import ModbusSerialClient
    from pymodbus.exceptions import ModbusIOException

    late = Quirks(late_s=1.5, answers=1)
    with linked(**port) as (link, served, terminals):
        terminals.drive({"ao0": 5.0})
        time.sleep(0.003)
        served.behaviour.quirks = late
        with pytest.raises(LinkError, match=r"no valid answer within 1 s"):
            link.read()
        terminals.drive({"ao0": -5.0})
        assert link.read()["ai0"] == pytest.approx(-5.0, abs=1e-3)
        link.close()

        bare = ModbusSerialClient(served.where, timeout=2.0, retries=0)
        served.behaviour.quirks = Quirks(late_s=3.0, answers=1)
        with pytest.raises(ModbusIOException):
            bare.read_input_registers(0)
        bare.comm_params.timeout_connect = 20.0  # what comes is what is looked at, however busy the machine is
        terminals.drive({"ao0": 5.0})
        time.sleep(0.003)
        stale = bare.read_input_registers(0).registers[0]
        bare.close()
        assert stale == 0x10000 - round(0.5 * 0x7FFF)


def test_safe_value_does_not_wait_for_a_line_that_is_not_clean(port):
    with linked(**port, longest_reply_s=4.0) as (link, served, terminals):
        link.drive({"ao0": 5.0})
        served.behaviour.quirks = Quirks(silent=True, answers=1)
        with pytest.raises(LinkError):
            link.read()
        thread = threading.Thread(target=link.drive, args=({"ao0": 0.0},))
        thread.start()
        until(lambda: terminals.standing("ao0") == 0.0)
        assert not link.line.is_clean, "it was told only when no late answer could come"
        thread.join()


def test_without_a_watchdog_the_coupler_keeps_its_output():
    with linked() as (link, _, terminals):
        link.drive({"ao0": 5.0})
        link.close()
        time.sleep(0.1)
        assert terminals.standing("ao0") == pytest.approx(5.0, abs=1e-3)


SECONDS = {"ao0": modbus.Register("out", "voltage", "V", 0.0, 10.0, "holding", 120, "u16", slope=0.001)}


@pytest.mark.parametrize(("unit", "count"), [("tenths", 20), ("seconds", 2), ("ms", 2000)])
def test_watchdog_is_told_its_time_in_its_own_unit_and_where_the_output_is_safe(unit, count):
    model = modbus.Model(SECONDS, watchdog=((140, f"{{{unit}}}"), (141, "{safe:ao0}"), (142, 1)))
    wiring = Wiring(outputs({"valve": "ao0"}, low=0.0, safe=5.0), {})
    for connected, written in (
        (wiring, [(140, count), (141, 5000), (142, 1)]),
        (Wiring({}, {}), []),  # a device without an output in use is left as it is
    ):
        with ForeignLine(lambda frame: frame) as device:
            settings = modbus.LineSettings(address=f"127.0.0.1:{device.port}", watchdog_s=2.0)
            assert list(modbus.line_faults(settings, model)) == []
            modbus.ModbusLink(settings, connected, model).close()
        assert [struct.unpack(">HH", frame[8:12]) for _, frame in device.heard if frame[7] == 6] == written


def test_watchdog_that_the_device_cannot_count_is_told():
    model = modbus.Model(SECONDS, watchdog=((140, "{seconds}"),))
    settings = modbus.LineSettings(address="127.0.0.1:502", watchdog_s=0.5)
    assert [text for _, text in modbus.line_faults(settings, model)] == [
        "0.5 s: the device counts 1 … 65535 s in steps of 1 s"
    ]


def test_watchdog_that_would_drive_the_valve_is_not_armed():
    wiring = Wiring(output(safe=5.0), {})
    with (
        pytest.raises(SettingError, match=r"puts ao0 at 0 V, but 'command' is safe at 5 V; take watchdog_s away"),
        linked(wiring, watchdog_s=0.2),
    ):
        raise AssertionError("it was armed")
    with linked(wiring) as (link, _, terminals):
        link.drive({"ao0": 7.0})
        link.drive({"ao0": 5.0})
        link.close()
        time.sleep(0.5)
        assert terminals.standing("ao0") == pytest.approx(5.0, abs=0.001)


def asked(where: str, address: int) -> int:
    """What a holding register says, asked in bytes by somebody else."""
    host, _, port = where.rpartition(":")
    with socket.create_connection((host, int(port))) as line:
        line.sendall(struct.pack(">HHHBBHH", 1, 0, 6, 1, 3, address, 1))
        return int(struct.unpack(">H", line.recv(260)[9:11])[0])


def test_valve_whose_neutral_is_5_v_stands_there_after_a_run_when_the_watchdog_has_expired():
    wiring = Wiring(output(0.0, safe=5.0), {})
    with (
        pytest.raises(
            SettingError, match=r"puts ao0 at 0 V, but 'command' is safe at 5 V; .* say so with watchdog_level"
        ),
        linked(wiring, model="iologik-e1241", watchdog_s=1.0),
    ):
        raise AssertionError("it was armed")
    settings = {"model": "iologik-e1241", "watchdog_s": 1.0, "watchdog_level": 5.0}
    with linked(wiring, **settings) as (link, served, terminals):
        daq = PolledDaq({"io": link}, {"io": wiring})
        played(daq, Waveform(50.0, {"command": np.full(5, 9.0)}))
        daq.close()
        assert asked(served.where, 0x0400) == round(5.0 * 409.5)
        time.sleep(1.5)
        assert terminals.standing("ao0") == pytest.approx(5.0, abs=0.002)


def test_cable_that_is_pulled_is_a_lost_device():
    with linked() as (link, served, _):
        served.close()
        with pytest.raises(DeviceLostError, match="the connection is lost"):
            link.read()


E1241 = Wiring(output(0.0), {})


def test_outputs_in_safe_mode_are_noticed_and_left_from_the_safe_value(monkeypatch, half_a_second_later):
    settings = {"model": "iologik-e1241", "watchdog_s": 1.5}
    with linked(E1241, **settings) as (link, served, terminals):
        link.drive({"ao0": 7.0})
        until(lambda: terminals.standing("ao0") == 0.0)
        half_a_second_later()
        with monkeypatch.context() as patch:
            patch.setattr(DeviceWatchdog, "begin", lambda *_: None)  # not the driver's own clock, but the device
            with pytest.raises(LinkError, match="ao0: the device itself has made it safe"):
                link.read()
        again = modbus.open_link(modbus.Settings(**settings, timeout_s=1.0, address=served.where), E1241)
        assert terminals.standing("ao0") == 0.0
        again.drive({"ao0": 3.0})
        assert terminals.standing("ao0") == pytest.approx(3.0, abs=2e-3)
        again.close()


def test_refusal_says_which_register_and_why():
    with (
        linked() as (link, _, _),
        pytest.raises(LinkError, match=r"function 3 at register 0x0999 .* exception 2 \(no such"),
    ):
        link.line.ask(3, 0x0999, count=1)


def test_speed_of_the_line_is_kept():
    with linked(**SERVER, quirks=Quirks(baud=9600)) as (link, _, _):
        begun_s = time.monotonic()
        link.read()
        assert time.monotonic() - begun_s >= 10.0 * (8 + 7) / 9600


FRAMES = st.lists(
    st.binary(max_size=40) | st.sampled_from([bytes.fromhex(e[0]) for e in EXAMPLES.values()]), max_size=6
)


@given(FRAMES, st.booleans())
def test_hostile_bytes_neither_crash_nor_hang_nor_move_an_output(pieces, tcp):
    terminals = HOSTILE_SIDE
    bank = twin.Wago750(terminals)
    frames = TcpFrames(bank, 1) if tcp else RtuFrames(bank, 1)
    writes = 0
    received = b""
    for piece in pieces:
        received += piece
        for _ in range(len(received) + 1):
            request, received = frames.request_in(received)
            if not request:
                break
            pdu = request[7:] if tcp else request[1:-2]
            writes += pdu[0] in (6, 16)
            answer = frames.answer(request)
            assert len(answer) <= 260
        else:
            pytest.fail("the same bytes are looked at for ever")
    assert writes or terminals.standing("ao0") == 0.0


HOSTILE_SIDE = turned(SIMULATION, WAGO)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"address": "nowhere"}, "not host:port"),
        ({"model": "flow-meter", "watchdog_s": 1.0}, "no outputs"),
        ({"watchdog_s": 0.01}, "0.1 … 6553.5"),
        ({"longest_reply_s": 0.1}, "shorter than timeout_s"),
    ],
)
def test_settings_that_cannot_be_are_told(changes, text):
    settings = modbus.Settings.model_validate({"model": "wago-750", "address": "10.0.0.1:502", **changes})
    assert any(text in fault for _, fault in modbus.faults(settings))


def test_refused_value_writes_nothing():
    settings = {"model": "iologik-e1241"}
    bank = DescribedBank(turned(SIMULATION, WAGO), described_in(settings, "modbus"), settings)
    answer = answered(bytes.fromhex("10 04 00 00 02 04 01 00 FF FF"), bank)
    assert answer == bytes.fromhex("90 03")
    assert bank.holding(0x0400) == 0


def test_frozen_outputs_are_agreed_to_and_stand_still_until_they_thaw():
    with linked() as (link, served, terminals):
        link.drive({"ao0": 2.5})
        served.behaviour.quirks = Quirks(frozen=True)
        link.drive({"ao0": -4.0})
        time.sleep(0.003)
        assert terminals.standing("ao0") == pytest.approx(2.5, abs=1e-3)
        assert link.read()["ai0"] == pytest.approx(2.5, abs=1e-3)
        assert link.standing()["ao0"] == pytest.approx(-4.0, abs=1e-3)  # its registers know nothing of it
        served.behaviour.quirks = Quirks()
        link.drive({"ao0": -4.0})
        assert terminals.standing("ao0") == pytest.approx(-4.0, abs=1e-3)
