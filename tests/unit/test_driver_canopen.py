"""The CANopen valve and its twin: frames after CiA 301, state machine of CiA 408, heartbeat, emergency, late PDOs."""

from __future__ import annotations

import re
import socket
import threading
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers import canopen_valve
from hil.clock import VirtualClock
from hil.daq.channel import Wiring
from hil.errors import LinkError
from sim_devices import canopen_valve as twin
from sim_devices._can_bus import Hub
from sim_devices._eds import objects_of
from sim_devices._quirks import Quirks
from tests.channels import inputs, outputs
from tests.linked import linked as linked_to
from tests.linked import simulation, turned
from tests.waits import PATIENCE_S, until

SIMULATION = simulation("spool")
WIRING = Wiring(
    outputs({"command": "set point"}, "%", -100.0, 100.0), inputs({"spool": "actual value"}, "%", -200.0, 199.99)
)
SDO_ANSWER = 0x581


class Bus:
    """A valve whose clock is turned by hand, and what it sends."""

    def __init__(self) -> None:
        self.clock = VirtualClock()
        self.side = turned(SIMULATION, WIRING, self.clock)
        self.valve = twin.Valve(self.side, 1)

    def send(self, identifier: int, text: str) -> list[tuple[int, str]]:
        return [(i, data.hex(" ")) for i, data in self.valve.on_frame(identifier, bytes.fromhex(text))]

    def wait(self, seconds: float) -> list[tuple[int, str]]:
        frames = []
        for _ in range(round(seconds * 100)):
            self.clock.sleep_until(self.clock.now_s + 0.01)
            frames += [(i, data.hex(" ")) for i, data in self.valve.tick()]
        return frames

    def control(self, word: int) -> int:
        self.send(0x601, f"2b 40 60 00 {word:02x} 00 00 00")
        ((_, answer),) = self.send(0x601, "40 41 60 00 00 00 00 00")
        return int(answer.split()[4], 16)


def linked(bus: str, **settings: Any) -> Any:
    told = {"address": f"virtual:{bus}", "longest_reply_s": 1.0, "timeout_s": 1.0, "watchdog_s": 10.0, **settings}
    return linked_to(canopen_valve, twin, SIMULATION, WIRING, told)


@pytest.fixture
def bus(request):
    return str(request.node.name)


@pytest.mark.parametrize(
    ("request_", "answer"),
    [
        ("40 00 10 00 00 00 00 00", "43 00 10 00 98 01 00 00"),  # device type 408, four bytes
        ("40 17 10 00 00 00 00 00", "4b 17 10 00 00 00 00 00"),  # two bytes
        ("40 01 10 00 00 00 00 00", "4f 01 10 00 00 00 00 00"),  # one byte
        ("2b 17 10 00 e8 03 00 00", "60 17 10 00 00 00 00 00"),  # heartbeat each second
        ("22 17 10 00 e8 03 00 00", "60 17 10 00 00 00 00 00"),  # the same without a size
        ("23 17 10 00 e8 03 00 00", "80 17 10 00 10 00 07 06"),  # length does not match
        ("40 00 20 00 00 00 00 00", "80 00 20 00 00 00 02 06"),  # no such object
        ("40 18 10 07 00 00 00 00", "80 18 10 07 11 00 09 06"),  # no such sub-index
        ("2b 41 60 00 00 00 00 00", "80 41 60 00 02 00 01 06"),  # read only
        ("2b 00 63 01 01 40 00 00", "80 00 63 01 30 00 09 06"),  # beyond 100 %
        ("60 00 10 00 00 00 00 00", "80 00 10 00 01 00 04 05"),  # no such command
    ],
)  # fmt: skip
def test_sdo_frames_after_cia_301(request_, answer):
    assert Bus().send(0x601, request_) == [(SDO_ANSWER, answer)]


def test_state_machine_climbs_step_by_step_and_only_active_moves_the_spool():
    bus = Bus()
    bus.send(0x601, "2b 00 63 01 00 20 00 00")
    assert bus.control(0x7) == 0b1000  # no leap from INIT
    reached = [(bus.control(word), bus.side.standing("set point")) for word in (0x0, 0x1, 0x3, 0x7, 0x3, 0x1, 0x0)]
    assert reached == [
        (0b1000, 0.0), (0b1001, 0.0), (0b1011, 0.0), (0b1111, 50.0), (0b1011, 0.0), (0b1001, 0.0), (0b1000, 0.0),
    ]  # fmt: skip


def test_missed_heartbeat_is_a_fault_with_an_emergency_until_it_is_reset():
    bus = Bus()
    bus.send(0x601, "23 16 10 01 64 00 7f 00")  # node 127, 100 ms
    bus.send(0x601, "2b 00 63 01 00 20 00 00")
    for word in (0x0, 0x1, 0x3, 0x7):
        bus.control(word)
    bus.send(0x77F, "05")
    assert bus.wait(0.09) == [] and bus.side.standing("set point") == 50.0
    assert bus.wait(0.03) == [(0x081, "30 81 11 00 00 00 00 00")]
    assert bus.side.standing("set point") == 0.0
    assert bus.control(0x7) == 0b0011
    assert bus.control(0x8) == 0b1000


def test_ramp_limits_the_set_point():
    bus = Bus()
    bus.send(0x601, "2b 31 63 01 e8 03 00 00")  # 1000 ms
    bus.send(0x601, "2f 30 63 00 01 00 00 00")
    bus.send(0x601, "2b 00 63 01 00 40 00 00")
    for word in (0x0, 0x1, 0x3, 0x7):
        bus.control(word)
    bus.wait(0.5)
    assert bus.side.standing("set point") == pytest.approx(50.0, abs=2.0)
    bus.wait(0.6)
    assert bus.side.standing("set point") == 100.0


def test_what_the_bench_file_says_stands_in_the_valve(bus):
    told = {"ramp_s": 0.25, "dither_amplitude": 30, "dither_hz": 120.0, "dead_band_a": 10.0, "dead_band_b": 20.0}
    with linked(bus, **told) as (_, served, _):
        values = served.node.values
    types, numbers = (0x6330, 0x6360, 0x6342), (0x6331, 0x6361, 0x6362, 0x6343, 0x6344)
    assert [values[index, 0] for index in types] == [1, 1, 1]
    assert [values[index, 1] for index in numbers] == [250, 30, 120, 1638, 3277]


def test_silent_program_is_a_fault_of_the_valve_and_the_driver_says_so(bus):
    import can

    with can.Bus(interface="virtual", channel=bus) as other, linked(bus, watchdog_s=1.5) as (link, _, side):
        link.drive({"set point": 50.0})
        until(lambda: side.standing("set point") == 50.0)
        until(lambda: side.standing("set point") == 50.0)
        until(lambda: side.standing("set point") == 0.0)
        assert any(message.arbitration_id == 0x081 for message in iter(lambda: other.recv(PATIENCE_S), None))
        with pytest.raises(LinkError, match=r"emergency 0x8130, error register 0x11 \(it missed our heartbeat\)"):
            link.read()
        with pytest.raises(LinkError, match=r"longer than its watchdog of 1\.5 s: the valve makes its outputs safe"):
            link.read()
        link.drive({"set point": 0.0})
        with pytest.raises(LinkError, match="the valve is in FAULT_HOLD, not ACTIVE"):
            link.read()


def test_restart_of_the_valve_is_noticed(bus):
    with linked(bus) as (link, served, side):
        link.drive({"set point": 50.0})
        served.behaviour.quirks = Quirks(reboot=True, answers=1)
        with pytest.raises(LinkError, match="no actual value"):
            link.read()
        assert side.standing("set point") == 0.0


@pytest.mark.parametrize("address", ["can0", "socketcand:can0", "socketcan:"])
def test_address_that_is_none_is_told(address):
    ((place, text),) = canopen_valve.faults(canopen_valve.Settings(address=address))
    assert place == ("address",) and address in text


FRAMES = st.lists(
    st.tuples(st.sampled_from([0x000, 0x080, 0x601, 0x501, 0x77F, 0x123]), st.binary(max_size=8)), max_size=30
)


@given(FRAMES)
def test_hostile_frames_neither_crash_nor_move_the_spool_unless_it_is_active(frames):
    for identifier, data in frames:
        for answer in HOSTILE.valve.on_frame(identifier, data):
            assert len(answer[1]) <= 8
        list(HOSTILE.valve.tick())
        if HOSTILE.valve.value(0x6041, 0) not in (0b1111, 0b1011, 0b0011):
            assert HOSTILE.side.standing("set point") == 0.0


HOSTILE = Bus()


def test_hub_passes_frames_on_and_survives_nonsense():
    import can

    before = set(threading.enumerate())
    hub = Hub("127.0.0.1", 0)
    buses = [can.Bus(interface="socketcand", channel="can0", host=hub.host, port=hub.port) for _ in range(2)]
    with socket.create_connection((hub.host, hub.port)) as stranger:
        stranger.sendall(b"< send zz 9 1 2 > <> < rawmode > \xff\xff < send 7ff 1 >" + b"x" * 9000)
        buses[0].send(can.Message(arbitration_id=0x18FE3001, data=b"\x01\xff", is_extended_id=True))
        got = buses[1].recv(PATIENCE_S)
    assert got.arbitration_id == 0x18FE3001 and bytes(got.data) == b"\x01\xff"
    for member in buses:
        member.shutdown()
    hub.close()
    assert set(threading.enumerate()) <= before


def test_the_twin_s_file_is_that_of_such_a_valve():
    more = {"ramp_s": 0.1, "dither_amplitude": 1, "dither_hz": 100, "dead_band_a": 1, "dead_band_b": 1}
    path = Path(twin.__file__).with_suffix(".eds")
    told = {"address": "virtual:x", "eds": str(path), **more}
    assert not list(canopen_valve.faults(canopen_valve.Settings.model_validate(told)))
    assert [objects_of(str(path), 5)[0x1400 + i, 1][1] for i in range(4)] == [0x205, 0x305, 0x405, 0x505], "CiA 301"


@pytest.mark.parametrize(
    ("old", "new", "place", "text"),
    [
        ("", "", (), ""),
        ("0x00000198", "0x00000191", "eds", "a device of profile 401, not of 408"),
        ("[6301", "[6302", "eds", r"has no object 6301.1 \(actual value\)"),
        ("", "ramp_s", "ramp_s", "the valve has no object 6331.1, says .*; take this away"),
    ],
)
def test_what_the_maker_s_file_lacks_is_told(old, new, place, text, tmp_path):
    sections = ["1000", "1016sub1", "1A00sub1", "6040", "6041", "6300sub1", "6301sub1"]
    records = [
        "[1016]\nParameterName=x\nObjectType=9\nSubNumber=1\n",
        "[1A00]\nParameterName=x\nObjectType=9\nSubNumber=1\n",
    ]
    records += [f"[{i}]\nParameterName=x\nObjectType=9\nSubNumber=1\n" for i in ("6300", "6301")]
    body = "".join(
        f"[{s}]\nParameterName={s}\nObjectType=7\nDataType=7\nAccessType=rw\nDefaultValue=0\n" for s in sections
    )
    text_of = (
        "[DeviceInfo]\nVendorName=x\n" + "".join(records) + body.replace("DefaultValue=0", "DefaultValue=0x00000198", 1)
    )
    path = tmp_path / "valve.eds"
    path.write_text(text_of.replace(old, new) if old else text_of, encoding="utf-8")
    more = {"ramp_s": 0.1} if new == "ramp_s" else {}
    settings = canopen_valve.Settings.model_validate({"address": "virtual:x", "eds": str(path), **more})
    found = list(canopen_valve.faults(settings))
    assert [where for where, _ in found] == ([(place,)] if place else [])
    assert all(re.search(text, said) for _, said in found)
