"""The Modbus driver against devices that share nothing with it: tables, formats, byte orders, lines that misbehave."""

from __future__ import annotations

import logging
import math
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, nullcontext
from itertools import count
from types import SimpleNamespace
from typing import Any

import pytest

from drivers import _modbus_line as modbus_line
from drivers import modbus
from drivers.modbus import LineSettings, ModbusLink, Model, Register
from hil.daq.channel import Wiring
from hil.errors import HardwareError, LinkError, SettingError
from tests.channels import inputs, outputs
from tests.foreign_line import BrokenPort, ForeignLine, Tables, crc, serial_frame, tcp_frame
from tests.waits import side_by_side

ORDERS = {
    "big": "42 35 33 33", "ABCD": "42 35 33 33", "little": "33 33 42 35", "CDAB": "33 33 42 35",
    "BADC": "35 42 33 33", "DCBA": "33 33 35 42",
}  # fmt: skip
"""45.3 as a float, by byte order."""
FRAMES = {"tcp": tcp_frame, "rtu": serial_frame}


def registers(*data: str) -> list[int]:
    return list(struct.unpack(f">{len(bytes.fromhex(data[0])) // 2}H", bytes.fromhex(data[0])))


def float_at(address: int, value: float) -> dict[int, int]:
    return dict(enumerate(struct.unpack(">HH", struct.pack(">f", value)), address))


def gauge(form: Any = "f32", table: Any = "input", at: int = 0, slope: float = 1.0) -> dict[str, Any]:
    return Register("in", "value", "degC", -50.0, 200.0, table, at, form, slope)


T16, DEG_C = Model({"t": gauge("u16")}), Model({"t": gauge()})


@contextmanager
def linked(
    answer: Callable[[bytes], bytes | None], model: Model = T16, transport: str = "tcp", **more: Any
) -> Iterator[ModbusLink]:
    """A link to a device that answers so, all its registers wired."""
    with ForeignLine(answer, FRAMES[transport]) as line:
        address = f"{'socket://' if transport == 'rtu' else ''}127.0.0.1:{line.port}"
        told = {"timeout_s": 1.0, "longest_reply_s": 1.0, "transport": transport, "address": address, **more}
        ins, outs = ([n for n, t in model.terminals.items() if t.direction == way] for way in ("in", "out"))
        wiring = Wiring(outputs(outs, "bar", -500.0, 500.0), inputs(ins, "degC", -50.0, 200.0))
        with closing(ModbusLink(LineSettings.model_validate(told), wiring, model)) as link:
            yield link


def test_neighbouring_addresses_of_two_tables_are_two_requests():
    """Address 0 of the input registers and 1 of the holding registers are no neighbours."""
    device = Tables(holding={0: 111, 1: 222}, inputs={0: 444, 1: 333})
    model = Model({"a": gauge("u16", "input", 0), "b": gauge("u16", "holding", 1)})
    with linked(device.on_tcp, model) as link:
        assert link.read() == {"a": 444.0, "b": 222.0}


@pytest.mark.parametrize(("order", "data"), ORDERS.items())
def test_byte_orders_by_name(order, data):
    device = Tables(inputs=dict(enumerate(registers(data))))
    with linked(device.on_tcp, DEG_C, word_order=order) as link:
        assert link.read()["t"] == pytest.approx(45.3, rel=1e-6)


@pytest.mark.parametrize("data", [d for name, d in ORDERS.items() if name in ("CDAB", "BADC", "DCBA")])
def test_a_float_in_another_byte_order_is_no_measurement(data):
    device = Tables(inputs=dict(enumerate(registers(ORDERS["ABCD"]))))
    with linked(device.on_tcp, DEG_C) as link:
        assert link.read()["t"] == pytest.approx(45.3, rel=1e-6)
        device.inputs.update(enumerate(registers(data)))
        assert math.isnan(link.read()["t"]) and math.isnan(link.read()["t"])
    says = r"t reads no measurement .* degC: .* check word_order \(now ABCD\)"
    with linked(device.on_tcp, DEG_C) as link, pytest.raises(LinkError, match=says):
        link.read()


@pytest.mark.parametrize(
    ("readings", "measured"),
    [
        ([0.0, 3e-9, -2e-8, 0.3], [True, True, True, True]),  # through zero, or dying away towards it
        ([45.3, 1e-40, 45.3], [True, False, True]),
        ([45.3, math.nan, 3e-7, 1e-8], [True, False, False, False]),
        ([45.3, 2e4, 250.0, math.inf], [True, False, True, True]),  # beyond the range is not for the driver to judge
    ],
)
def test_what_counts_as_a_reading(readings, measured):
    device = Tables()
    with linked(device.on_tcp, DEG_C) as link:
        for reading, good in zip(readings, measured, strict=True):
            device.inputs.update(float_at(0, reading))
            assert math.isnan(link.read()["t"]) is not good, reading


@pytest.mark.parametrize(("key", "said"), [("type", "f16"), ("type", "int16"), ("table", "coils")])
def test_an_unknown_format_or_table_is_no_register(key, said):
    with pytest.raises(SettingError, match=rf"terminals\.t\.{key}: "):
        Model({"t": gauge(**{"at": 4, "form" if key == "type" else key: said})})
    with pytest.raises(SettingError, match="an output stands in a coil or a holding register"):
        Model({"q": Register("out", "value", "bar", 0.0, 9.0, "input", 4)})


@pytest.mark.parametrize("form", ["f32", "s32"])
def test_outputs_in_two_registers_are_driven_and_read_back(form, half_a_second_later):
    device = Tables(holding={8: 0, 9: 0, 10: 0})
    model = Model({
        "p": Register("out", "value", "bar", -500.0, 500.0, "holding", 8, form, 1.0 if form == "f32" else 1e-3),
        "q": Register("out", "value", "bar", -500.0, 500.0, "holding", 10, "s16"),
    })  # fmt: skip
    with linked(device.on_tcp, model) as link:
        link.drive({"p": -123.5, "q": 7.0})
        expected = struct.pack(">f", -123.5) if form == "f32" else struct.pack(">i", -123500)
        assert struct.pack(">HH", device.holding[8], device.holding[9]) == expected
        assert device.holding[10] == 7
        assert link.standing() == {"p": -123.5, "q": 7.0}
        device.holding[9] ^= 0x4000
        half_a_second_later()
        with pytest.raises(LinkError, match=r"p stands at .* bar, not at -123.5 bar as it was driven"):
            link.read()


def test_a_gateway_that_numbers_by_itself_is_told_apart_from_silence():
    device = Tables(inputs=float_at(0, 45.3))
    with (
        linked(lambda frame: b"\x99\x02" + device.on_tcp(frame)[2:], DEG_C) as link,
        pytest.raises(LinkError, match=r"came, but with transaction number 39170 instead of \d+: a gateway that num"),
    ):
        link.read()


def echoing(device: Tables) -> Callable[[bytes], bytes]:
    return lambda frame: frame + device.on_serial(frame)


def test_an_adapter_that_echoes_is_named_and_a_setting_helps():
    echoes, says = echoing(Tables(inputs={0: 453})), "what was sent came back: the adapter echoes, say echo = true"
    with linked(echoes, transport="rtu") as link, pytest.raises(LinkError, match=says):
        link.read()
    with linked(echoes, transport="rtu", echo=True) as link:
        assert [link.read()["t"] for _ in range(3)] == [453.0] * 3


def test_an_echo_of_what_was_written_is_named_too():
    """The echo of function 6 is just what its answer would be; what came behind it is taken for the next answer."""
    device = Tables(inputs={0: 453}, holding={4: 0, 8: 0, 9: 0})
    out = {name: Register("out", "value", "bar", 0.0, 9.0, "holding", at) for name, at in (("q", 8), ("r", 9))}
    model = Model(out, watchdog=((4, "{tenths}"), (4, 1)))
    with (
        pytest.raises(LinkError, match="say echo = true"),
        linked(echoing(device), model, "rtu", watchdog_s=1.0) as link,
    ):
        link.standing()


def slow(device: Tables, pause_s: float, transport: str = "rtu") -> Callable[[bytes], bytes]:
    """A device that hears nothing for so long after it has answered."""
    answered_s = [0.0]

    def answer(frame: bytes) -> bytes:
        if time.monotonic() - answered_s[0] < pause_s:
            return b""
        answered_s[0] = time.monotonic()
        return device.on_serial(frame) if transport == "rtu" else device.on_tcp(frame)

    return answer


@pytest.mark.parametrize("transport", FRAMES)
def test_a_device_that_needs_a_pause_is_told_of_the_setting(transport):
    device, out = Tables(holding={4: 0}), Register("out", "value", "bar", 0.0, 9.0, "holding", 4)
    model = Model({"q": out}, watchdog=((4, "{tenths}"), (4, 1)))
    with (
        pytest.raises(LinkError, match="may need a pause between frames: say pause_s"),
        linked(slow(device, 0.9, transport), model, transport, watchdog_s=1.0),
    ):
        raise AssertionError("it was opened")


def busy(device: Tables, times: float) -> Callable[[bytes], bytes]:
    """A device that refuses as busy so many times, then answers (function code + 0x80, exception 6)."""
    refused = count()

    def answer(frame: bytes) -> bytes:
        if next(refused) < times:
            return frame[:4] + bytes((0, 3, frame[6], frame[7] | 0x80, 6))
        return device.on_tcp(frame)

    return answer


@pytest.fixture
def asked_by_hand(monkeypatch):
    """A line by a clock of its own to a device that answers so: when it was asked, and what came of it."""

    def asked(answer, says):
        asked_s, spent_s = [], [0.0]

        class Port:
            line, is_hung_up, quiet_until_s = nullcontext(), False, 0.0
            come = b""

            def write(self, data):
                asked_s.append(sum(spent_s))
                self.come = answer(data)

            def read(self, wait_s):
                spent_s.append(0.07 if self.come else max(0.0, wait_s))
                came, self.come = self.come, b""
                return came

            def drop(self):
                """Nothing is open."""

        line = modbus_line.ModbusLine(LineSettings(address="127.0.0.1:502", timeout_s=0.2), lambda: None)
        monkeypatch.setattr(line, "_opened", Port)
        with monkeypatch.context() as patch:
            patch.setattr(modbus_line, "system", SimpleNamespace(now_s=lambda: sum(spent_s), sleep=spent_s.append))
            with pytest.raises(LinkError, match=says):
                line.ask(4, 0)
        return [*asked_s, sum(spent_s)]

    return asked


def test_a_busy_device_is_asked_again_for_as_long_as_an_answer_may_take(asked_by_hand):
    with linked(busy(Tables(inputs={0: 453}), 3)) as link:
        assert link.read()["t"] == 453.0
    *asked_s, _ = asked_by_hand(busy(Tables(), math.inf), r"exception 6 \(device busy\)")
    assert len(asked_s) == 2 and asked_s[-1] < 0.2


def test_a_busy_device_and_one_that_then_falls_silent_take_one_time_out(asked_by_hand):
    """It was asked again within the time of an answer, and that one then had the whole time once more."""
    refused = iter([busy(Tables(), 1)])
    *asked_s, ended_s = asked_by_hand(lambda data: next(refused, lambda _: b"")(data), r"no valid answer within 0\.2 s")
    assert len(asked_s) == 2 and ended_s == pytest.approx(0.2)


def test_echo_belongs_to_a_serial_line():
    settings = LineSettings(address="127.0.0.1:502", echo=True)
    assert [place for place, _ in modbus.line_faults(settings, DEG_C)] == [("echo",)]


def test_noise_before_an_answer_on_a_serial_line_is_passed_over():
    device = Tables(inputs={0: 453})
    with linked(lambda frame: b"\x00\xff" + device.on_serial(frame), transport="rtu") as link:
        assert link.read()["t"] == 453.0


SPOILED = (b"", b"\x00", b"\xff" * 99, b"\x01\x84\x02", b"\x01\x04\xff\x00", b"\x01\x2b\x0e")


@pytest.mark.parametrize("transport", FRAMES)
def test_whatever_comes_back_is_a_reading_or_a_link_error(transport):
    def reads(spoiled):
        device, spoil = Tables(inputs={0: 453}), [False]
        answer = device.on_tcp if transport == "tcp" else device.on_serial

        def sometimes(frame):
            good = answer(frame)
            return (good[:6] if transport == "tcp" else b"") + spoiled if spoil[0] else good

        with linked(sometimes, transport=transport) as link:
            assert link.read()["t"] == 453.0
            spoil[0] = True
            with pytest.raises(HardwareError):
                link.read()
            spoil[0] = False
            assert link.read()["t"] == 453.0

    side_by_side(reads, SPOILED)


ANYTHING = (
    OSError(5, "Input/output error"), ConnectionResetError(), struct.error("unpack requires a buffer of 4 bytes"),
    ValueError("garbled"), KeyError("x"), IndexError(), AttributeError("gone"), TypeError("None"), EOFError(),
    UnicodeDecodeError("ascii", b"\xff", 0, 1, "ordinal not in range"), RuntimeError("bus-off"), TimeoutError(),
)  # fmt: skip


@pytest.mark.parametrize("error", ANYTHING, ids=lambda e: type(e).__name__)
def test_whatever_the_library_raises_is_a_named_error(error, monkeypatch):
    device = Tables(inputs={0: 453}, holding={8: 0})
    model = Model({"t": gauge("u16"), "q": Register("out", "value", "bar", -500.0, 500.0, "holding", 8, "s16")})
    with linked(device.on_tcp, model) as link:
        link.line.close()
        monkeypatch.setattr(modbus_line, "TcpPort", lambda *_: BrokenPort(error))
        for call in (link.read, link.standing, lambda: link.drive({"q": 1.0})):
            with pytest.raises(HardwareError) as told:
                call()
            assert str(told.value)


@pytest.mark.parametrize("said", ["Moxa E1241 V3.2", ""])
def test_what_a_device_says_of_itself(said):
    with linked(Tables(inputs={0: 453}, identity=said).on_tcp) as link:
        assert link.identity == said
        assert link.read()["t"] == 453.0


def test_an_answer_to_another_question_is_no_identity():
    device = Tables(inputs={0: 453})
    other = bytes.fromhex("000000000005010402ffff")

    def answer(frame):
        return frame[:4] + other[4:] if frame[7] == 43 else device.on_tcp(frame)

    with linked(answer) as link:
        assert link.identity == "" and link.read()["t"] == 453.0


def test_frames_are_logged_for_who_listens_and_nobody_else(caplog, capfd):
    levels = {name: logging.getLogger(name).level for name in ("pymodbus", "pymodbus.logging")}
    with linked(Tables(inputs={0: 453}).on_tcp) as link:
        link.read()
        assert not caplog.records
        with caplog.at_level(logging.DEBUG, logger="hil.link"):
            link.read()
    with (
        linked(Tables().on_tcp) as link,
        pytest.raises(LinkError, match=r"exception 2 \(no such register\)"),
    ):
        link.read()
    sent, came = (record for record in caplog.records if record.name.startswith("hil.link.modbus.127_0_0_1:"))
    assert sent.getMessage().startswith("→ ") and came.getMessage().endswith("01 c5")
    assert {name: logging.getLogger(name).level for name in levels} == levels
    assert capfd.readouterr().err == ""


def test_a_late_answer_is_not_called_an_echo_once_readings_have_come():
    """An adapter that echoes would have been noticed before."""
    device, before = Tables(inputs={0: 453}), [b"", b""]

    def one_behind(frame):
        before[:] = [before[1], device.on_serial(frame)]
        return before[0] if late[0] else before[1]

    late = [False]
    with linked(one_behind, transport="rtu") as link:
        assert link.read()["t"] == 453.0
        before[1], late[0] = b"\x01\x06\x00\x00\x00\x05" + crc(b"\x01\x06\x00\x00\x00\x05"), True
        with pytest.raises(LinkError) as told:
            link.read()
        assert "one to an earlier request may have come late" in str(told.value)


READ, OTHER = (data + crc(data) for data in (b"\x01\x04\x04\x00\x07\x01\x04", b"\x01\x04\x04\x00\x08\x01\x04"))


@pytest.mark.parametrize("first", [1, 3, 6, len(READ)])
@pytest.mark.parametrize(
    ("behind", "are_two"), [(b"", False), (READ, False), (READ[:3], False), (OTHER, True)],
    ids=["nothing", "the same", "a part of the same", "another"],
)  # fmt: skip
def test_an_answer_that_comes_in_pieces_or_twice_is_one(first, behind, are_two, monkeypatch):
    """Its bytes may be those with which an answer begins: 260 is 01 04."""
    whole = READ + behind
    pieces = [whole[:first], whole[first:]] if first < len(READ) else [whole]
    port = SimpleNamespace(line=nullcontext(), quiet_until_s=0.0, write=lambda _sent: None,
                           read=lambda _left_s: pieces.pop(0), drop=lambda: None)  # fmt: skip
    monkeypatch.setattr(modbus_line, "TcpPort", lambda *_: port)
    line = modbus_line.ModbusLine(LineSettings(address="socket://there:1", transport="rtu"), lambda: None)
    with pytest.raises(LinkError, match="two answers came") if are_two else nullcontext():
        assert line.ask(4, 0, count=2) == [0x0007, 0x0104]
