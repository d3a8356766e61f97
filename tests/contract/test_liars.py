"""Devices that lie are caught by a named check, as hardware is; the same device without its lie passes all."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from hil.bench.read import read_bench
from hil.bench.twin import subject
from hil.daq.conformance import CHECKS, Subject, examine, left_safe, verdict_of
from hil.errors import DeviceLostError
from tests.foreign_line import ForeignLine
from tests.liars import LIES, WIRES, line_of
from tests.outside.serial_line import SerialLine

pytestmark = pytest.mark.xdist_group("waits for liars")  # for clocks: on one worker, beside others that compute

BENCH = """
name = "liar"
sample_rate_hz = 50

[valve]
name = "v"
plant = "brevini-hpv41"
settling_s = 0.1

[devices.io]
DEVICE

[channels.command]
role = "command"
device = "io"
terminal = "OUT0"
unit = "%"
calibration = { slope = 10.0 }
safe = 0.0

[channels.second]
device = "io"
terminal = "OUT1"
unit = "V"
safe = 0.0

[channels.flow]
role = "response"
device = "io"
terminal = "IN0"
unit = "l/min"
calibration = { slope = 10.0 }

[channels."wire of second"]
device = "io"
terminal = "IN1"
unit = "V"
"""
DEVICES = {
    "modbus": 'driver = "modbus"\nmodel = "wago-750"\naddress = "ADDRESS"\ntimeout_s = 1.0\nwatchdog_s = 1.5',
    "scpi": 'driver = "scpi"\nmodel = "scanner"\naddress = "ADDRESS"\ntimeout_s = 3.0\nlongest_reply_s = 3.0',
}
TERMINALS = {"modbus": ("ao0", "ao1", "ai0", "ai1"), "scpi": ("dac4", "dac5", "in1", "in2")}
WIRED = {"command": "flow", "second": "wire of second"}
WATCHDOG = "has_the_watchdog_that_it_promises"
CAUGHT = {
    "ignores": "drives_as_commanded",
    "ignores, repeats what it was told": "an_input_sees_what_it_drives",
    "obeys three seconds later": "drives_as_commanded",
    "obeys another channel": "drives_as_commanded",
    "exchanges two channels, repeats what it was told": "an_input_sees_what_it_drives",
    "obeys the first command alone": "drives_as_commanded",
    "obeys the command before": "drives_as_commanded",
    "obeys the command before, repeats what it was told": "an_input_sees_what_it_drives",
    "obeys no more after the safe command until it is opened again": "goes_to_its_safe_value_on_command",
    "obeys the first channel alone": "drives_as_commanded",
    "half scale": "drives_as_commanded",
    "half scale, repeats what it was told": "an_input_sees_what_it_drives",
    "wrong sign": "drives_as_commanded",
    "wrong sign, repeats what it was told": "an_input_sees_what_it_drives",
    "no negative values": "drives_as_commanded",
    "offset of 2 %": "drives_as_commanded",
    "jitters by 2 %": "drives_as_commanded",
    "saturates at 80 %": "reaches_its_limits",
    "saturates at 60 %": "reaches_its_limits",
    "saturates at 60 %, repeats what it was told": "an_input_sees_what_it_drives",
    "says for ever where it stood first": "drives_as_commanded",
    "answers for another unit": "drives_as_commanded",
    "sticks after 12 commands": "obeys_every_command",
    "creeps home when nothing is said": "obeys_every_command",
    "ignores the safe command": "goes_to_its_safe_value_on_command",
    "forgets when somebody connects": "stands_while_the_link_is_opened_again",
    "moves when somebody connects": "stands_while_the_link_is_opened_again",
    "inputs stand still": "an_input_sees_what_it_drives",
    "never times out": WATCHDOG,
    "times out to the wrong level": WATCHDOG,
    "times out to the wrong level on one output": WATCHDOG,
    "times out once, and never again": WATCHDOG,
    "times out three times too late": WATCHDOG,
    "times out too early": WATCHDOG,
    "says that it timed out and does not": WATCHDOG,
}
OF_THE_UNIT = "answers for another unit"
ONE_WIRE = {lie for lie, check in CAUGHT.items() if check == WATCHDOG} | {
    OF_THE_UNIT,
    "exchanges two channels, repeats what it was told",
    "obeys the first command alone",
    "obeys the command before",
    "obeys no more after the safe command until it is opened again",
    "saturates at 60 %",
    "says for ever where it stood first",
}


def bench(wire: str, line: ForeignLine | SerialLine, folder: Path, *, meter: str = "", watchdog: bool = False) -> Path:
    """A bench with this device, its response on another one if that is named."""
    socket_ = "" if wire == "modbus" else "socket://"
    address = f"{socket_}127.0.0.1:{line.port}" if isinstance(line, ForeignLine) else line.address
    text = BENCH.replace("DEVICE", DEVICES[wire]).replace("ADDRESS", address)
    text = text if watchdog else text.replace("watchdog_s = 1.5", "")  # a busy computer would meet it
    if meter:
        text = text.replace("[channels.command]", f"[devices.meter]\n{meter}\n\n[channels.command]")
        text = text.replace('device = "io"\nterminal = "IN0"', 'device = "meter"\nterminal = "ai0"')
    for place, terminal in zip(("OUT0", "OUT1", "IN0", "IN1"), TERMINALS[wire], strict=True):
        text = text.replace(place, terminal)
    path = folder / "bench.toml"
    path.write_text(text, encoding="utf-8")
    return path


@contextmanager
def served(wire: str, lie: str) -> Iterator[ForeignLine | SerialLine]:
    noticed = LIES[lie].on_connect is not LIES[""].on_connect
    with closing(line_of(lie, wire, on_serial=wire != "modbus" and not noticed)) as line:
        yield line


@contextmanager
def lying(
    wire: str, lie: str, folder: Path, *, wired: bool = True, meter: str = "", watchdog: bool = False
) -> Iterator[Subject]:
    """A device behind the driver, as hardware: nobody looks at it but over the wire."""
    with served(wire, lie) as server:
        meter = meter.replace("PORT", str(getattr(server, "port", "")))
        path = bench(wire, server, folder, meter=meter, watchdog=watchdog)
        measured_by = WIRED if wired else {}
        with subject(read_bench(path), folder, wire, hardware=True, measured_by=measured_by) as examined:
            yield examined


@pytest.mark.parametrize("wire", WIRES)
def test_device_that_does_not_lie_passes_every_check(wire, tmp_path):
    with lying(wire, "", tmp_path, watchdog=True) as examined:
        results = {result.check: result for result in examine(examined)}
        again = {name: verdict_of(CHECKS[name], examined) for name, r in results.items() if r.verdict == "broken"}
        assert left_safe(examined) == "outputs stand at their safe values, read back"
    assert {
        name: text for name, (verdict, text) in again.items() if verdict == "broken"
    } == {}  # a busy computer is late
    asked = {name for name, r in results.items() if r.verdict == "passed"}
    assert set(CAUGHT.values()) - (set() if wire == "modbus" else {WATCHDOG}) <= asked


@pytest.mark.parametrize(
    ("wire", "lie"), [(w, lie) for w in WIRES for lie in CAUGHT if w == "modbus" or lie not in ONE_WIRE]
)
def test_lie_is_caught_by_its_check(wire, lie, tmp_path):
    with lying(wire, lie, tmp_path, watchdog=CAUGHT[lie] == WATCHDOG or lie == OF_THE_UNIT) as examined:
        verdict, text = verdict_of(CHECKS[CAUGHT[lie]], examined)
    assert verdict == "broken", text
    if lie == OF_THE_UNIT:
        assert "unit 2 answered, and unit 1 was asked; check unit_id" in text
        return
    assert "raised" not in text
    assert "'command'" in text or "'second'" in text


def test_every_lie_is_caught_and_is_in_the_guide():
    assert set(CAUGHT) == set(LIES) - {""}
    page = (Path(__file__).parents[2] / "docs" / "how-to" / "add-a-driver.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \| (.*) \|$", page, re.MULTILINE)
    table = {lie: check for check, lies in rows for lie in lies.split("; ") if check in CAUGHT.values()}
    assert table == CAUGHT


def test_what_no_channel_measures_is_left_out_and_not_passed(tmp_path):
    lie = "ignores, repeats what it was told"
    check = CHECKS["an_input_sees_what_it_drives"]
    elsewhere = 'driver = "modbus"\nmodel = "iologik-e1240"\naddress = "127.0.0.1:1"'
    with lying("modbus", lie, tmp_path, wired=False, meter=elsewhere) as examined:
        verdict, text = verdict_of(check, examined)
        assert verdict == "left out" and "cannot tell: no channel measures it" in text
    with lying("modbus", lie, tmp_path, wired=False) as examined:
        verdict, text = verdict_of(check, examined)
        assert verdict == "broken" and "'flow' reads 0 V whether driven to one side or to the other" in text
    with lying("modbus", "", tmp_path, wired=False) as examined:
        verdict, text = verdict_of(check, examined)
        assert verdict == "passed" and "'flow' answers to 'command'; nothing answers to 'second'; by how much" in text
    with lying("modbus", "exchanges two channels, repeats what it was told", tmp_path, wired=False) as examined:
        assert verdict_of(check, examined)[1].startswith("'flow' answers to 'second'; nothing answers to 'command'")
    with lying("modbus", "obeys the command before, repeats what it was told", tmp_path, wired=False) as examined:
        verdict, text = verdict_of(check, examined)
        assert verdict == "broken" and "when the same was told again: the device obeys the command before" in text


def test_outputs_that_do_not_go_safe_are_said_at_the_end(tmp_path):
    with lying("modbus", "ignores the safe command", tmp_path) as examined:
        with examined.asking() as link:
            link.drive(examined.levels(0.5))
        with pytest.raises(
            DeviceLostError, match=r"outputs are not safe: 'command' .* stands at 5; .*use the emergency"
        ):
            left_safe(examined)


def test_an_input_of_another_device_may_measure_it(tmp_path):
    check = CHECKS["an_input_sees_what_it_drives"]
    meter = 'driver = "modbus"\nmodel = "wago-750"\naddress = "127.0.0.1:PORT"'
    with lying("modbus", "half scale, repeats what it was told", tmp_path, meter=meter) as examined:
        verdict, text = verdict_of(check, examined)
    assert verdict == "broken" and "'flow', which measures it, reads 2.5 V, not 5" in text
    with lying("modbus", "", tmp_path, meter=meter) as examined:
        assert verdict_of(check, examined) == ("passed", "")


@pytest.fixture
def check_driver(command_line, tmp_path):
    """How `hil check-driver modbus` of a server ended."""
    return lambda server, *words: command_line(
        "check-driver", "modbus", "--bench", bench("modbus", server, tmp_path), *words
    )


@pytest.mark.parametrize(("lie", "status"), [("ignores", 1), ("", 0)])
def test_command_says_what_is_broken_on_hardware(lie, status, check_driver):
    pairs = [word for pair in WIRED.items() for word in ("--measured-by", "=".join(pair))]
    with served("modbus", lie) as server:
        result = check_driver(server, "--hardware", *pairs)
    assert result.status == status, result
    broken = "broken    drives as commanded: 'command' was driven to 1.2 V and stands at 0"
    assert (broken in result.out + result.err) is bool(lie)
    assert "outputs stand at their safe values, read back" in result.out + result.err


def test_command_ends_with_an_error_when_outputs_do_not_go_safe(check_driver):
    with served("modbus", "ignores the safe command") as server:
        result = check_driver(server, "--hardware")
    assert result.status == 3 and "outputs are not safe: 'command'" in result.err


@pytest.mark.parametrize(
    ("pair", "text"),
    [
        ("command", "both names of channels"),
        ("command=nothing", "no input named"),
        ("flow=flow", "no output of device"),
    ],
)
def test_pairs_that_cannot_be_are_told(pair, text, check_driver):
    with served("modbus", "") as server:
        result = check_driver(server, "--measured-by", pair)
    assert text in result.err
