"""Devices on lines of text by their description: plain sockets as the other side, the twin, and what is wrong told."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers import scpi, text
from drivers._templates import Numbers, filled, matched, remedy
from hil.daq.channel import Wiring
from hil.description.find import descriptions
from hil.description.read import read_description
from hil.errors import LinkError, SettingError
from tests.channels import inputs, outputs
from tests.described import bench, input_, is_told, output, passes, written
from tests.foreign_line import ForeignLine, ended
from tests.links import free_port

REGULATOR = """\
protocol = "text"
summary = "a pressure regulator that answers every line"

[text]
end = "CR"
answer_end = "CRLF"
decimal = ","
separator = ";"
hello = "ID"
identity = "REG-{any} V{any}"
setup = ["REMOTE"]
errors = "ERR?"
no_error = "{value} {any}"
no_measurement = ["----"]

[terminals."set"]
direction = "out"
unit = "V"
range = [-10.0, 10.0]
tell = "P={value:.3f}"
reply = "OK"
ask = "P?"
answer = "P {value} mbar"
slope = 0.001
close = 0.001

[terminals."volts {n}"]
count = 2
first = 1
direction = "in"
unit = "V"
range = [-10.0, 10.0]
ask = "M?"
field = 0
answer = "{value}"

[terminals.load]
direction = "in"
unit = "V"
range = [-10.0, 10.0]
ask = "L?"
answer = ">{value:+07.3f}"

[watchdog]
arm = ["WD {tenths:04d}", "WS {safe:set:.1f}"]
reply = "OK"
"""
REGULATOR = REGULATOR.replace('[terminals."volts {n}"]\ncount = 2\nfirst = 1', '[terminals."volts 1"]') + (
    '\n[terminals."volts 2"]\ndirection = "in"\nunit = "V"\nrange = [-10.0, 10.0]\nask = "M?"\nfield = 1\n'
)
WIRING = Wiring(outputs({"u": "set"}, safe=1.0), inputs(("volts 1", "volts 2", "load")))


class Regulator:
    """The device by hand: a socket, and strings."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.says: dict[str, str] = {"M?": "1,5;-2,25", "L?": ">+01,250", "ERR?": "0 none", "ID": "REG-7 V2.1"}
        self.mbar = "0"

    def __call__(self, came: bytes) -> bytes:
        answer = self.one(came.decode().removesuffix("\r"))
        return f"{answer}\r\n".encode() if answer else b""

    def one(self, line: str) -> str:
        self.lines.append(line)
        if line.startswith("P="):
            self.mbar = line[2:]
        if line[:2] in ("P=", "WD", "WS"):
            return self.says.get(line[:2], "OK")
        return f"P {self.mbar} mbar" if line == "P?" else self.says.get(line, "")


@contextmanager
def opened(device: Callable[[bytes], bytes], folder: Path, **more: Any) -> Iterator[text.TextLink]:
    path = written(folder, "regulator.toml", REGULATOR)
    with ForeignLine(device, ended(b"\r")) as line:
        told = {"model": str(path), "address": f"socket://127.0.0.1:{line.port}", "timeout_s": 1.0,
                "longest_reply_s": 1.0, **more}  # fmt: skip
        with closing(text.open_link(text.Settings.model_validate(told), WIRING)) as link:
            yield link


def test_what_is_told_and_asked_is_what_the_file_says(tmp_path, half_a_second_later):
    device = Regulator()
    with opened(device, tmp_path, watchdog_s=2.0) as link:
        assert device.lines == ["ID", "REMOTE", "WD 0020", "WS 1000,0", "ERR?"]
        assert link.identity == "REG-7 V2.1"
        link.drive({"set": -2.5})
        assert device.lines[-2:] == ["P=-2500,000", "ERR?"]
        assert link.standing() == {"set": -2.5}
        device.lines.clear()
        assert link.read() == {"volts 1": 1.5, "volts 2": -2.25, "load": 1.25}
        assert device.lines == ["M?", "L?"]  # two terminals, one question
        device.mbar = "-2400"
        half_a_second_later()
        with pytest.raises(LinkError, match=r"set stands at -2.4 V, not at -2.5 V as it was driven"):
            link.read()


@pytest.mark.parametrize(
    ("text", "decimal", "hint"),
    [("1,5", ".", '; a decimal comma? Then say decimal = ","'),
     ("1.5e3", ",", '; a decimal point? Then say decimal = "."'),
     ("1.5 bar", ".", '; a unit behind the number? Then say answer = "{value} bar"'),
     ("1.5V", ".", '; a unit behind the number? Then say answer = "{value}V"'),
     ("----", ".", '; a word for no measurement? Then say no_measurement = ["----"]'), ("#12", ".", ""), ("", ".", "")],
)  # fmt: skip
def test_an_answer_of_another_form_is_told_with_what_may_help(text, decimal, hint):
    assert remedy(text, Numbers(decimal)) == hint


@pytest.mark.parametrize(
    ("asked", "says", "error"),
    [("L?", ">+1,250", r"'>\+1,250' is no answer to L\?; it should be '>\{value:\+07.3f\}'"),  # a byte was lost
     ("L?", ">+01.250", "is no answer"), ("M?", "1,5", "is no answer"), ("M?", "1,5;x;3", None),
     ("P=", "E2", r"'E2' is no answer to P=1000,000; it should be 'OK'"),
     ("ERR?", "7 out of range", "refused REMOTE: 7 out of range"),
     ("ID", "PUMP 3", "to ID it says 'PUMP 3', not 'REG-{any} V{any}'"),
     ("M?", "----;0,0", "volts 1 reads no measurement from the first on")],
)  # fmt: skip
def test_an_answer_of_another_form_is_none(asked, says, error, tmp_path):
    device = Regulator()
    device.says[asked] = says

    def use():
        with opened(device, tmp_path) as link:
            link.drive({"set": 1.0})
            return link.read()

    if error is None:
        with pytest.raises(LinkError, match="is no answer"):
            use()
        return
    with pytest.raises(LinkError, match=error):
        use()


def test_no_measurement_after_a_first_one_is_told_as_such(tmp_path):
    device = Regulator()
    with opened(device, tmp_path) as link:
        link.read()
        device.says["M?"] = "----;OL"
        read = link.read()
        assert math.isnan(read["volts 1"]) and read["volts 2"] == math.inf and read["load"] == 1.25


@pytest.mark.parametrize(
    ("said", "value"),
    [("9.9E37", math.inf), ("-9.9e37", -math.inf), ("9.91E37", None), ("NAN", None), ("OL", math.inf),
     ("-OL", -math.inf),      ("+9999", None), (" 1.5 ", 1.5), (".5", 0.5), ("1.", 1.0), ("--", None)],
)  # fmt: skip
def test_numbers_that_are_none(said, value):
    read = Numbers(none=("+9999", "--")).read(said)
    assert read is not None and (math.isnan(read) if value is None else read == value)


@pytest.mark.parametrize("said", ["1,5", "1.5 V", "", "0x10", "1.5.2", "volts 1"])
def test_what_is_no_number(said):
    assert Numbers().read(said) in (None, 0.0) if said == "volts 1" else Numbers().read(said) is None


@given(value=st.floats(-1e6, 1e6), decimal=st.sampled_from([".", ","]),
       form=st.sampled_from(["{value:.4f}", "{value:+014.4f}", "{value:.12e}", "{value:.12g}"]),
       around=st.sampled_from(["{}", "P {} bar", ">{};{{any}}", "{{any}}={}"]))  # fmt: skip
def test_what_is_filled_in_is_found_again(value, decimal, form, around):
    numbers = Numbers(decimal)
    template = around.format(form)
    line = filled(template, numbers, value=value).replace("{any}", "")
    assert matched(template, line, numbers) == pytest.approx(value, abs=1e-4, rel=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "line", "told"),
    [
        ('tell = "P={value:.3f}"', 'tell = "P="', 20, "has {value} in it, once, such as {value:.3f}"),
        ('tell = "P={value:.3f}"', 'tell = "P={value:.3x}"', 20, "a form such as .3f"),
        ('tell = "P={value:.3f}"\n', "", 16, "is missing: what sets this output"),
        ('ask = "L?"\n', "", 35, "is missing: what asks for this input"),
        ('"WD {tenths:04d}"', '"WD {tenth}"', 43, "in braces there are value, any"),
        ("{safe:set:.1f}", "{safe:sat:.1f}", 43, "no output 'sat'; there are: set"),
        ('end = "CR"', 'end = "NL"', 5, "text.end: input should be 'LF', 'CRLF' or 'CR'"),
        ('reply = "OK"\nask', 'replies = "OK"\nask', 21, "did you mean 'reply'?"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_with_its_line(old, new, line, told, tmp_path):
    is_told(tmp_path, REGULATOR, old, new, told, line)


def test_a_watchdog_that_would_drive_the_valve_is_not_armed(tmp_path):
    path = written(tmp_path, "regulator.toml", REGULATOR.replace("[watchdog]\n", "[watchdog]\nexpires_to = 0.0\n"))
    settings = text.Settings(model=str(path), address="socket://127.0.0.1:1", watchdog_s=1.0)
    with pytest.raises(SettingError, match="puts set at 0 V, but 'u' is safe at 1 V"):
        text.open_link(settings, WIRING)


CHANNELS = (
    output("command", "set", role="command") + input_("volts", "volts 1", role="response") + input_("load", "load")
)


@pytest.mark.alone
@pytest.mark.slow
def test_the_regulator_passes_the_checks_on_its_twin(tmp_path):
    written(tmp_path, "regulator.toml", REGULATOR)
    told = 'driver = "text"\nmodel = "regulator.toml"\nwatchdog_s = 0.3\ntimeout_s = 0.1\nlongest_reply_s = 0.2\n'
    path = written(tmp_path, "bench.toml",
                   bench(f'{told}address = "socket://127.0.0.1:{free_port()}"', CHANNELS, "volts"))  # fmt: skip
    passed = passes(path, "text")
    assert "has_the_watchdog_that_it_promises" in passed


SOURCE = """\
protocol = "scpi"
summary = "a source"
[text]
identity = "ACME,S2,{any}"
setup = ["SYST:REM"]
[terminals.volts]
direction = "out"
unit = "V"
range = [0.0, 10.0]
tell = "VOLT {value:.3f}"
ask = "VOLT?"
[terminals.measured]
direction = "in"
unit = "V"
range = [0.0, 10.0]
ask = "MEAS:VOLT?"
answer = "{value} V"
"""


def test_a_described_scpi_instrument_by_hand(tmp_path):
    lines = []

    def device(came):
        answers = {"*IDN?": "ACME,S2,1,2", "SYST:ERR?": '0,"No error"', "VOLT?": "2.5", "MEAS:VOLT?": "2.498 V"}
        units = [unit.strip(":") for unit in came.decode().strip().split(";")]
        lines.extend(units)
        return (";".join(answers[unit] for unit in units if unit in answers) + "\n").encode()

    path = written(tmp_path, "source.toml", SOURCE)
    wiring = Wiring(outputs({"u": "volts"}, low=0.0),
                    inputs({"m": "measured"}, low=0.0))  # fmt: skip
    with ForeignLine(device, ended(b"\n")) as line:
        link = scpi.open_link(scpi.Settings(model=str(path), address=f"socket://127.0.0.1:{line.port}"), wiring)
        link.drive({"volts": 2.5})
        assert (link.standing(), link.read()) == ({"volts": 2.5}, {"measured": 2.498})
        link.close()
    assert lines[:4] == ["*CLS", "*IDN?", "SYST:REM", "SYST:ERR?"] and "VOLT 2.500" in lines


@pytest.mark.parametrize("name", ["scanner", "agilent-34970a"])
def test_a_reading_that_lost_a_byte_on_the_line_is_no_answer(name):
    answer, said = read_description(descriptions()[name]).terminals["in{n}"].answer, "+7.03835487E-02"
    assert matched(answer, said, Numbers()) == 0.0703835487
    assert matched(answer, "-9.90000000E+37", Numbers()) == -math.inf
    assert [matched(answer, said[:i] + said[i + 1 :], Numbers()) for i in range(len(said))] == [None] * len(said)
