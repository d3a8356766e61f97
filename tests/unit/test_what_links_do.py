"""What real links do, against devices that share nothing with the drivers; the page names a test for every row."""

from __future__ import annotations

import math
import re
import time
from pathlib import Path

import can
import pytest

from drivers import can as can_driver
from drivers import scpi as scpi_driver
from drivers import text as text_driver
from drivers._start_up import once_started
from drivers.modbus import LineSettings, ModbusLink
from hil.daq.channel import Wiring
from hil.errors import DeviceLostError, LinkError
from tests.channels import inputs
from tests.described import written
from tests.foreign_line import ForeignLine, Tables, ended, serial_frame, tcp_frame
from tests.links import free_port
from tests.modbus_pair import MODEL, WIRING

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "reference" / "links.md").read_text(encoding="utf-8")

METER = """\
protocol = "{protocol}"
summary = "one input"
[text]
hello = "*IDN?"
identity = "{{any}}"
[terminals.in]
direction = "in"
unit = "V"
range = [0, 10]
ask = "READ?"
"""


def link_to(address: str, **more: object) -> ModbusLink:
    told = {"address": address, "timeout_s": 1.0, "longest_reply_s": 1.0, **more}
    return ModbusLink(LineSettings.model_validate(told), WIRING, MODEL)


@pytest.mark.parametrize("kind", ["the last one again before it", "itself twice", "the last one again behind it"])
@pytest.mark.parametrize("transport", ["tcp", "rtu"])
def test_two_answers_in_one_segment(kind, transport):
    """What is read is the answer to this request, or no answer; never the one before."""
    device, last = Tables(inputs={0: 100}, holding={8: 0}), [b""]

    def answer(frame):
        now = device.on_tcp(frame) if transport == "tcp" else device.on_serial(frame)
        before, last[0] = last[0], now
        return {"itself twice": now + now, "the last one again before it": before + now}.get(kind, now + before)

    with ForeignLine(answer, tcp_frame if transport == "tcp" else serial_frame) as line:
        scheme = "" if transport == "tcp" else "socket://"
        link = link_to(f"{scheme}127.0.0.1:{line.port}", transport=transport)
        right = 0
        for value in range(100, 108):
            device.inputs[0] = value
            try:
                read = link.read()["t"]
            except LinkError:
                continue
            assert read == value
            right += 1
        assert right or transport == "rtu"
        link.close()


def test_a_device_that_answers_only_after_its_start_up():
    device, on_s = Tables(inputs={0: 20}, holding={8: 0}), time.monotonic() + 0.6
    starting = lambda frame: device.on_tcp(frame) if time.monotonic() > on_s else b""  # noqa: E731
    with ForeignLine(starting) as line:
        link = link_to(f"127.0.0.1:{line.port}", startup_s=60.0)
        assert link.read() == {"t": 20.0}
        link.close()
    with (
        ForeignLine(lambda _frame: b"") as line,
        pytest.raises(LinkError, match=r"after [\d.]+ s of its start-up: no valid"),
    ):
        link_to(f"127.0.0.1:{line.port}", startup_s=0.3)
    with pytest.raises(DeviceLostError, match="cannot be reached"):
        link_to(f"127.0.0.1:{free_port()}")


@pytest.mark.parametrize("protocol", ["text", "scpi"])
def test_a_line_of_text_waits_for_a_start_up_too(protocol, tmp_path):
    written(tmp_path, "meter.toml", METER.format(protocol=protocol))
    module, on_s = (text_driver if protocol == "text" else scpi_driver), [math.inf]
    answers = {b"*CLS;*IDN?\n": b"A,B,1,1\n", b"*IDN?\n": b"A,B,1,1\n"}
    starting = lambda came: answers.get(came) if time.monotonic() > on_s[0] else b""  # noqa: E731
    with ForeignLine(starting, ended(b"\n")) as line:
        settings = {"model": str(tmp_path / "meter.toml"), "timeout_s": 1.0, "longest_reply_s": 1.0,
                    "address": f"socket://127.0.0.1:{line.port}"}  # fmt: skip
        wiring = Wiring({}, inputs(["in"], low=0.0))
        with pytest.raises(LinkError, match="no answer within"):
            module.open_link(module.Settings.model_validate(settings), wiring)
        on_s[0] = time.monotonic() + 0.3
        link = module.open_link(module.Settings.model_validate(settings | {"startup_s": 60.0}), wiring)
        assert link.identity == "A,B,1,1"
        link.close()


def test_what_is_gone_at_first_is_waited_for_and_then_told():
    failures = [DeviceLostError("cannot be reached"), LinkError("no answer")]

    def ask():
        if failures:
            raise failures.pop(0)
        return "here"

    assert once_started(5.0, ask) == "here"
    failures += [DeviceLostError("cannot be reached")] * 9
    with pytest.raises(DeviceLostError, match=r"after 0\.\d+ s of its start-up: cannot be reached"):
        once_started(0.02, ask)
    with pytest.raises(DeviceLostError, match=r"^cannot be reached"):
        once_started(0.0, ask)


def test_a_gateway_that_no_longer_reaches_its_device():
    device, refused = Tables(inputs={0: 20}, holding={8: 0}), [False]

    def answer(frame):
        return frame[:4] + bytes([0, 3, frame[6], frame[7] | 0x80, 11]) if refused[0] else device.on_tcp(frame)

    with ForeignLine(answer) as line:
        link = link_to(f"127.0.0.1:{line.port}")
        assert link.read() == {"t": 20.0}
        refused[0] = True
        for call in (link.read, link.standing):
            with pytest.raises(LinkError, match=r"exception 11 \(gateway: the device behind it does not answer; check"):
                call()
        link.close()


def test_an_answer_of_a_function_that_is_none():
    device, odd = Tables(inputs={0: 20}, holding={8: 0}), [False]

    def answer(frame):
        said = device.on_tcp(frame)
        return said[:7] + bytes([66]) + said[8:] if said and odd[0] else said

    with ForeignLine(answer) as line:
        link = link_to(f"127.0.0.1:{line.port}")
        odd[0] = True
        with pytest.raises(LinkError, match=r"no valid answer within .* s: what came is none \(.* 42 "):
            link.read()
        link.close()


def test_error_frames_of_a_wrong_bit_rate_or_an_overrun_are_no_readings(tmp_path):
    """An interface gives them for a disturbed bus, error-passive, and frames that it lost."""
    wiring = Wiring({}, inputs({"s": "engine speed"}, "1/min", 0.0, 8031.875))
    bus = can.Bus(interface="virtual", channel=tmp_path.name)
    told = {"model": "j1939-fluids", "address": f"virtual:{tmp_path.name}", "timeout_s": 1.0, "longest_reply_s": 1.0}
    link = can_driver.open_link(can_driver.Settings.model_validate(told), wiring)
    try:
        for data in (b"\0\x04\0\0\0\0\0\0", b"\0\x30\0\0\0\0\0\0", b"\0\x01\0\0\0\0\0\0"):  # as SocketCAN has them
            bus.send(can.Message(arbitration_id=0x0CF00400, data=data, is_extended_id=True, is_error_frame=True))
        with pytest.raises(LinkError, match=r"no ElectronicEngineController1\.EngineSpeed for 0\.1 s"):
            link.read()
        frame = bytes.fromhex("FF FF FF 68 13 FF FF FF")
        time.sleep(1.1)  # late answers are over
        bus.send(can.Message(arbitration_id=0x0CF00400, data=frame, is_extended_id=True))
        assert link.read() == {"engine speed": 621.0}
    finally:
        link.close()
        bus.shutdown()


ROWS = [line for line in PAGE.splitlines() if line.startswith("| ") and "`tests/" in line]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.split("|")[1].strip()[:40])
def test_each_row_of_the_page_is_a_test(row):
    found = re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", row)
    assert found
    for file, name in found:
        assert f"def {name}(" in (ROOT / file).read_text(encoding="utf-8"), (file, name)


def test_the_page_has_every_situation():
    assert len(ROWS) >= 22
