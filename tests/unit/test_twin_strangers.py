"""Twins as a stranger's client finds them: what protocols ask of every device, beyond what our drivers use."""

from __future__ import annotations

import minimalmodbus
import pytest

from hil.clock import VirtualClock
from hil.daq.channel import Wiring
from hil.description.named import Described, description_of
from sim_devices import canopen_valve, j1939_valve, modbus
from sim_devices._field import Field
from sim_devices._modbus_frames import RtuFrames, TcpFrames, crc16
from sim_devices._simulation import Simulation
from sim_devices.kit import Quirks, Side
from sim_devices.scpi import Instrument
from tests.channels import inputs, outputs

INSTRUMENTS = {
    "command": {"direction": "out", "signal": "command", "unit": "%", "slope": 10.0},
    "seen": {"signal": "command", "unit": "%", "slope": 10.0},
}
SIMULATION = Simulation.model_validate({"plant": "brevini-hpv41", "instruments": INSTRUMENTS})


def side(out: str, in_: str, unit: str = "V") -> Side:
    wiring = Wiring(outputs({"command": out}, unit), inputs({"seen": in_}, unit))
    return Field(SIMULATION, {"": wiring}, VirtualClock()).side("")


@pytest.fixture
def coupler():
    return modbus.Wago750(side("ao0", "ai0"))


@pytest.fixture
def line(coupler, tmp_path):
    """The coupler on a serial line, with the client of nobody here."""
    served = modbus.serve(
        {"model": "wago-750", "transport": "rtu", "address": str(tmp_path / "line")}, coupler.side, Quirks()
    )
    client = minimalmodbus.Instrument(str(tmp_path / "line"), 1)
    client.serial.timeout = 5.0
    yield client
    client.serial.close()
    served.close()


def test_another_client_on_the_serial_line(line):
    line.write_registers(0, [2000])
    assert line.read_register(0x200) == 2000
    line.write_register(0, -1234, functioncode=6, signed=True)
    assert line.read_register(0x200, signed=True) == -1234
    with pytest.raises(minimalmodbus.IllegalRequestError, match="illegal data address"):
        line.read_bit(0)
    line.address = 0  # everybody
    line.write_register(0, 777, functioncode=6)
    line.address = 1
    assert line.read_register(0x200) == 777


@pytest.mark.parametrize(
    ("request_", "answer"),
    [
        ("0B", "0B 00 00 00 00"),  # events so far: none
        ("16 00 00 00 F2 00 25", "16 00 00 00 F2 00 25"),  # as in the specification, 6.16
        ("17 02 00 00 01 00 01 00 01 02 00 2A", "17 02 00 12"),  # writes register 1, reads register 0
        ("01 00 00 00 08", "81 02"),
        ("02 00 00 00 08", "82 02"),
        ("0F 00 00 00 08 01 FF", "8F 02"),
        ("07", "87 01"),
        ("11", "91 01"),
        ("42", "C2 01"),
        ("2B 0E 01 00", "AB 01"),
    ],
)
def test_functions_of_the_coupler(coupler, request_, answer):
    coupler.write(0, 0x0012)
    pdu = bytes.fromhex(request_)
    tcp = TcpFrames(coupler, 1).answer(b"\0\1\0\0" + bytes([0, len(pdu) + 1, 0]) + pdu)
    assert tcp[7:].hex(" ").upper() == answer
    coupler.write(0, 0x0012)
    frames, frame = RtuFrames(coupler, 1), b"\1" + pdu
    found, rest = frames.request_in(b"\xff" + frame + crc16(frame))
    assert (found, rest) == (frame + crc16(frame), b"")
    assert frames.answer(found)[1:-2].hex(" ").upper() == answer


def test_masks_are_applied_as_the_specification_prints(coupler):
    coupler.write(0, 0x0012)
    TcpFrames(coupler, 1).answer(bytes.fromhex("0001 0000 0008 01 16 0000 00F2 0025"))
    assert coupler.holding(0x200) == 0x0017


def test_events_are_counted_but_not_exceptions_nor_questions_for_them(coupler):
    frames = TcpFrames(coupler, 1)
    head = "0001 0000 0006 01"
    for pdu in ("03 0000 0001", "03 7777 0001", "06 0000 0001"):
        frames.answer(bytes.fromhex(f"{head} {pdu}"))
    for _ in range(2):
        assert frames.answer(bytes.fromhex("0001 0000 0002 01 0B"))[7:].hex(" ") == "0b 00 00 00 02"


class Node:
    """A CANopen node, asked by hand."""

    def __init__(self) -> None:
        self.side = side("set point", "actual value", "%")
        self.valve = canopen_valve.Valve(self.side, 5)

    def sdo(self, text: str) -> str:
        ((identifier, data),) = self.valve.on_frame(0x605, bytes.fromhex(text))
        assert identifier == 0x585
        return data.hex(" ")

    def uploaded(self, index: int, sub: int) -> int:
        answer = bytes.fromhex(self.sdo(f"40 {index & 0xFF:02x} {index >> 8:02x} {sub:02x} 00 00 00 00"))
        assert answer[0] != 0x80, answer.hex()
        return int.from_bytes(answer[4:], "little")


@pytest.mark.parametrize(
    ("request_", "abort"),
    [
        ("40 00 50 00 00 00 00 00", 0x06020000),  # no such object
        ("40 00 63 09 00 00 00 00", 0x06090011),  # no such sub-index
        ("23 00 10 00 00 00 00 00", 0x06010002),  # read only
        ("2b 00 63 01 ff 7f 00 00", 0x06090030),  # beyond its range
        ("2f 00 63 01 01 00 00 00", 0x06070010),  # length
        ("2f 00 1a 00 01 00 00 00", 0x06040041),  # entry 1 is nothing that could be mapped
        ("2f 00 1a 00 09 00 00 00", 0x06040042),  # too long
        ("23 03 16 01 10 00 41 60", 0x06010000),  # while the mapping is in force
        ("e0 00 10 00 00 00 00 00", 0x05040001),  # no such command
    ],
)
def test_sdo_is_refused_with_the_codes_of_cia_301(request_, abort):
    answer = Node().sdo(request_)
    assert answer == f"80 {request_[3:11]} {abort.to_bytes(4, 'little').hex(' ')}"


def test_set_point_in_every_pdo_that_carries_it_and_in_one_that_a_client_maps():
    node = Node()
    list(node.valve.on_frame(0x000, b"\x01\x05"))
    for number, (identifier, tail) in enumerate(((0x305, b""), (0x505, b"\0\0")), start=1):
        list(node.valve.on_frame(identifier, b"\0\0" + (1000 * number).to_bytes(2, "little") + tail))
        assert node.uploaded(0x6300, 1) == 1000 * number
    for request in ("2f 00 16 00 00 00 00 00", "23 00 16 01 10 01 00 63", "2f 00 16 00 01 00 00 00"):
        assert node.sdo(request).startswith("60")
    list(node.valve.on_frame(0x205, (77).to_bytes(2, "little")))
    assert node.uploaded(0x6300, 1) == 77
    list(node.valve.on_frame(0x205, b"\x01"))  # too short
    assert node.uploaded(0x6300, 1) == 77


def test_scpi_status_of_ieee_488():
    scanner = Instrument(side("dac4", "in1"), description_of(Described(model="scanner"), "scpi"))
    told = [
        ("*ESR?", "128"), ("*ESR?", "0"), ("*OPC?;*TST?", "1;0"), ("NONSENSE", None), ("*STB?", "4"), ("*ESR?", "32"),
        ("SOUR:VOLT 99,(@204)", None), ("*ESE 16;*SRE 32", None), ("*STB?", "100"), ("*ESE?;*SRE?", "16;32"),
        ("SYST:ERR?", '-113,"Undefined header"'), ("SYSTEM:ERROR:NEXT?", '-222,"Data out of range"'),
        ("*CLS;*ESR?;SYST:ERR?", '0;+0,"No error"'), ("*OPC;*ESR?", "1"), ("*WAI", None),
        ("SOUR:VOLT 2.5,(@204);*RST;SOUR:VOLT? (@204)", "0"), ("*OPC? 1", None), ("*ESE 256", None),
        ("SYST:ERR?;SYST:ERR?", '-108,"Parameter not allowed";-222,"Data out of range"'),
    ]  # fmt: skip
    for request, answer in told:
        assert scanner.answer_to(request) == answer, request


@pytest.mark.parametrize(
    ("to", "group", "answer"),
    [
        (0x80, "da fe 00", (0x18E8FF80, "01 ff ff ff f9 da fe 00")),  # it does not have 0xFEDA: not acknowledged
        (0xFF, "da fe 00", None),  # who asks everybody gets no refusals
        (0x81, "da fe 00", None),  # another one was asked
        (0x80, "00 ee 00", (0x18EEFF80, None)),
        (0x80, "19 fe 00", (0x0CFE1980, None)),
    ],
)
def test_j1939_request_is_answered_or_refused(to, group, answer):
    valve = j1939_valve.Valve(side("flow command", "estimated flow", "%"), 9, 0x80, 0.3)
    frames = list(valve.on_frame(0x18EA00F9 | to << 8, bytes.fromhex(group)))
    assert [identifier for identifier, _ in frames] == ([] if answer is None else [answer[0]])
    if answer is not None and answer[1] is not None:
        assert frames[0][1].hex(" ") == answer[1]
