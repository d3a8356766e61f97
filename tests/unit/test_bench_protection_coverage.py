"""Missing protection: every rule speaks where something is missing, with its remedy, and no shipped bench lacks any."""

from __future__ import annotations

import datetime as dt
import importlib.util
import socket
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from hil.bench.find import benches
from hil.bench.protection_coverage import calibration, channels, devices, packages, times
from hil.bench.protection_coverage.missing import RULES, contradicting_oil, missing_protection
from hil.bench.read import BenchFile, read_bench
from hil.errors import HardwareError, HilError
from tests.links import SELDOM, opened, served

DAY = dt.date(2026, 7, 1)
TCP, SERIAL, NI, EFC = "hpv41-modbus-tcp", "hpv41-serial", "hpv41-usb-6211", "cummins-efc-acceptance"
ADDRESS = 'address = "127.0.0.1:15502"'
TO_SCANNER = (
    '[devices.module]\ndriver = "ascii_module"\nmodel = "adam-4024"\naddress = "socket://127.0.0.1:14001"\n'
    "watchdog_s = 1.0\n\n"
)
BARE = [
    ('model = "wago-750"\n', (
        "description = { summary = 'bare', modbus = { addresses = 'wire' }, terminals = { "
        "ao0 = { direction = 'out', unit = 'V', range = [-10, 10], table = 'holding', address = 0, "
        "read_back = false }, "
        "'ai{n}' = { count = 4, direction = 'in', unit = 'V', range = [-10, 10], table = 'input', address = 0 } } }\n"
    )),
    ("watchdog_s = 1.0\n", ""),
]  # fmt: skip
SPEAKS = {
    "described without a watchdog": (devices.no_watchdog, TCP, BARE, "device 'io': driver 'modbus' has no watchdog",
                                     "put a relay into the valve's supply"),
    "described without read-back": (devices.not_read_back, TCP, BARE,
                                    "channel 'command': device 'io' cannot be asked where ao0 stands",
                                    "give an input that measures it an interlock"),
    "own watchdog off": (devices.watchdog_off, TCP, [("watchdog_s = 1.0\n", "")],
                         "device 'io': its own watchdog is off", "say watchdog_s = … under [devices.io]"),
    "NI without an enable line": (devices.no_watchdog, NI, [("on = 1.0\n", "")],
                                  "device 'daq': driver 'ni' has no watchdog", "output with safe = 0 and on = 1"),
    "SCPI source": (devices.no_watchdog, SERIAL,
                    [(TO_SCANNER, ""), ('"module"\nterminal = "ao0"', '"scanner"\nterminal = "dac4"')],
                    "device 'scanner': driver 'scpi' has no watchdog", "put a relay into the valve's supply"),
    "SCPI source on USB": (devices.untried_transport, SERIAL,
                           [(TO_SCANNER, ""), ('"module"\nterminal = "ao0"', '"scanner"\nterminal = "dac4"'),
                            ('"/tmp/hil-scpi"', '"USB0::0x0957::0x0407::MY1::INSTR"')],
                           "device 'scanner': whether a command can arrive late there", "VXI-11, HiSLIP or a socket"),
    "neutral at 5 V": (devices.watchdog_not_safe, TCP,
                       [("calibration = { slope = 10.0, uncertainty = 0.05",
                         "calibration = { slope = 20.0, offset = -100.0, uncertainty = 0.05")],
                       "the watchdog of device 'io' puts it at 0 V, but its safe value is 5 V", "connect the valve so"),
    "floating valve": (devices.watchdog_not_safe, "hpv41-j1939", [("valve = 1\n", 'valve = 1\nfail_safe = "float"\n')],
                       "the watchdog of device 'valve' lets it float", "take another device"),
    "no watchdog process": (devices.no_watchdog_process, TCP, [("block_s = 0.1", "block_s = 0.1\nwatchdog_s = 0")],
                            "no process makes outputs safe", "take it away from [protection]"),
    "hasty watchdog process": (times.too_hasty, TCP, [("block_s = 0.1", "block_s = 0.1\nwatchdog_s = 5")],
                               "the way to the safe values takes up to 7.3 s", "say watchdog_s = 9 under [protection]"),
    "listens to all": (devices.open_to_others, TCP, [(ADDRESS, 'address = "0.0.0.0:15502"')],
                       "0.0.0.0 is this computer as others see it", "say 127.0.0.1"),
    "listens to all, in short": (devices.open_to_others, TCP, [(ADDRESS, 'address = "0:15502"')],
                                 "device 'io': 0 is this computer as others see it", "say 127.0.0.1"),
    "interlocks that stop nothing": (channels.without_interlocks, TCP,
                                     [('action = "trip"', 'action = "indicate"'), ('"stop"', '"indicate"')],
                                     "every interlock only indicates", 'action = "stop" or "trip"'),
    "dated ahead": (calibration.dated_ahead, NI, [("date = 2026-03-02,", "date = 2027-03-02,")],
                    "channel 'flow': its calibration is dated 2027-03-02, and today is 2026-07-01", "the day it was"),
    "CAN hub for all": (devices.open_to_others, "hpv41-canopen",
                        [("socketcand:127.0.0.1:29536", "socketcand:0.0.0.0:29536")],
                        "device 'valve': 0.0.0.0", "say 127.0.0.1"),
    "live zero, 2 … 10 V": (channels.live_zeros, TCP,
                            [("calibration = { slope = 25.0,", "calibration = { slope = 31.25, offset = -62.5,")],
                            "channel 'supply pressure': its zero is at 2 V, so that a broken wire reads -62.5 bar",
                            'raw_low = 1.8 and action = "stop"'),
    "live zero that is only indicated": (channels.live_zeros, EFC,
                                         [('raw_low = 0.2\nfor_s = 0.05\naction = "stop"',
                                           'raw_low = 0.2\nfor_s = 0.05\naction = "indicate"')],
                                         "channel 'pressure': its zero is at 2.5 V", "raw_low = 2.2"),
    "no interlocks": (channels.without_interlocks, NI, "interlocks", "nothing watches the bench", "[interlocks.NAME]"),
    "no limits": (channels.without_limits, NI, [("limits = ", "# limits = ")],
                  "channel 'command': an output without limits", "say limits = { low = …, high = … }"),
    "no date": (calibration.undated, NI, [(" date = 2026-03-02,", "")],
                "channel 'command': its calibration has no date", "say calibration.date = YYYY-MM-DD"),
    "overdue channel": (calibration.overdue_today, NI, [("date = 2026-03-02,", "date = 2025-06-30, due = 2026-06-30,")],
                        "Channel 'flow': its calibration was due on 2026-06-30", "put in its new dates"),
    "overdue instrument": (calibration.overdue_today, NI,
                           [('channel = "flow"\n\n[simulation]',
                             'channel = "flow"\nserial = "4711"\ndue = 2026-06-30\n\n[simulation]')],
                           "Instrument 'Parker SCQ-150' (serial 4711): its calibration was due on 2026-06-30",
                           "each run has a deviation"),
    "contradicting oil": (contradicting_oil, "brevini-hpv41", [('"mineral oil"', '"HLP 46"')],
                          "The oil is stated as HLP 46, its viscosity class as ISO VG 32", "Say fluid and"),
}  # fmt: skip


def changed(tmp_path: Path, name: str, changes: list[tuple[str, str]] | str) -> BenchFile:
    text = benches()[name].read_text(encoding="utf-8")
    if changes == "interlocks":
        changes = [(text[text.index("[interlocks.") : text.index("[protection]")], "")]
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    path = tmp_path / f"{name}.toml"
    path.write_text(text, encoding="utf-8")
    return read_bench(path)


@pytest.mark.parametrize("case", SPEAKS)
def test_missing_net_is_told_with_its_remedy(case, tmp_path):
    rule, bench, changes, what, remedy = SPEAKS[case]
    found = list(rule(changed(tmp_path, bench, changes), DAY))
    assert any(what in text and remedy in text for text in found), found
    assert not any("\n" in text for text in found)


def test_every_rule_has_a_bench_on_which_it_speaks():
    spoken = {rule.__name__ for rule, *_ in SPEAKS.values()}
    assert {rule.__name__ for rule in RULES} - spoken == {"_packages"}  # below


@pytest.mark.parametrize("bench", sorted(benches()))
def test_no_shipped_bench_lacks_a_net(bench):
    assert missing_protection(read_bench(benches()[bench]), DAY) == []


def test_simulated_bench_is_not_warned_of_what_it_cannot_have(tmp_path):
    file = changed(tmp_path, "brevini-hpv41", [("[protection]\n", "[protection]\nwatchdog_s = 0\n")])
    assert missing_protection(file, DAY) == []


def test_package_that_is_not_installed_is_told_with_its_extra(monkeypatch):
    there = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "canopen" else there(name))
    (missing,) = packages.packages_lacking(read_bench(benches()["hpv41-mixed"]))
    assert missing == ("device 'valve': driver 'canopen_valve' needs the package 'canopen', which is not installed: "
                       "pip install 'valve-hil[links]'")  # fmt: skip
    assert list(packages.packages_lacking(read_bench(benches()[TCP]))) == []


def test_live_zero_is_watched_by_a_low_limit_too(tmp_path):
    zero = ("calibration = { slope = 25.0,", "calibration = { slope = 31.25, offset = -62.5,")
    low = ("high = 140.0\n", "low = -10.0\nhigh = 140.0\n")
    assert list(channels.live_zeros(changed(tmp_path, TCP, [zero, low]), DAY)) == []
    lvdt = ("calibration = { slope = 12.5,", "calibration = { slope = 25.0, offset = -125.0,")  # mid-stroke at 5 V
    assert list(channels.live_zeros(changed(tmp_path, TCP, [lvdt]), DAY)) == []


def test_calibration_is_good_on_the_day_it_is_due(tmp_path):
    file = changed(tmp_path, NI, [("date = 2026-03-02,", "date = 2025-07-01, due = 2026-07-01,")])
    assert list(calibration.overdue_today(file, DAY)) == []
    assert list(calibration.overdue_today(file, DAY + dt.timedelta(days=1))) != []


def test_address_of_somebody_else_is_no_listener(tmp_path):
    for address in ("192.0.2.10:502", "plc.example:502", "127.0.0.2:502"):
        assert list(devices.open_to_others(changed(tmp_path, TCP, [(ADDRESS, f'address = "{address}"')]), DAY)) == []


QUICK = "timeout_s = 1.0\nlongest_reply_s = 1.5\n"
SILENT = {
    "hpv41-modbus-tcp": ("io", ("watchdog_s = 1.0\n", QUICK)),
    "hpv41-modbus-rtu": ("io", ("watchdog_s = 1.0\n", QUICK)),
    "hpv41-serial": ("module", ("watchdog_s = 1.0\n", QUICK)),
}


@pytest.mark.parametrize("bench", SILENT)
def test_way_to_safe_takes_no_longer_than_is_said(bench, tmp_path):
    """The device with the output falls silent while it is driven, until the program has let go of everything."""
    name, quick = SILENT[bench]
    alone = ("block_s = 0.1", "block_s = 0.1\nwatchdog_s = 0")
    with served(bench, tmp_path, quick, alone, *SELDOM) as (file, twins):
        behaviour = twins[name].behaviour
        silent_s = []

        def fall_silent():
            silent_s.append(time.monotonic())
            behaviour.quirks = behaviour.quirks.model_copy(update={"silent": True})

        def drive():
            with opened(file, tmp_path / "run", {"procedure": "test"}) as rig:
                threading.Timer(0.5, fall_silent).start()
                rig.play(np.full(2000, 40.0))

        with pytest.raises(HardwareError):
            drive()
        took_s = time.monotonic() - silent_s[0]
        says_s = times.way_to_safe_s(file)
    assert took_s <= says_s + 60.0, "it waited without end"  # `make test-slow` judges the seconds


def test_check_tells_warnings_and_with_strict_they_are_exit_status_2(tmp_path, command_line):
    path = changed(tmp_path, TCP, [("watchdog_s = 1.0\n", ""), (ADDRESS, 'address = "0.0.0.0:15502"')]).path
    status, out, err = command_line("check", path)
    assert (status, err) == (0, "") and out.count("warning: ") == 2 and "no faults" in out
    status, out, err = command_line("check", path, "--strict")
    assert status == 2 and out.count("warning: ") == 2 and "2 warnings, and --strict allows none" in err
    assert command_line("check", TCP, "--strict").status == 0


def test_name_of_this_computer_is_a_listener_where_others_reach_it(tmp_path, monkeypatch):
    monkeypatch.setattr(socket, "gethostname", lambda: "Bench-PC")
    for numbers, warned in (("0.0.0.0", True), ("127.0.1.1", False)):
        place = [(socket.AF_INET, socket.SOCK_STREAM, 6, "", (numbers, 0))]
        monkeypatch.setattr(socket, "getaddrinfo", lambda *_words, place=place, **_more: place)
        file = changed(tmp_path, TCP, [(ADDRESS, 'address = "bench-pc:15502"')])
        assert bool(list(devices.open_to_others(file, DAY))) is warned


@pytest.mark.parametrize(
    ("change", "text"),
    [((ADDRESS, 'address = "*:15502"'), "is not host:port"),
     (("date = 2026-03-02,", "date = 2026-03-02, due = 2026-03-01,"),
      "command.calibration.due: 2026-03-01 lies before date = 2026-03-02")],
)  # fmt: skip
def test_address_and_dates_that_cannot_be_are_faults(change, text, tmp_path):
    with pytest.raises(HilError, match=text):
        changed(tmp_path, TCP, [change])


def test_driver_that_throws_when_it_is_asked_is_a_fault_of_that_driver(tmp_path, monkeypatch):
    def terminals(_settings):
        raise KeyError("x")

    monkeypatch.setattr("drivers.modbus.terminals", terminals)
    with pytest.raises(HilError, match=r"devices.io.driver: drivers\.modbus is at fault: KeyError: 'x'"):
        changed(tmp_path, TCP, [])
