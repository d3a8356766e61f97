"""The drivers of text lines against devices that share nothing with them: lost bytes, overloads, settings, echoes."""

from __future__ import annotations

import logging
import math
import struct
import termios
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from typing import Any

import pytest

from drivers import _line as line_module
from drivers import ascii_module, scpi
from drivers._line import Line, SerialSettings
from hil.daq.channel import Wiring
from hil.errors import DeviceLostError, HardwareError, LinkError
from tests import channels
from tests.foreign_line import BrokenPort, ForeignLine, ended
from tests.links import free_port
from tests.waits import side_by_side

pytestmark = pytest.mark.xdist_group("waits for descriptions")  # for clocks: on one worker, beside others that compute

READINGS = ">+01.234-05.678+00.000+09.999-09.999+04.000+03.210-00.001"
CALM = {"timeout_s": 1.0, "longest_reply_s": 1.0}
ENDS = {"LF": b"\n", "CRLF": b"\r\n", "CR": b"\r"}


class Module:
    """An ADAM-4017 or 4024 as its manual prints it: a line in, a line out."""

    def __init__(self, settings: str = "080600", name: str = "4017") -> None:
        self.told: dict[str, str] = {}
        self.settings, self.name, self.readings = settings, name, READINGS

    def __call__(self, came: bytes) -> bytes:
        request = came.decode().removesuffix("\r")
        if request.startswith("#01C"):
            self.told[request[4]] = request[5:]
            return b"!01\r"
        if request.startswith("$016C"):
            return f"!01{self.told.get(request[5], '+00.000')}\r".encode()
        answers = {"$01M": f"!01{self.name}", "$012": f"!01{self.settings}", "#01": self.readings, "$018C0": "!01C032"}
        return f"{answers[request]}\r".encode()


class Instrument:
    """A direct-current source: answers by header, one error in its queue if there is one."""

    def __init__(self, amperes: str = "1.5", volts: str = "12.0", error: str = '+0,"No error"') -> None:
        self.amperes, self.volts, self.error, self.set, self.step = amperes, volts, error, "0", 0.0
        self.end = b"\n"

    def __call__(self, came: bytes) -> bytes:
        assert came.endswith(self.end)
        answers = []
        for unit in came.decode().strip().split(";"):
            header, _, value = unit.lstrip(":").partition(" ")
            if header == "SOUR:CURR":
                asked = float(value)
                self.set = f"{round(asked / self.step) * self.step:.5f}" if self.step else value
            asked_for = {"*IDN?": "Maker,DC-1,42,1.0", "SOUR:CURR?": self.set, "MEAS:CURR?": self.amperes,
                         "MEAS:VOLT?": self.volts, "SYST:ERR?": self.error}  # fmt: skip
            answers += [asked_for[header]] if header in asked_for else []
        return ";".join(answers).encode() + self.end if answers else b""


def inputs(*terminals: str) -> Wiring:
    return Wiring({}, channels.inputs(terminals))


OUT = Wiring(channels.outputs(["ao0"]), {})
COIL = Wiring(
    channels.outputs(["current"], "A", 0.0, 3.0),
    channels.inputs(["coil current"], "A", 0.0, 3.2) | channels.inputs(["coil voltage"], low=0.0, high=36.0),
)


@contextmanager
def linked(
    driver: Any, model: str, answer: Callable[[bytes], bytes | None], wiring: Wiring, **more: Any
) -> Iterator[Any]:
    end = ENDS["CR" if driver is ascii_module else more.get("end", "LF")]
    with ForeignLine(answer, ended(end)) as line:
        told = {"model": model, "address": f"socket://127.0.0.1:{line.port}", **CALM, **more}
        with closing(driver.open_link(driver.Settings.model_validate(told), wiring)) as link:
            yield link


def module(device: Callable[[bytes], bytes | None], wiring: Wiring, model: str = "adam-4017", **more: Any) -> Any:
    return linked(ascii_module, model, device, wiring, **more)


def source(device: Callable[[bytes], bytes | None], **more: Any) -> Any:
    return linked(scpi, "dc-source", device, COIL, **more)


def test_inputs_are_read_in_the_one_form_that_the_manual_has():
    with module(Module(), inputs("ai0", "ai4", "ai7")) as link:
        assert link.read() == {"ai0": 1.234, "ai4": -9.999, "ai7": -0.001}
        assert link.identity == "4017 at 01"


def test_readings_with_a_lost_byte_are_no_answer():
    def reads(lost):
        device = Module()
        with module(device, inputs("ai0")) as link:
            device.readings = READINGS[:lost] + READINGS[lost + 1 :]
            with pytest.raises(LinkError):
                link.read()

    side_by_side(reads, range(len(READINGS)))


@pytest.mark.parametrize(("request_of", "count"), [("#01C0", 4), ("$016C0", 11)])
def test_an_acknowledgement_or_read_back_with_a_lost_byte_is_no_answer(request_of, count):
    def asks(lost):
        device, spoils = Module(name="4024"), [False]

        def spoiled(came):
            answer = device(came)
            spoil = spoils[0] and came.decode().startswith(request_of)
            return answer[:lost] + answer[lost + 1 :] if spoil else answer

        with module(spoiled, OUT, "adam-4024") as link:
            link.drive({"ao0": 5.0})
            spoils[0] = True
            with pytest.raises(LinkError):
                link.drive({"ao0": 5.0}) if request_of == "#01C0" else link.standing()
            spoils[0] = False
            assert link.standing() == {"ao0": 5.0}

    side_by_side(asks, range(count))


@pytest.mark.parametrize(
    ("said", "read"),
    [("+9999", math.inf), ("-0000", -math.inf), ("+9999.9", math.inf), ("-9999.9", -math.inf), ("+09.999", 9.999)],
)
def test_what_a_module_says_beyond_its_range_is_no_number(said, read):
    device = Module()
    device.readings = ">" + said + 7 * "+00.000"
    with module(device, inputs("ai0", "ai1")) as link:
        assert link.read() == {"ai0": read, "ai1": 0.0}


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ("070600", r"type 07 \(4 … 20 mA\) and format engineering units"),
        ("0B0600", r"type 0B \(±500 mV\)"),
        ("080601", r"type 08 \(±10 V\) and format % of full scale; .* set it with %0101080600"),
        ("080602", "format hexadecimal"),
    ],
)
def test_a_module_that_is_set_otherwise_is_refused_at_opening(settings, says):
    with pytest.raises(LinkError, match=says), module(Module(settings), inputs("ai0")):
        pass


def test_an_echo_is_named_and_a_setting_helps():
    device = Module()
    with (
        pytest.raises(LinkError, match="what was sent came back: the adapter echoes, say echo = true"),
        module(lambda came: came + device(came) if came != b"$01M\r" else came, inputs("ai0")),
    ):
        pass
    with module(lambda came: came + device(came), inputs("ai0"), echo=True) as link:
        assert [link.read()["ai0"] for _ in range(3)] == [1.234] * 3
    with module(device, inputs("ai0"), echo=True) as link:  # an adapter that has it switched off
        assert link.read()["ai0"] == 1.234


def test_a_pause_between_frames_and_noise_around_them():
    device, answered_s = Module(), [0.0]

    def slow(came):
        if time.monotonic() - answered_s[0] < 0.3:
            return b""
        answered_s[0] = time.monotonic()
        return b"\xff\x00" + device(came) + b"\n\x00"

    with module(slow, inputs("ai0"), pause_s=0.35) as link:
        assert [link.read()["ai0"] for _ in range(3)] == [1.234] * 3
    with pytest.raises(LinkError, match=r"no answer within .*may need a pause between frames: say pause_s"):
        module(slow, inputs("ai0")).__enter__()
    with pytest.raises(LinkError, match=r"no answer within [\d.]+ s$"):
        module(lambda _came: b"", inputs("ai0")).__enter__()


def test_what_has_no_answer_waits_for_the_pause_too():
    came_s = []

    def device(came):
        came_s.append(time.monotonic())
        return b"1\n" if came == b"?\n" else b""

    with ForeignLine(device, ended(b"\n")) as line:
        settings = SerialSettings(address=f"socket://127.0.0.1:{line.port}", pause_s=0.3, **CALM)
        port = Line(settings, "\n", "\n", driver="text")
        assert port.ask("?") == "1"
        port.tell("0")
        assert port.ask("?") == "1"
        port.close()
    assert min(came_s[1] - came_s[0], came_s[2] - came_s[1]) > 0.29


@pytest.mark.parametrize(
    ("said", "read"),
    [
        ("+9.9E37", math.inf), ("-9.9E37", -math.inf), ("9.90000000E+37", math.inf), ("9.91E37", math.nan),
        ("OL", math.inf), ("-OL", -math.inf), ("nan", math.nan), ("OVLD", math.inf), ("+1.50000E+00", 1.5),
        (" 1.5", 1.5), ("-.25", -0.25), ("3", 3.0),
    ],
)  # fmt: skip
def test_an_overload_is_no_number(said, read):
    with source(Instrument(amperes=said)) as link:
        found = link.read()
        assert found["coil current"] == pytest.approx(read, nan_ok=True) and found["coil voltage"] == 12.0
        assert link.identity == "Maker,DC-1,42,1.0"


@pytest.mark.parametrize("said", ["", "1,5", "1.5 A", "x", "1_0", "++1", "0x10", "1.5;2.5"])
def test_what_is_no_number_is_no_answer(said):
    device = Instrument()
    with source(device) as link:
        device.amperes = said
        with pytest.raises(LinkError):
            link.read()


@pytest.mark.parametrize("none", ['0,"No error"', '+0, "No error"', '0 , "No error; queue empty"'])
def test_no_error_in_many_spellings(none):
    with source(Instrument(error=none)) as link:
        link.drive({"current": 1.0})
        assert link.standing() == {"current": 1.0}


def test_an_error_text_with_a_semicolon_is_told_whole():
    with (
        source(Instrument(error='-222,"Data out of range; ""CURR"" 5 A"')) as link,
        pytest.raises(LinkError, match=r'-222 Data out of range; ""CURR"" 5 A'),
    ):
        link.drive({"current": 1.0})


def test_a_source_with_coarse_steps_works_when_they_are_said(half_a_second_later):
    device = Instrument()
    device.step = 0.01
    for step, works in ((0.0, False), (0.01, True)):
        with source(device, step=step) as link:
            link.drive({"current": 1.234})
            half_a_second_later()
            if works:
                assert link.read()["coil current"] == 1.5
                continue
            with pytest.raises(LinkError, match="or it sets in steps: then say step"):
                link.read()


@pytest.mark.parametrize(("end", "answers_with"), [*ENDS.items(), ("LF", b"\r\n")])
def test_line_ends(end, answers_with):
    device = Instrument()
    device.end = ENDS[end]
    with source(lambda came: device(came).replace(device.end, answers_with), end=end) as link:
        assert [link.read()["coil current"] for _ in range(3)] == [1.5] * 3


@pytest.mark.parametrize(
    "error",
    [OSError(5, "Input/output error"), termios.error(5, "gone"), TypeError("None"), struct.error("short"), ValueError(),
     KeyError("x"), RuntimeError("reentrant"), EOFError()],
    ids=lambda e: type(e).__name__,
)  # fmt: skip
@pytest.mark.parametrize("make", ["module", "source"])
def test_whatever_the_port_raises_is_a_named_error(make, error, monkeypatch):
    linked_to = module(Module(name="4024"), OUT, "adam-4024") if make == "module" else source(Instrument())
    with linked_to as link:
        (terminal,) = link.standing()
        link.line.close()
        monkeypatch.setattr(line_module, "TcpPort", lambda *_: BrokenPort(error))
        for call in (link.read, link.standing, lambda: link.drive({terminal: 0.0})):
            if make == "module" and call == link.read:
                continue  # it has no inputs to ask for
            with pytest.raises(DeviceLostError, match=r"socket://127\.0\.0\.1:.*the line is gone"):
                call()


SPOILED = (b"", b"\xfe\r", b"\n", b"!01\r!01\r", b"?01\r", b";;;\n", b'1;2;+0,"', b"x" * 9000)


@pytest.mark.parametrize("make", [module, source])
def test_whatever_comes_back_is_a_reading_or_a_named_error(make):
    def reads(spoiled):
        device, spoil = Module() if make is module else Instrument(), [False]

        def sometimes(came):
            return spoiled if spoil[0] else device(came)

        with make(sometimes, inputs("ai0")) if make is module else make(sometimes) as link:
            good = link.read()
            spoil[0] = True
            with pytest.raises(HardwareError):
                link.read()
            spoil[0] = False
            assert link.read() == good

    side_by_side(reads, SPOILED)


def test_lines_are_logged_for_who_listens(caplog):
    with module(Module(), inputs("ai0")) as link:
        link.read()
        assert not caplog.records
        with caplog.at_level(logging.DEBUG, logger="hil.link"):
            link.read()
    said = [record.getMessage() for record in caplog.records if record.name.startswith("hil.link.ascii_module.socket:")]
    assert said == [r"→ b'#01\r'", f"← b'{READINGS}\\r'"]


def test_a_line_that_nobody_serves_is_named_once():
    address = f"socket://127.0.0.1:{free_port()}"
    with pytest.raises(DeviceLostError) as told:
        Line(SerialSettings(address=address, timeout_s=1.0), "\n", "\n", driver="text")
    assert str(told.value) == f"{address}: cannot be opened: [Errno 111] Connection refused"
