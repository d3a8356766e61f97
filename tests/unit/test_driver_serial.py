"""The serial drivers and their twins: lines as manuals print them, late and garbled answers, watchdog, error queue."""

from __future__ import annotations

import socket
import threading
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from serial import rfc2217

from drivers import ascii_module, scpi
from hil.daq.channel import Wiring
from hil.description.ascii_module import ModuleDescription
from hil.description.named import Described, description_of
from hil.errors import DeviceLostError, LinkError
from sim_devices import ascii_module as module_twin
from sim_devices import scpi as scpi_twin
from sim_devices._field import Side
from sim_devices._quirks import Quirks
from tests.channels import inputs, outputs
from tests.linked import linked as linked_to
from tests.linked import simulation, turned
from tests.waits import until

pytestmark = pytest.mark.xdist_group("waits for lines")  # for clocks: on one worker, beside others that compute

SIMULATION = simulation("read back", slope=10.0)
MODULE = Wiring(outputs({"command": "ao0"}), {})
SCANNER = Wiring(outputs({"command": "dac4"}, low=-12.0, high=12.0), inputs({"read back": "in3"}))
CALM = {"timeout_s": 1.0, "longest_reply_s": 1.0}


def module_of(name: str) -> ModuleDescription:
    return description_of(Described(model=name), "ascii_module")


def instrument(side: Side) -> scpi_twin.Instrument:
    return scpi_twin.Instrument(side, description_of(Described(model="scanner"), "scpi"))


def by_hand(wiring: Wiring) -> Side:
    return turned(SIMULATION, wiring)


def linked(driver: ModuleType, twin: ModuleType, wiring: Wiring, used: Wiring | None = None, **settings: Any) -> Any:
    told = {"address": "socket://127.0.0.1:0", **CALM, **settings}
    return linked_to(driver, twin, SIMULATION, wiring, told, used=used)


def module(**settings: Any) -> Any:
    return linked(ascii_module, module_twin, MODULE, model="adam-4024", **settings)


def scanner(**settings: Any) -> Any:
    return linked(scpi, scpi_twin, SCANNER, model="scanner", **settings)


def test_lines_of_the_module_as_its_manual_prints_them():
    side = by_hand(MODULE)
    told = module_twin.Module(side, module_of("adam-4024"), 0x0A)
    conversation = [
        ("$0AM", "!0A4024"), ("$0A2", "!0A000600"),
        ("#0AC0+07.456", "!0A"), ("$0A6C0", "!0A+07.456"), ("$0AX0100", "!0A"),
        ("$0A8C2", "!0AC232"), ("$0A8C4", "?0A"), ("$0A6C4", "?0A"),
        ("#0AC4+01.000", "?0A"), ("#0AC0+7.456", None), ("$0BM", None), ("", None), ("#0A", None),
    ]  # fmt: skip
    for request, answer in conversation:
        assert told.answer_to(request) == answer, request
    assert side.standing("ao0") == 7.456


def test_another_module_than_the_one_that_was_named_is_refused():
    side = module_twin.world(SIMULATION, {"": MODULE}).side("")
    served = module_twin.serve({"model": "adam-4017", "address": "socket://127.0.0.1:0"}, side, Quirks())
    with pytest.raises(LinkError, match="module 01 is a '4017', not a 4024"):
        ascii_module.open_link(ascii_module.Settings(model="adam-4024", address=served.where), MODULE)
    served.close()


def test_output_that_is_set_to_give_a_current_is_refused(monkeypatch):
    monkeypatch.setattr(module_twin.Module, "_answered_value", lambda self, what, channel: "!01C030")
    with pytest.raises(LinkError, match="ao0 is of output type 30, not 32"), module():
        pass


def bridged(listener: socket.socket, device: Any) -> None:
    """A serial server after RFC 2217 with a device on its port."""
    client, _ = listener.accept()
    port = SimpleNamespace(
        baudrate=9600, bytesize=8, parity="N", stopbits=1, rtscts=False, xonxoff=False, cts=True, dsr=True, ri=False,
        cd=True, dtr=True, rts=True, break_condition=False, reset_input_buffer=int, reset_output_buffer=int,
    )  # fmt: skip
    manager = rfc2217.PortManager(port, SimpleNamespace(write=client.sendall))
    received = b""
    with client:
        while data := client.recv(1024):
            received += b"".join(manager.filter(data))
            request, received = device.request_in(received)
            if request:
                client.sendall(b"".join(manager.escape(device.answer(request))))
    assert port.baudrate == 115200


@pytest.mark.filterwarnings("ignore:set(Daemon|Name):DeprecationWarning")  # pyserial's own
def test_scanner_behind_a_serial_server_after_rfc_2217():
    side = by_hand(SCANNER)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        thread = threading.Thread(target=bridged, args=(listener, instrument(side)))
        thread.start()
        address = f"rfc2217://127.0.0.1:{listener.getsockname()[1]}"
        link = scpi.open_link(scpi.Settings(model="scanner", address=address), SCANNER)
        link.drive({"dac4": 2.5})
        assert link.standing() == {"dac4": 2.5} and side.standing("dac4") == 2.5
        link.close()
        thread.join(600.0)
    assert not thread.is_alive()


def test_error_queue_keeps_the_oldest_and_says_when_it_ran_over():
    scanner_ = instrument(by_hand(SCANNER))
    for _ in range(25):
        assert scanner_.answer_to("NONSENSE 1") is None
    scanner_.answer_to("*RST")
    errors = [scanner_.answer_to("SYST:ERR?") for _ in range(21)]
    assert errors == [*19 * ['-113,"Undefined header"'], '-350,"Queue overflow"', '+0,"No error"']


@pytest.mark.parametrize(
    ("message", "code"),
    [
        ("SOUR:VOLT 13,(@204)", -222), ("*ESE", -109), ("*ESE x", -121), ("*CLS 1", -108), ("SOU:VOLT 1,(@204)", -113),
    ],
)  # fmt: skip
def test_errors_by_their_numbers_in_the_standard(message, code):
    side = by_hand(SCANNER)
    scanner_ = instrument(side)
    assert str(scanner_.answer_to(f"{message};:SYST:ERR?")).startswith(f"{code},")
    assert side.standing("dac4") == 0.0


def test_refused_command_is_raised_with_the_error_of_the_instrument():
    with scanner() as (link, _, _):
        with pytest.raises(LinkError, match=r"refused SOUR:VOLT 13\.00000,\(@204\): -222 Data out of range"):
            link.drive({"dac4": 13.0})
        link.drive({"dac4": 1.0})


@pytest.mark.parametrize("quirk", ["late_s", "silent", "garbled", "cut"])
@pytest.mark.parametrize(
    ("make", "elsewhere"),
    [(scanner, "SOUR:VOLT -5,(@204)"), (module, "#01C0-05.000")],
    ids=["scpi", "module"],
)
def test_bad_answer_is_an_error_and_the_next_one_is_right(make, elsewhere, quirk):
    with make() as (link, served, _):
        (terminal,) = link.standing()
        link.drive({terminal: 5.0})
        late = 1.5  # after the next request, were it sent at once
        served.behaviour.quirks = Quirks.model_validate({quirk: late if quirk == "late_s" else True, "answers": 1})
        if quirk == "garbled":  # one bit may still make a number; what counts is that the line stays in step
            served.behaviour.mangled = lambda answer, quirks: b"\xfe" + answer if quirks.garbled else answer
        with pytest.raises(LinkError):
            link.standing()
        served.device.answer_to(elsewhere)
        assert link.standing() == {terminal: pytest.approx(-5.0)}


@pytest.mark.parametrize("make", [scanner, module], ids=["scpi", "module"])
def test_safe_value_does_not_wait_for_a_line_that_is_not_clean(make):
    with make(longest_reply_s=4.0) as (link, served, side):
        (terminal,) = link.standing()
        link.drive({terminal: 5.0})
        served.behaviour.quirks = Quirks(silent=True, answers=1)
        with pytest.raises(LinkError):
            link.standing()
        thread = threading.Thread(target=link.drive, args=({terminal: 0.0},))
        thread.start()
        until(lambda: side.standing(terminal) == 0.0)
        assert not link.line.is_clean, "it was told only when no late answer could come"
        thread.join()


def test_line_that_is_gone_is_a_lost_device():
    with scanner() as (link, served, _):
        served.close()
        with pytest.raises(DeviceLostError):
            link.read()


def test_no_port_is_said_at_once(tmp_path):
    settings = scpi.Settings(model="scanner", address=str(tmp_path / "none"))
    with pytest.raises(DeviceLostError, match="cannot be opened"):
        scpi.open_link(settings, SCANNER)


WORDS = st.sampled_from(
    ["SOUR:VOLT", "MEAS:VOLT:DC?", "(@204)", "*IDN?", ";", ":", " 1e999,(@204)", "$01", "#01C0", "\n"]
)
HOSTILE = st.lists(st.binary(max_size=30) | WORDS.map(str.encode), max_size=8).map(b"".join)
TARGETS = [
    instrument(by_hand(SCANNER)),
    module_twin.Module(by_hand(MODULE), module_of("adam-4024"), 1),
]


@given(HOSTILE, st.sampled_from(TARGETS))
def test_hostile_bytes_neither_crash_nor_hang_nor_move_an_output(received, target):
    received += target.end
    for _ in range(len(received) + 1):
        request, received = target.request_in(received)
        if not request:
            break
        target.answer(request)
    assert not received or target.end not in received
    assert target.side.standing("dac4") == target.side.standing("ao0") == 0.0


@pytest.mark.parametrize("driver", [scpi, ascii_module])
def test_settings_that_cannot_be_are_told(driver):
    model = {"scpi": "scanner", "ascii_module": "adam-4017"}[driver.__name__.removeprefix("drivers.")]
    told = {"model": model, "address": "x", "timeout_s": 3.0, **({"watchdog_s": 1.0} if "adam" in model else {})}
    found = [text for _, text in driver.faults(driver.Settings.model_validate(told))]
    assert "shorter than timeout_s" in found[0] and len(found) == (2 if "adam" in model else 1)
