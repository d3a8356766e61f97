"""The drivers on CAN when the bus falls ill, echoes, or carries frames of others."""

from __future__ import annotations

import logging
import struct
import threading
import time
import traceback
from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import Any

import can
import pytest

from drivers import _can_frames, canopen_valve, j1939_valve
from drivers._can import open_bus
from drivers._edge import message_of
from drivers._node_objects import NodeObjects
from drivers._sdo import Sdo
from hil.daq.channel import Wiring
from hil.description.eds import Dictionary
from hil.errors import DeviceLostError, HardwareError, LinkError
from sim_devices import canopen_valve as canopen_twin
from sim_devices import j1939_valve as j1939_twin
from sim_devices._quirks import Quirks
from sim_devices._simulation import Simulation
from tests.channels import inputs, outputs
from tests.sick_bus import SickBus
from tests.waits import until

pytestmark = pytest.mark.xdist_group("waits for lines")  # for clocks: on one worker, beside others that compute

SIMULATION = Simulation.model_validate({
    "plant": "brevini-hpv41",
    "instruments": {"out": {"direction": "out", "signal": "command", "unit": "%"},
                    "in": {"signal": "command", "unit": "%"}},
})  # fmt: skip
CANOPEN = Wiring(outputs({"out": "set point"}, "%", -100.0, 100.0), inputs({"in": "actual value"}, "%", -200.0, 199.99))
J1939 = Wiring(
    outputs({"out": "flow command"}, "%", -100.0, 100.0), inputs({"in": "estimated flow"}, "%", -125.0, 125.0)
)
KINDS = {"canopen": (canopen_valve, canopen_twin, CANOPEN), "j1939": (j1939_valve, j1939_twin, J1939)}
ILL = (
    can.CanOperationError("Failed to transmit: No buffer space available", 105),
    can.CanOperationError("Bus error: the CAN controller is in bus-off state", 16),
    OSError(19, "No such device"), struct.error("short"), ValueError("garbled"), RuntimeError(), KeyError("x"),
)  # fmt: skip


@pytest.fixture(autouse=True)
def _sick(monkeypatch):
    monkeypatch.setitem(can.interfaces.BACKENDS, "sick", ("tests.sick_bus", "SickBus"))
    monkeypatch.setattr(can.util, "VALID_INTERFACES", can.VALID_INTERFACES | {"sick"})
    monkeypatch.setattr(SickBus, "illness", {})
    monkeypatch.setattr(SickBus, "echoes", False)
    monkeypatch.setattr(_can_frames, "CLAIM_WAIT_S", 0.02)


@pytest.fixture
def bus(request):
    return str(request.node.name)


@contextmanager
def linked(kind: str, bus: str, **more: Any) -> Iterator[Any]:
    driver, twin, wiring = KINDS[kind]
    with closing(twin.serve({"address": f"virtual:{bus}"}, twin.world(SIMULATION, {"": wiring}).side(""), Quirks())):
        told = {"address": f"sick:{bus}", "timeout_s": 1.0, "longest_reply_s": 1.0, "watchdog_s": 60.0, **more}
        with closing(driver.open_link(driver.Settings.model_validate(told), wiring)) as link:
            yield link


def moved(kind: str, link: Any, percent: float) -> dict[str, float]:
    """Drive, and read until what is read is what was driven."""
    (terminal,) = (channel.terminal for channel in KINDS[kind][2].outputs.values())
    read: dict[str, float] = {}

    def follows() -> bool:
        link.drive({terminal: percent})
        read.update(link.read())
        return abs(next(iter(read.values())) - percent) < 1.0

    until(follows)
    return read


@pytest.mark.parametrize("where", ["send", "recv"])
@pytest.mark.parametrize("error", ILL, ids=lambda e: f"{type(e).__name__}")
@pytest.mark.parametrize("kind", KINDS)
def test_a_bus_that_falls_ill_is_a_lost_device_by_name(kind, error, where, bus):
    threads = {thread.name for thread in threading.enumerate()}
    with linked(kind, bus) as link:
        moved(kind, link, 20.0)
        SickBus.illness[where] = error
        (terminal,) = (channel.terminal for channel in KINDS[kind][2].outputs.values())
        calls = {"send": lambda: link.drive({terminal: 0.0}), "recv": lambda: [link.read() for _ in range(3)]}
        with pytest.raises(DeviceLostError, match=rf"^sick:{bus.split('[')[0]}.*: the bus is gone: .+"):
            calls[where]()  # one answer may have been on its way
        if kind == "canopen":
            with pytest.raises(DeviceLostError, match="the bus is gone: "):
                link.standing()
        SickBus.illness.clear()
        time.sleep(0.1)
        if kind == "j1939":  # the valve of the profile has its own watchdog and is in its fault state by then
            assert next(iter(moved(kind, link, -20.0).values())) == pytest.approx(-20.0, abs=1.0)
    assert {thread.name for thread in threading.enumerate() if "notifier" in thread.name} <= threads


@pytest.mark.parametrize("where", ["send", "recv"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_bus_that_is_ill_at_opening_is_named_and_let_go_of(kind, where, bus):
    SickBus.illness[where] = ILL[0]
    with pytest.raises(DeviceLostError, match=r"the bus is gone: .*No buffer space"), linked(kind, bus):
        pass
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("can.notifier")]


def test_no_such_interface_is_named():
    settings = j1939_valve.Settings(address="neverheard:0")
    with pytest.raises(DeviceLostError, match="neverheard:0: this bus cannot be opened: "):
        j1939_valve.open_link(settings, J1939)


def test_frames_with_29_bits_belong_to_others(bus):
    """A frame of J1939 whose identifier is 0x181 is no process data of node 1."""
    with can.Bus(interface="virtual", channel=bus) as other, linked("canopen", bus) as link:
        moved("canopen", link, 40.0)
        stop = threading.Event()

        def chatter():
            while not stop.wait(0.0005):
                for identifier in (0x181, 0x081, 0x581):
                    other.send(can.Message(arbitration_id=identifier, data=bytes(8), is_extended_id=True))

        thread = threading.Thread(target=chatter)
        thread.start()
        try:
            for _ in range(30):
                assert link.read()["actual value"] == pytest.approx(40.0, abs=0.1)
                assert link.standing()["set point"] == pytest.approx(40.0, abs=0.1)
                link.drive({"set point": 40.0})
        finally:
            stop.set()
            thread.join()


def test_process_data_of_another_length_are_no_answer(bus):
    """Another program has it carry the actual value alone."""
    with can.Bus(interface="virtual", channel=bus) as other, linked("canopen", bus) as link:

        def send(identifier, data):
            other.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))

        def receive(wait_s):
            while (message := other.recv(wait_s)) is not None:
                wait_s = 0.0
                remap.take(message.arbitration_id, bytes(message.data))

        remap = Sdo(1, 1.0, send, receive)
        for sub, entry in ((0, b"\x00"), (1, struct.pack("<I", 0x63010110)), (0, b"\x01")):
            remap.transfer("download", 0x1A00, sub, entry)
        with pytest.raises(LinkError, match="TPDO 1 has 2 bytes, not 4"):
            link.read()


@pytest.mark.parametrize(
    "garbled", [b"", b"\x00", b"\xff" * 8, b"\x43\x00\x63", b"\x80" + bytes(7), b"\x41" + bytes(7)]
)
def test_whatever_answers_a_question_is_a_value_or_a_named_error(garbled):
    def answers(_wait_s):
        server.take(0x581, garbled)

    server = Sdo(1, 0.1, lambda *_: None, answers)
    with pytest.raises(HardwareError):
        NodeObjects(server, Dictionary(), "other").signed(0x6300, 1)


@pytest.mark.parametrize("kind", KINDS)
def test_an_adapter_that_echoes(kind, bus, monkeypatch):
    monkeypatch.setattr(SickBus, "echoes", True)
    if kind == "j1939":
        with (
            pytest.raises(LinkError, match=r"our own claim of address 0x26 came back: .* say echo = true"),
            linked(kind, bus),
        ):
            pass
    with linked(kind, bus, **({"echo": True} if kind == "j1939" else {})) as link:
        assert next(iter(moved(kind, link, 30.0).values())) == pytest.approx(30.0, abs=1.0)


def test_with_an_echo_another_controller_still_takes_the_address(bus, monkeypatch):
    monkeypatch.setattr(SickBus, "echoes", True)
    with can.Bus(interface="virtual", channel=bus) as other, linked("j1939", bus, echo=True) as link:
        moved("j1939", link, 30.0)
        other.send(can.Message(arbitration_id=0x18EEFF26, data=bytes(8), is_extended_id=True))
        with pytest.raises(LinkError, match="belongs to a controller with NAME 0x0000000000000000"):
            moved("j1939", link, 30.0)


@pytest.mark.parametrize(("kind", "said"), [("canopen", "node 1, vendor 0x"), ("j1939", "NAME 0x2000810000000001")])
def test_what_a_valve_says_of_itself(kind, said, bus):
    with linked(kind, bus) as link:
        moved(kind, link, 10.0)
        assert link.identity.startswith(said)


def test_frames_are_logged_for_who_listens_and_nobody_else_is_silenced(bus, caplog):
    before = {name: logging.getLogger(name).level for name in ("can", "canopen")}
    for kind in KINDS:
        with linked(kind, bus) as link:
            moved(kind, link, 10.0)
            assert not [record for record in caplog.records if record.name.startswith("hil.link")]
            with caplog.at_level(logging.DEBUG, logger="hil.link"):
                moved(kind, link, 10.0)
        names = {record.name for record in caplog.records if record.name.startswith("hil.link")}
        assert names == {f"hil.link.{kind}_valve.sick:{bus}"}
        caplog.clear()
    assert {name: logging.getLogger(name).level for name in before} == before


def test_traceback_that_a_library_puts_into_its_text_is_left_out():
    try:
        float("0*000")
    except ValueError:
        error = OSError(f"Could not read from the bus:\n{traceback.format_exc()}")
    assert message_of(error) == "Could not read from the bus: ValueError: could not convert string to float: '0*000'"
    assert message_of(OSError("two\n lines")) == "two lines"


def test_a_bus_that_says_no_end_of_things_is_told_in_one_short_line(monkeypatch):
    def endless(**_settings):
        raise can.CanError("Expected '< hi >' got: " + "< hi >" * 5000)

    monkeypatch.setattr(can, "Bus", endless)
    with pytest.raises(DeviceLostError) as raised:
        open_bus("virtual:x", 500_000)
    assert str(raised.value).startswith("virtual:x: this bus cannot be opened: Expected '< hi >' got:")
    assert len(str(raised.value)) < 300
