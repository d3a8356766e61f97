"""Every driver of ours passes the conformance suite on its twin; every check of the suite can fail."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from drivers._modbus_line import ModbusLine
from hil.bench.find import benches
from hil.bench.read import read_bench
from hil.bench.twin import subject
from hil.catalog import entries
from hil.cli.commands import new as begin
from hil.daq.channel import Terminal, Wiring
from hil.daq.conformance import CHECKS, Result, Subject, Witness, examine, left_safe, verdict_of
from hil.daq.polled import PolledDaq
from hil.errors import DeviceLostError, LinkError
from tests.channels import inputs, outputs
from tests.links import moved, patient_valve
from tests.waits import side_by_side

pytestmark = pytest.mark.xdist_group("waits for twins")  # for clocks: on one worker, beside others that compute

CALM = "timeout_s = 1.0\nlongest_reply_s = 1.0\n"
WATCHDOG = "watchdog_s = 4.0\n"  # longer than an answer that comes late, and what is waited for after it
PATIENT = ("watchdog_s = 1.0", f"{WATCHDOG}{CALM}")
NODE = ("watchdog_s = 0.5", f"{WATCHDOG}{CALM}")
SCANNER = [
    (
        'driver = "modbus"\nmodel = "wago-750"\naddress = "127.0.0.1:15502"\nwatchdog_s = 1.0',
        f'driver = "scpi"\nmodel = "scanner"\naddress = "/tmp/scanner"\n{CALM}',
    ),
    ('"ao0"', '"dac4"'), ('"ai0"', '"in1"'), ('"ai1"', '"in2"'), ('"ai2"', '"in3"'),
]  # fmt: skip
METER = '[devices.meter]\ndriver = "modbus"\nmodel = "iologik-e1240"\naddress = "127.0.0.1:2"\n\n'
E1241 = [
    ('model = "wago-750"', 'model = "iologik-e1241"'), ("low = -100.0", "low = 0.0"),
    ("[channels.flow]", f"{METER}[channels.flow]"),
    ('device = "io"\nterminal = "ai', 'device = "meter"\nterminal = "ai'),
]  # fmt: skip
CASES: dict[str, tuple[str, str, list[tuple[str, str]]]] = {
    "modbus tcp": ("modbus", "hpv41-modbus-tcp", [PATIENT]),
    "modbus rtu": ("modbus", "hpv41-modbus-rtu", [PATIENT]),
    "modbus outputs alone": (
        "modbus",
        "hpv41-modbus-tcp",
        [*E1241, PATIENT],
    ),
    "scpi": ("scpi", "hpv41-modbus-tcp", SCANNER),
    "text": (
        "text",
        "hpv41-modbus-tcp",
        [
            (
                'driver = "modbus"\nmodel = "wago-750"\naddress = "127.0.0.1:15502"\nwatchdog_s = 1.0',
                f'driver = "text"\nmodel = "tti-ql355"\naddress = "/tmp/supply"\n{CALM}',
            ),
            ('"ao0"', '"voltage"'),
            ('"ai0"', '"measured voltage"'),
            ("low = -100.0", "low = 0.0"),
            (
                '[channels."spool position"]\ndevice = "io"\nterminal = "ai1"',
                '[channels."spool position"]\ndevice = "other"\nterminal = "ai1"',
            ),
            ('device = "io"\nterminal = "ai2"', 'device = "other"\nterminal = "ai2"'),
            ("[channels.flow]", f"{METER.replace('meter', 'other')}[channels.flow]"),
        ],
    ),
    "ascii outputs": ("ascii_module", "hpv41-serial", [("socket://127.0.0.1:14001", "/tmp/module"), PATIENT]),
    "ascii inputs": ("ascii_module", "hpv41-mixed", [('model = "adam-4017"', f'model = "adam-4017"\n{CALM}')]),
    "canopen": ("canopen_valve", "hpv41-canopen", [NODE]),
    "can": (
        "can",
        "hpv41-j1939",
        [
            (
                'driver = "j1939_valve"',
                'driver = "can"\nmodel = "patient.toml"\ntimeout_s = 1\nlongest_reply_s = 2\n',
            ),
            ("valve = 1\n", ""),
        ],
    ),
    "canopen by its file": (
        "canopen",
        "hpv41-canopen",
        [
            NODE,
            ('driver = "canopen_valve"', 'driver = "canopen"\nmodel = "io-401"'),
            ('unit = "%"\nsafe = 0.0', 'unit = "%"\ncalibration = { slope = 10.0 }\nsafe = 0.0'),
            ('unit = "%"\nsource = "spool', 'unit = "%"\ncalibration = { slope = 12.5 }\nsource = "spool'),
            ('"set point"', '"ao1"'),
            ('"actual value"', '"ai1"'),
        ],
    ),
    "j1939": ("j1939_valve", "hpv41-j1939", [("valve = 1\n", f"valve = 1\n{WATCHDOG}{CALM}")]),
    "pwm amplifier": ("pwm_amplifier", "cummins-efc-modbus", [PATIENT]),
}


def bench_of(case: str, folder: Path) -> Path:
    text = benches()[CASES[case][1]].read_text(encoding="utf-8")
    for old, new in CASES[case][2]:
        assert old in text, old
        text = text.replace(old, new)
    patient_valve(folder)
    path = folder / "bench.toml"
    path.write_text(moved(text, folder), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """What is found of every driver: they wait for answers that do not come, at the same time."""
    folders = {case: tmp_path_factory.mktemp(case.replace(" ", "-")) for case in CASES}
    return dict(zip(CASES, side_by_side(lambda case: results_of(case, folders[case]), CASES), strict=True))


def results_of(case: str, folder: Path) -> list[Result]:
    with subject(read_bench(bench_of(case, folder)), folder, CASES[case][0]) as driver:
        return list(examine(driver))


def broken(results: list[Result]) -> dict[str, str]:
    return {result.check: result.text for result in results if result.verdict == "broken"}


@pytest.mark.parametrize("case", CASES)
def test_driver_passes_on_its_twin(case, found, tmp_path):
    results = found[case] if not broken(found[case]) else results_of(case, tmp_path)  # alone: a busy computer is late
    assert broken(results) == {}
    assert sum(result.verdict == "passed" for result in results) >= 8


@pytest.mark.parametrize(("timer", "said"), [(True, "broken"), (False, "passed")])
def test_driver_that_arms_nothing(timer, said, install_package, tmp_path):
    """Where its twin has to be armed it is broken; where its twin is armed at the device, that is said."""
    name = f"lazy_{said}"
    driver, twin = (
        (Path(begin.__file__).parent / "templates" / f"{kind}.txt").read_text(encoding="utf-8").replace("@NAME@", name)
        for kind in ("driver", "device")
    )
    armed = 'watchdog=((0x0101, "{safe:out}"), (0x0100, "{tenths}")),'
    assert armed in driver and "timer=WATCHDOG" in twin
    driver = driver.replace(armed, "")
    twin = twin if timer else twin.replace("timer=WATCHDOG", 'settings["watchdog_s"]')
    install_package("hil.drivers", f"{name}_drivers", {f"{name}.py": driver})
    install_package("hil.sim_devices", f"{name}_devices", {f"{name}.py": twin})
    text = benches()["hpv41-modbus-tcp"].read_text(encoding="utf-8")
    for old, other in (
        PATIENT,
        ('driver = "modbus"\nmodel = "wago-750"', f'driver = "{name}"'),
        ('"ao0"', '"out"'),
        ('"ai0"', '"in"'),
    ):
        text = text.replace(old, other)
    text = (
        text[: text.index('[channels."spool position"]')]
        + text[text.index("[protection]") : text.index("[simulation]")]
    )
    path = tmp_path / "bench.toml"
    path.write_text(moved(text, tmp_path), encoding="utf-8")
    with subject(read_bench(path), tmp_path, name) as examined:
        verdict, text = verdict_of(CHECKS["has_the_watchdog_that_it_promises"], examined)
    assert verdict == said, text
    assert ("outputs stand elsewhere than safe" if timer else "the driver arms nothing") in text


def test_every_driver_is_a_case():
    on_its_imitation = {"ni"}  # tests/unit/test_driver_ni.py: no protocol to serve
    drivers = {entry.name for entry in entries("drivers")}
    assert {driver for driver, _, _ in CASES.values()} | on_its_imitation == drivers


class Device:
    """The other end: a value for each terminal, a clock of its own, and what spoils its answers."""

    def __init__(self, watchdog_s: float = math.inf) -> None:
        self.watchdog_s = watchdog_s
        self.value, self.quirks, self.heard_s, self.there = 0.0, {}, time.monotonic(), True
        self.armed = self.latched = False

    def read(self) -> Mapping[str, float]:
        return {"in": self.standing("out")}

    def standing(self, _terminal: str) -> float:
        if self.armed and time.monotonic() - self.heard_s > self.watchdog_s:
            self.value = 0.0
        return self.value

    def spoil(self, **quirks: Any) -> None:
        self.quirks = quirks

    def ask(self) -> dict[str, Any]:
        """What is wrong with the next answer."""
        if not self.there:
            raise DeviceLostError("nobody there")
        quirks = dict(self.quirks)
        if self.quirks.get("answers"):
            self.quirks = {}
        self.standing("out")
        self.heard_s = time.monotonic()
        if quirks.get("reboot"):
            self.value, self.latched = 0.0, True
        return quirks


class Link:
    """A driver's link that keeps everything, unless `fault` names what it breaks."""

    keep_alive_s: float | None = 0.05

    def __init__(self, device: Device, fault: str) -> None:
        self.watchdog_s: float | None = None if math.isinf(device.watchdog_s) else device.watchdog_s
        self.device, self.fault = device, fault
        self.told: float | None = None
        self.stale: float | None = None
        if fault == "opens anything":
            device.there = True
        device.latched = False
        device.ask()
        if fault in ("moves on opening", "moves to elsewhere"):
            device.value = 7.0
        self.commands = 0
        device.armed = fault != "no watchdog"
        self.sent_s = time.monotonic()

    def standing(self) -> Mapping[str, float]:
        return {
            "out": 0.0 if self.fault in ("moves on opening", "says that it is safe") else self._asked(self.device.value)
        }

    def drive(self, values: Mapping[str, float]) -> None:
        self._asked(0.0)
        self.told = values["out"]
        self.sent_s = time.monotonic()
        if self.fault == "does not drive":
            return
        if self.fault == "does not go safe" and self.told == 0.0:
            return
        self.commands += 1
        if self.fault == "sticks" and self.commands > 50:
            return
        if self.fault == "saturates":
            self.told = max(-8.0, min(8.0, self.told))
        if not self.device.latched:
            self.device.value = self.told * (0.5 if self.fault == "wrong scale" else 1.0)

    def read(self) -> Mapping[str, float]:
        silent = time.monotonic() - self.sent_s > self.device.watchdog_s
        if silent and self.told and self.fault != "silent about its watchdog":
            self.sent_s = time.monotonic()
            raise LinkError("its watchdog has expired")
        value = self._asked(self.device.value)
        if self.fault == "takes late answers" and self.stale is not None:
            value, self.stale = self.stale, None
        if self.fault == "wrong reading":
            value += 1.0
        if self.fault == "beyond its range":
            value = 99.0
        restarted = self.told is not None and abs(self.device.value - self.told) > 0.01
        if restarted and self.device.latched and self.fault != "does not notice":
            raise LinkError("the device restarted")
        return {"in": value}

    def close(self) -> None:
        self.stale = None

    def _asked(self, value: float) -> float:
        quirks = self.device.ask()
        if quirks.get("silent") and self.fault == "invents readings":
            return value
        if quirks.get("silent") and self.fault == "other errors":
            raise TimeoutError("no answer")
        if quirks.get("cut") and self.fault == "believes half":
            return value
        if quirks.get("garbled") and self.fault == "trips over garbage":
            raise ValueError("invalid literal")
        if quirks.get("late_s"):
            self.stale = value
        if quirks.get("not_a_number"):
            return -327.68 if self.fault == "reads the mark" else math.nan
        noticed = not (quirks.get("reboot") and self.fault == "does not notice")
        if quirks.keys() - {"answers"} and noticed:
            raise LinkError("no valid answer")
        return value


def driver(device: Device, fault: str) -> Any:
    def open_daq(settings: Any, wiring: Wiring) -> Any:
        device.there = settings.there
        daq: Any = PolledDaq({"x": Link(device, fault)}, {"x": wiring})
        return Spoiled(daq, device, fault) if fault in DAQ_FAULTS else daq

    def open_link(settings: Any, _wiring: Wiring) -> Link:
        device.there = settings.there
        return Link(device, fault)

    terminals = {"out": Terminal("out", "voltage", "V", -10.0, 10.0), "in": Terminal("in", "voltage", "V", -10.0, 10.0)}
    if fault == "no units":
        terminals["in"] = Terminal("in", "voltage", "nonsense", -10.0, 10.0)
    return SimpleNamespace(
        __doc__="" if fault == "no summary" else "A driver.", open_daq=open_daq, open_link=open_link,
        terminals=lambda _settings: terminals,
    )  # fmt: skip


class Spoiled:
    """A DAQ that breaks what the loop over links would keep by itself."""

    def __init__(self, daq: Any, device: Device, fault: str) -> None:
        self._daq, self._device, self._fault = daq, device, fault

    def __getattr__(self, name: str) -> Any:
        return getattr(self._daq, name)

    @property
    def levels(self) -> Mapping[str, float]:
        return {"a": 3.0} if self._fault == "tells other levels" else dict(self._daq.levels)

    @property
    def promises(self) -> Any:
        promises = self._daq.promises
        return replace(promises, delays_s={"b": 0.0}) if self._fault == "knows no delay" else promises

    def actual_rate_hz(self, asked_hz: float) -> float:
        return asked_hz * 1.1 if self._fault == "rate is none of its own" else float(self._daq.actual_rate_hz(asked_hz))

    def play(self, waveform: Any, block_samples: int | None = None) -> Iterator[Any]:
        if self._fault == "drives beyond its range":
            waveform = replace(waveform, outputs={name: v.clip(-10.0, 10.0) for name, v in waveform.outputs.items()})
        blocks = self._daq.play(waveform, block_samples)
        return (replace(b, time_s=0.0 * b.time_s) for b in blocks) if self._fault == "time stands still" else blocks

    def close(self) -> None:
        stood_at = self._device.value
        self._daq.close()
        if self._fault == "leaves outputs on":
            self._device.value = stood_at


DAQ_FAULTS = {
    "tells other levels", "knows no delay", "rate is none of its own", "drives beyond its range", "time stands still",
    "leaves outputs on",
}  # fmt: skip
BREAKS: dict[str, set[str]] = {
    "says_what_it_is": {"no summary", "no units"},
    "says_soon_that_nobody_is_there": {"opens anything"},
    "leaves_outputs_where_they_are": {"moves on opening", "tells other levels"},
    "drives_as_commanded": {"does not drive", "wrong scale"},
    "obeys_every_command": {"sticks", "does not drive"},
    "reaches_its_limits": {"saturates"},
    "goes_to_its_safe_value_on_command": {"does not go safe"},
    "stands_while_the_link_is_opened_again": {"moves to elsewhere", "says that it is safe"},
    "an_input_sees_what_it_drives": {"does not drive", "wrong scale", "wrong reading"},
    "reads_what_is_there": {"wrong reading", "reads the mark"},
    "tells_where_outputs_stand": {"tells other levels"},
    "one_reading_for_each_sample": {"beyond its range", "time stands still"},
    "keeps_the_rate": {"rate is none of its own"},
    "says_how_late_its_readings_are": {"knows no delay"},
    "refuses_a_range_before_the_first_sample": {"drives beyond its range"},
    "goes_safe_immediately_and_again": {"does not go safe"},
    "closes_safe_and_twice": {"leaves outputs on"},
    "says_that_no_answer_came": {"invents readings", "other errors"},
    "never_takes_a_late_answer_for_the_next": {"takes late answers"},
    "does_not_believe_half_an_answer": {"believes half"},
    "survives_garbled_answers": {"trips over garbage"},
    "notices_that_the_device_restarted": {"does not notice"},
    "has_the_watchdog_that_it_promises": {"no watchdog", "silent about its watchdog"},
}
WIRING = Wiring(outputs({"a": "out"}), inputs({"b": "in"}))


def examined(fault: str, check: str) -> Subject:
    """One that watches only where that is tried: else a computer that pauses would let its watchdog act."""
    device = Device(1.0 if "watchdog" in check else math.inf)
    here, elsewhere = (SimpleNamespace(there=there, timeout_s=0.05) for there in (True, False))
    witness = Witness(WIRING.inputs["b"], lambda raw: raw, 0.1)
    return Subject(
        driver(device, fault), here, WIRING, elsewhere, device, device.spoil, witnesses={"a": witness}, settling_s=0.1
    )


@pytest.mark.parametrize("check", CHECKS)
def test_check_is_passed_by_a_driver_that_keeps_everything(check):
    assert verdict_of(CHECKS[check], examined("", check)) == ("passed", "")


@pytest.mark.parametrize(("check", "fault"), [(check, fault) for check in BREAKS for fault in sorted(BREAKS[check])])
def test_check_finds_the_driver_that_breaks_it(check, fault):
    verdict, text = verdict_of(CHECKS[check], examined(fault, check))
    assert verdict == "broken" and text


def test_an_answer_to_an_earlier_question_is_found_where_answers_have_numbers(tmp_path, monkeypatch):
    """A driver of Modbus TCP that gives every request the same number is like one that does not look at it."""
    check = CHECKS["never_takes_a_late_answer_for_the_next"]
    file = read_bench(bench_of("modbus tcp", tmp_path))
    with subject(file, tmp_path, "modbus") as driver:
        assert verdict_of(check, driver) == ("passed", "")
    monkeypatch.setattr(ModbusLine, "_number", property(lambda _: 0, lambda _, _number: None), raising=False)
    with subject(file, tmp_path, "modbus") as driver:
        verdict, text = verdict_of(check, driver)
    assert verdict == "broken" and " reads " in text


def test_where_no_input_follows_numbers_of_answers_are_said_to_be_untried():
    check = "never_takes_a_late_answer_for_the_next"
    subject = replace(examined("", check), settling_s=0.0)  # over before anything moves
    subject.module.has_numbers = lambda _settings: True
    verdict, text = verdict_of(CHECKS[check], subject)
    assert verdict == "passed" and "was not tried" in text


def test_every_check_has_a_driver_that_breaks_it():
    assert set(BREAKS) == set(CHECKS)


def test_board_that_has_no_link_is_asked_at_the_end_too():
    for fault in ("", "does not go safe"):
        device = Device()
        module = driver(device, fault)
        del module.open_link
        board = Subject(module, SimpleNamespace(there=True, timeout_s=0.05), WIRING)
        assert verdict_of(CHECKS["closes_safe_and_twice"], board)[0] == ("broken" if fault else "passed")
        if fault:
            device.value = 7.0
            with pytest.raises(DeviceLostError, match=r"not safe: 'a' stands at 7 V; use the emergency stop"):
                left_safe(board)
        else:
            assert left_safe(board) == "outputs stand at their safe values, read back"
