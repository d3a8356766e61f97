"""The auxiliary valve on J1939 and its twin: messages bit by bit, fail-safe state, what is not believed."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers import j1939_valve
from hil.clock import VirtualClock
from hil.daq.channel import InputChannel, OutputChannel, Wiring
from hil.errors import LinkError
from sim_devices import j1939_valve as twin
from sim_devices._field import Field, Side
from sim_devices._quirks import Quirks
from sim_devices._simulation import Simulation

SIMULATION = Simulation.model_validate({
    "plant": "brevini-hpv41",
    "instruments": {
        "command": {"direction": "out", "signal": "command", "unit": "%"},
        "estimate": {"signal": "command", "unit": "%"},
    },
})  # fmt: skip
WIRING = Wiring(
    {"command": OutputChannel("command", "flow command", "value", "%", -100.0, 100.0)},
    {"estimate": InputChannel("estimate", "estimated flow", "value", "%", -125.0, 125.0)},
)


def by_hand() -> tuple[twin.Valve, Side, VirtualClock]:
    clock = VirtualClock()
    side = Field(SIMULATION, {"": WIRING}, clock).side("")
    return twin.Valve(side, 9, 0x80, 0.3), side, clock


@contextmanager
def linked(bus: str, **settings: Any) -> Iterator[tuple[Any, Any, Side]]:
    side = twin.world(SIMULATION, {"": WIRING}).side("")
    told = {"address": f"virtual:{bus}", **settings}
    served = twin.serve(told, side, Quirks())
    link = j1939_valve.open_link(j1939_valve.Settings.model_validate(told), WIRING)
    try:
        yield link, served, side
    finally:
        link.close()
        served.close()


@pytest.fixture
def bus(request: pytest.FixtureRequest) -> str:
    return str(request.node.name)


@pytest.mark.parametrize(
    ("percent", "text"),
    [
        (0.0, "00 ff 30 ff ff ff ff ff"),
        (40.0, "64 ff 31 ff ff ff ff ff"),  # 100 bits of 0.4 %, extend
        (-100.0, "fa ff 32 ff ff ff ff ff"),  # 250 bits, retract
    ],
)
def test_command_bit_by_bit(percent: float, text: str) -> None:
    assert j1939_valve.command_frame(percent, "block").hex(" ") == text
    assert j1939_valve.command_frame(percent, "float")[2] == bytes.fromhex(text)[2] | 0x40


def test_valve_nine_has_the_groups_of_the_standard() -> None:
    valve, side, clock = by_hand()
    (answer,) = valve.on_frame(0x0CFE3926, bytes.fromhex("64 ff 31 ff ff ff ff ff"))
    assert side.standing("flow command") == 40.0
    assert answer[0] >> 8 & 0x3FFFF == 65049
    clock.sleep_until(0.1)
    ((_, data),) = list(valve.tick())
    assert data[0] == 165 and data[1] == 85 and data[2] & 0x0F == 1
    assert list(valve.on_frame(0x0CFE3826, bytes.fromhex("fa ff 31 ff ff ff ff ff"))) == []


def test_valve_blocks_when_commands_stop() -> None:
    valve, side, clock = by_hand()
    list(valve.on_frame(0x0CFE3926, bytes.fromhex("64 ff 31 ff ff ff ff ff")))
    clock.sleep_until(0.29)
    list(valve.tick())
    assert side.standing("flow command") == 40.0
    clock.sleep_until(0.31)
    list(valve.tick())
    assert side.standing("flow command") == 0.0


def test_what_is_driven_is_estimated(bus: str) -> None:
    with linked(bus) as (link, _, side):
        for percent in (40.0, -62.0, 0.0):
            link.drive({"flow command": percent})
            time.sleep(0.13)
            assert side.standing("flow command") == pytest.approx(percent, abs=0.2)
            assert link.read()["estimated flow"] == pytest.approx(percent, abs=0.7)


def test_silence_is_an_error_and_others_are_not_believed(bus: str) -> None:
    with linked(bus) as (link, served, _):
        served.behaviour.quirks = Quirks(silent=True)
        served._send(3 << 26 | 0xFE11 << 8 | 0x81, bytes(8))
        with pytest.raises(LinkError, match=r"no estimated flow of valve 1 for 0\.3 s"):
            link.read()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("7d 7d 3e 1f ff ff ff ff", "reports an error"),
        ("7d 7d 30 df ff ff ff ff", "by a fault that it does not recover from"),
        ("ff ff 30 1f ff ff ff ff", "estimates no flow"),
    ],
)
def test_error_of_the_valve_is_told(bus: str, text: str, message: str) -> None:
    with linked(bus) as (link, _, _), pytest.raises(LinkError, match=message):
        link._estimated(bytes.fromhex(text))


@given(st.lists(st.tuples(st.integers(0, 0x1FFFFFFF) | st.just(0x0CFE3926), st.binary(max_size=8)), max_size=20))
def test_hostile_frames_neither_crash_nor_move_an_output(frames: list[tuple[int, bytes]]) -> None:
    valve, side, _ = HOSTILE
    commands = 0
    for identifier, data in frames:
        commands += len(list(valve.on_frame(identifier, data)))
    assert commands or side.standing("flow command") == 0.0
    valve.restart()


HOSTILE = by_hand()


def test_settings_that_cannot_be_are_told() -> None:
    found = [text for _, text in j1939_valve.faults(j1939_valve.Settings(address="can0", source=0x80))]
    assert "INTERFACE:CHANNEL" in found[0] and "0x80" in found[1]
