"""The auxiliary valve on J1939 and its twin: messages bit by bit, fail-safe state, what is not believed."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers import _can_frames, j1939_valve
from drivers._address_claim import CLAIM_WAIT_S, AddressClaim, default_name
from hil.clock import VirtualClock
from hil.daq.channel import Wiring
from hil.errors import LinkError
from sim_devices import j1939_valve as twin
from sim_devices._field import Side
from sim_devices._quirks import Quirks
from tests.channels import inputs, outputs
from tests.linked import linked as linked_to
from tests.linked import simulation, turned
from tests.waits import until

SIMULATION = simulation("estimate")
WIRING = Wiring(
    outputs({"command": "flow command"}, "%", -100.0, 100.0), inputs({"estimate": "estimated flow"}, "%", -125.0, 125.0)
)


def by_hand() -> tuple[twin.Valve, Side, VirtualClock]:
    clock = VirtualClock()
    side = turned(SIMULATION, WIRING, clock)
    return twin.Valve(side, 9, 0x80, 0.3), side, clock


def linked(bus: str, **settings: Any) -> Any:
    told = {"address": f"virtual:{bus}", "timeout_s": 1.0, "longest_reply_s": 1.0, "watchdog_s": 10.0, **settings}
    return linked_to(j1939_valve, twin, SIMULATION, WIRING, told)


def estimates(bus: str, data: bytes, source: int = 0x80) -> None:
    """Say on the bus what a valve with this address would."""
    with can.Bus(interface="virtual", channel=bus) as other:
        other.send(can.Message(arbitration_id=3 << 26 | 0xFE11 << 8 | source, data=data, is_extended_id=True))


def read_after(bus: str, data: bytes, link: Any) -> float:
    """What is read once the valve has said this."""
    estimates(bus, data)
    return float(link.read()["estimated flow"])


@pytest.fixture(autouse=True)
def _claimed_soon(monkeypatch):
    monkeypatch.setattr(_can_frames, "CLAIM_WAIT_S", 0.02)


@pytest.fixture
def bus(request):
    return str(request.node.name)


@pytest.mark.parametrize(
    ("percent", "text"),
    [
        (0.0, "00 ff 30 ff ff ff ff ff"),
        (40.0, "64 ff 31 ff ff ff ff ff"),  # 100 bits of 0.4 %, extend
        (-100.0, "fa ff 32 ff ff ff ff ff"),  # 250 bits, retract
    ],
)
def test_command_bit_by_bit(percent, text):
    assert j1939_valve.command_frame(percent, "block").hex(" ") == text
    assert j1939_valve.command_frame(percent, "float")[2] == bytes.fromhex(text)[2] | 0x40


def test_valve_nine_has_the_groups_of_the_standard():
    valve, side, clock = by_hand()
    (answer,) = valve.on_frame(0x0CFE3926, bytes.fromhex("64 ff 31 ff ff ff ff ff"))
    assert side.standing("flow command") == 40.0
    assert answer[0] >> 8 & 0x3FFFF == 65049
    clock.sleep_until(0.1)
    claim, (_, data) = list(valve.tick())
    assert claim[0] == 0x18EEFF80
    assert data[0] == 165 and data[1] == 85 and data[2] & 0x0F == 1
    assert list(valve.on_frame(0x0CFE3826, bytes.fromhex("fa ff 31 ff ff ff ff ff"))) == []


def test_valve_blocks_when_commands_stop():
    valve, side, clock = by_hand()
    list(valve.on_frame(0x0CFE3926, bytes.fromhex("64 ff 31 ff ff ff ff ff")))
    clock.sleep_until(0.29)
    list(valve.tick())
    assert side.standing("flow command") == 40.0
    clock.sleep_until(0.31)
    list(valve.tick())
    assert side.standing("flow command") == 0.0


def test_silence_is_an_error_and_others_are_not_believed(bus):
    with linked(bus) as (link, served, _):
        served.behaviour.quirks = Quirks(silent=True)
        with pytest.raises(LinkError, match=r"no estimated flow of valve 1 for 1 s"):
            until(lambda: link.read() is None)  # what it said before may still be good
        estimates(bus, bytes(8), source=0x81)
        with pytest.raises(LinkError, match=r"no estimated flow of valve 1 for 1 s"):
            link.read()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("7d 7d 3e 1f ff ff ff ff", "reports an error"),
        ("7d 7d 30 df ff ff ff ff", "by a fault that it does not recover from"),
    ],
)
def test_error_of_the_valve_is_told(bus, text, message):
    with linked(bus) as (link, served, _):
        served.behaviour.quirks = Quirks(silent=True)
        with pytest.raises(LinkError, match=message):
            until(lambda: read_after(bus, bytes.fromhex(text), link) is None)


def test_valve_that_estimates_no_flow_has_no_measurement(bus):
    with linked(bus) as (link, served, _):
        served.behaviour.quirks = Quirks(silent=True)
        none = bytes.fromhex("ff ff 30 1f ff ff ff ff")
        until(lambda: math.isnan(read_after(bus, none, link)))


@given(st.lists(st.tuples(st.integers(0, 0x1FFFFFFF) | st.just(0x0CFE3926), st.binary(max_size=8)), max_size=20))
def test_hostile_frames_neither_crash_nor_move_an_output(frames):
    valve, side, _ = HOSTILE
    commands = 0
    for identifier, data in frames:
        commands += len(list(valve.on_frame(identifier, data)))
    assert commands or side.standing("flow command") == 0.0
    valve.restart()


HOSTILE = by_hand()


CLAIM = "18EEFF26"
NAME = 0x2000_FF00_FFE0_0001


def test_claim_bit_by_bit():
    """NAME, least significant byte first, from our address to all, with priority 6; requests are those of J1939-21."""
    claim = AddressClaim(0x26, NAME)
    told = (int(CLAIM, 16), bytes.fromhex("01 00 e0 ff 00 ff 00 20"))
    assert claim.claim() == told
    request = bytes.fromhex("00 ee 00")
    assert [claim.answer_to(i, request) for i in (0x18EAFF80, 0x18EA26FE)] == [told, told]
    assert claim.answer_to(0x18EA2780, request) is None
    assert claim.answer_to(0x18EAFF80, bytes.fromhex("da fe 00")) is None


def test_smaller_name_keeps_the_address():
    claim = AddressClaim(0x26, NAME)
    assert claim.answer_to(0x18EEFF27, bytes(8)) is None and claim.lost_to is None
    assert claim.answer_to(0x18EEFF26, (NAME + 1).to_bytes(8, "little")) == claim.claim()
    assert claim.lost_to is None
    sent = claim.answer_to(0x18EEFF26, (NAME - 1).to_bytes(8, "little"))
    assert sent == (0x18EEFFFE, NAME.to_bytes(8, "little")) and claim.lost_to == NAME - 1
    assert claim.answer_to(0x18EEFF26, bytes(8)) is None  # said once


def test_second_program_with_our_name_ends_both():
    claim = AddressClaim(0x26, NAME)
    claim.answer_to(*claim.claim())
    assert claim.lost_to == NAME


def test_every_other_controller_goes_before_a_bench_without_a_name():
    by_fields = {"industry group": default_name() >> 60, "function": default_name() >> 40 & 0xFF}
    assert by_fields == {"industry group": 2, "function": 255}
    assert default_name() > 2 << 60 | 254 << 40 | (1 << 40) - 1 and default_name() < 1 << 63


@contextmanager
def beside(bus: str) -> Iterator[can.BusABC]:
    """Another controller on the bus."""
    other = can.Bus(interface="virtual", channel=bus)
    try:
        yield other
    finally:
        other.shutdown()


def heard(other: can.BusABC, identifier: int) -> list[bytes]:
    """What came with an identifier: a virtual bus has handed on what was sent when sending returns."""
    came = iter(lambda: other.recv(0.0), None)
    return [bytes(message.data) for message in came if message.arbitration_id == identifier]


def claims(name: int) -> can.Message:
    return can.Message(arbitration_id=int(CLAIM, 16), data=name.to_bytes(8, "little"), is_extended_id=True)


def test_address_is_claimed_before_the_first_command(bus, monkeypatch):
    monkeypatch.setattr(_can_frames, "CLAIM_WAIT_S", CLAIM_WAIT_S)
    with beside(bus) as other:
        begun_s = time.monotonic()
        with linked(bus, name=NAME) as (link, _, _):
            link.drive({"flow command": 40.0})
            assert time.monotonic() - begun_s > 0.25
        ours = [m for m in iter(lambda: other.recv(0.0), None) if m.arbitration_id & 0xFF == 0x26]
    assert [m.arbitration_id for m in ours] == [int(CLAIM, 16), 0x18EA8026, 0x0CFE3126]
    assert bytes(ours[0].data) == NAME.to_bytes(8, "little")


def test_address_that_is_lost_ends_the_commands(bus):
    with beside(bus) as other, linked(bus, name=NAME) as (link, _, _):
        link.drive({"flow command": 40.0})
        other.send(claims(NAME + 1))
        link.drive({"flow command": 40.0})
        other.send(claims(7))
        for call in (link.read, lambda: link.drive({"flow command": 0.0})):
            with pytest.raises(LinkError, match="address 0x26 belongs to a controller with NAME 0x0000000000000007"):
                call()
        commands = heard(other, 0x0CFE3126)
    assert len(commands) == 2


def test_valve_that_restarted_is_told_before_it_is_driven_on(bus):
    with linked(bus) as (link, served, side), beside(bus) as other:

        def is_driven():
            link.drive({"flow command": 40.0})
            return side.standing("flow command") == 40.0

        def restarts():
            until(is_driven)
            served.behaviour.quirks = Quirks(reboot=True)
            until(lambda: side.standing("flow command") == 0.0)
            served.behaviour.quirks = Quirks()
            until(lambda: heard(other, 0x18EEFF80))

        other.send(can.Message(arbitration_id=0x18EAFFFE, data=bytes.fromhex("00 ee 00"), is_extended_id=True))
        until(lambda: is_driven() and heard(other, 0x18EEFF80))  # it was asked
        with pytest.raises(LinkError, match="restarted"):
            until(restarts)  # the claim after one may count as an answer to a request that it has not heard
        link.drive({"flow command": 0.0})
        until(is_driven)  # it is said once


def test_request_in_a_pause_is_answered_with_the_next_command(bus):
    with beside(bus) as other, linked(bus, name=NAME) as (link, _, _):
        while other.recv(0.0) is not None:
            pass
        other.send(can.Message(arbitration_id=0x18EAFFFE, data=bytes.fromhex("00 ee 00"), is_extended_id=True))
        link.drive({"flow command": 0.0})
        assert heard(other, int(CLAIM, 16)) == [NAME.to_bytes(8, "little")]


def test_valve_claims_defends_and_loses_its_address():
    valve, side, clock = by_hand()
    ((identifier, name),) = list(valve.tick())
    assert identifier == 0x18EEFF80
    assert list(valve.on_frame(0x18EAFFFE, bytes.fromhex("00 ee 00"))) == [(identifier, name)]
    assert list(valve.on_frame(0x18EEFF80, bytes(7) + b"\x40")) == [(identifier, name)]  # a larger NAME
    list(valve.on_frame(0x0CFE3926, bytes.fromhex("64 ff 31 ff ff ff ff ff")))
    assert side.standing("flow command") == 40.0
    assert list(valve.on_frame(0x18EEFF80, bytes(8))) == [(0x18EEFFFE, name)]
    assert side.standing("flow command") == 0.0
    assert list(valve.on_frame(0x0CFE3926, bytes.fromhex("64 ff 31 ff ff ff ff ff"))) == []
    clock.sleep_until(0.2)
    assert list(valve.tick()) == [] and side.standing("flow command") == 0.0


def test_settings_that_cannot_be_are_told():
    found = [text for _, text in j1939_valve.faults(j1939_valve.Settings(address="can0", source=0x80))]
    assert "INTERFACE:CHANNEL" in found[0] and "0x80" in found[1]
