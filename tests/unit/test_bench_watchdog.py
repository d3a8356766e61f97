"""The watchdog process: each device by itself, nothing of the working folder, and a reason when it dies."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import ClassVar

import pytest
from wire import Wire

from hil.bench import fail_safe_shutdown, watchdog
from hil.bench.heartbeat import HeartbeatClient
from hil.bench.read import BenchFile, read_bench
from hil.bench.stop.stop_service import StopService
from hil.daq.channel import Wiring
from hil.daq.contract import ReadBack
from hil.errors import HardwareError, LinkError
from tests.links import PATIENT, bench_text, moved, served

STOPS = StopService({}, "watchdog", lambda _wish: None)
BROKEN = [RuntimeError("error 105"), SystemExit("of a library"), MemoryError(), KeyError("ao0")]


class Valve(Wire):
    """Two devices' worth of outputs; what it throws it throws at every call."""

    def __init__(self, error: BaseException | None, answers: bool = True) -> None:
        super().__init__(levels={"a": 5.0})
        self._error, self._answers = error, answers

    def make_safe(self) -> None:
        if self._error is not None:
            raise self._error
        super().make_safe()

    def read_back(self) -> Mapping[str, ReadBack]:
        return super().read_back() if self._answers else dict.fromkeys(self.outputs, ReadBack(why="no answer"))

    def close(self) -> None:
        self.closed += 1


def bench_of(folder: Path, devices: Mapping[str, Valve], late_s: float = 0.05) -> BenchFile:
    """A bench file whose devices are these, each with one output."""
    path = folder / "bench.toml"
    path.write_text(moved(bench_text("hpv41-modbus-tcp"), folder), encoding="utf-8")
    file = read_bench(path)
    (real,) = (device for device in file.devices.values() if device.module)
    command = file.bench.channels["command"]
    channels = {name: command.model_copy(update={"device": name}) for name in devices}
    bench = file.bench.model_copy(update={"channels": channels})

    def opening(valve: Valve) -> SimpleNamespace:
        def open_daq(_settings: object, _wiring: Wiring) -> Valve:
            return valve

        return SimpleNamespace(open_daq=open_daq)

    real = replace(real, late_s=late_s)
    return replace(
        file, bench=bench,
        devices={name: replace(real, name=name, module=opening(valve)) for name, valve in devices.items()},
    )  # fmt: skip


def shut_down(file: BenchFile) -> tuple[list[str], list[str], float]:
    """What is left, what could not be asked, and how long it took."""
    made = fail_safe_shutdown.FailSafeShutdown(file, STOPS)
    made.with_patience()
    return made.left, made.unasked, made.took_s


@pytest.fixture(autouse=True)
def soon(monkeypatch):
    """It gives up after a moment."""
    monkeypatch.setattr(fail_safe_shutdown, "GIVE_UP_S", 0.2)
    monkeypatch.setattr("hil.safety.outputs._PATIENCE_S", 0.02)


@pytest.mark.parametrize("error", BROKEN)
def test_device_that_throws_anything_keeps_no_other_from_it(tmp_path, error, monkeypatch):
    monkeypatch.setattr(fail_safe_shutdown, "GIVE_UP_S", 2.0)  # on a busy machine one try may take 0.2 s
    devices = {"sick": Valve(error, answers=False), "healthy": Valve(None)}
    left, unasked, _ = shut_down(bench_of(tmp_path, devices, late_s=0.0))
    assert devices["healthy"].levels["a"] == 0.0 and devices["healthy"].closed
    assert len(left) == 1 and left[0].startswith("sick: nobody knows") and not unasked
    assert devices["sick"].closed > 1  # tried again, and let go of each time


def test_what_is_not_safe_is_told_while_it_is_still_tried(tmp_path, monkeypatch):
    monkeypatch.setattr(fail_safe_shutdown, "GIVE_UP_S", 6.0)
    monkeypatch.setattr(fail_safe_shutdown, "_TELLS_S", 2.0)
    made = fail_safe_shutdown.FailSafeShutdown(
        bench_of(tmp_path, {"gone": Valve(OSError("pulled"), answers=False), "healthy": Valve(None)}, late_s=0.0), STOPS
    )
    begun_s, told = time.monotonic(), []
    made.with_patience(lambda: told.append((time.monotonic() - begun_s, made.left)))
    ((after_s, left),) = told
    assert after_s < fail_safe_shutdown.GIVE_UP_S and len(left) == 1 and left[0].startswith("gone: ")
    assert time.monotonic() - begun_s >= 6.0, "it went on trying"


def test_what_does_not_obey_is_left_to_its_own_watchdog(tmp_path, monkeypatch):
    class Deaf(Valve):
        """Obeys nothing, and closes when it has heard nothing for as long as the bench says."""

        heard_s = time.monotonic()

        def make_safe(self):
            if time.monotonic() - self.heard_s > 1.0:
                super().make_safe()
            self.heard_s = time.monotonic()

    monkeypatch.setattr(fail_safe_shutdown, "GIVE_UP_S", 8.0)
    monkeypatch.setattr(fail_safe_shutdown, "_MOMENT_S", 0.3)
    deaf = Deaf(None)
    assert shut_down(bench_of(tmp_path, {"deaf": deaf}, late_s=0.0))[0] == []
    assert deaf.levels["a"] == 0.0


def test_what_cannot_be_reached_is_tried_on_for_longer_than_its_watchdog_takes(tmp_path, monkeypatch):
    """Nothing that is sent on a dead link feeds a watchdog, and when it is back every moment counts."""

    class Behind(Valve):
        """On a link that is back once it was tried for a second."""

        tried_s: ClassVar[list[float]] = []

        def make_safe(self):
            self.tried_s.append(time.monotonic())
            if self.tried_s[-1] - self.tried_s[0] > 1.0:
                self._error, self._answers = None, True
            super().make_safe()

    monkeypatch.setattr(fail_safe_shutdown, "GIVE_UP_S", 8.0)
    monkeypatch.setattr(fail_safe_shutdown, "_MOMENT_S", 0.3)
    behind = Behind(LinkError("no answer"), answers=False)
    assert shut_down(bench_of(tmp_path, {"behind": behind}, late_s=0.0))[0] == []
    assert max(next_s - one_s for one_s, next_s in pairwise(behind.tried_s)) < 1.5  # its silence


def test_what_is_safe_at_once_is_told_at_the_end_alone(tmp_path):
    told = []
    fail_safe_shutdown.FailSafeShutdown(bench_of(tmp_path, {"healthy": Valve(None)}, late_s=0.0), STOPS).with_patience(
        lambda: told.append(None)
    )
    assert not told


def test_what_only_time_is_missing_for_is_told_at_once(tmp_path, monkeypatch):
    monkeypatch.setattr(fail_safe_shutdown, "GIVE_UP_S", 20.0)
    made = fail_safe_shutdown.FailSafeShutdown(bench_of(tmp_path, {"healthy": Valve(None)}, late_s=3.0), STOPS)
    told = []
    made.with_patience(lambda: told.append((made.announcement, str(made.outputs["a"].state))))
    ((said, state),) = told
    assert said.startswith("outputs: safe, read back; confirmed in ") and state == "unconfirmed"
    assert not made.left and made.outputs["a"].state == "safe" and made.took_s < 3.0  # not what was waited for


def test_driver_that_does_not_return_is_tried_anew(tmp_path, monkeypatch):
    class Hanging(Valve):
        tries = 0

        def make_safe(self):
            self.tries += 1
            if self.tries == 1:
                threading.Event().wait(30.0)
            super().make_safe()

    monkeypatch.setattr(fail_safe_shutdown, "GIVE_UP_S", 5.0)
    monkeypatch.setattr(fail_safe_shutdown, "_HANGS_S", 0.2)
    devices = {"hanging": Hanging(None)}
    left, unasked, _ = shut_down(bench_of(tmp_path, devices, late_s=0.0))
    assert not left and not unasked
    assert devices["hanging"].levels["a"] == 0.0 and devices["hanging"].tries >= 2


def test_a_slow_first_try_does_not_undo_what_the_next_one_found(tmp_path, monkeypatch):
    """On a slow line that one was still under way; it failed later, and NOT SAFE was the last word."""

    class SlowAtFirst(Valve):
        tries = 0
        another = threading.Event()
        was_overtaken = False

        def make_safe(self):
            self.tries += 1
            if self.tries == 1:
                self.was_overtaken = self.another.wait(0.5)
                raise LinkError("no answer")
            self.another.set()
            super().make_safe()

    monkeypatch.setattr(fail_safe_shutdown, "GIVE_UP_S", 5.0)
    monkeypatch.setattr(fail_safe_shutdown, "_MOMENT_S", 0.05)
    slow = SlowAtFirst(None)
    made = fail_safe_shutdown.FailSafeShutdown(bench_of(tmp_path, {"slow": slow}, late_s=0.0), STOPS)
    made.one_attempt()
    made.with_patience()
    assert not slow.was_overtaken and not made.left and slow.levels["a"] == 0.0


def test_late_command_of_the_dead_program_does_not_outlast_the_watchdog(tmp_path, monkeypatch):
    class Late(Valve):
        """What the dead program had sent arrives after the outputs were made safe, and after they were read back."""

        asked = 0

        def close(self):
            super().close()
            self.asked += 1
            if self.asked <= 2:
                self.levels = {**self.levels, "a": 5.0}

    monkeypatch.setattr(fail_safe_shutdown, "GIVE_UP_S", 10.0)
    valve = Late(None)
    left, _, took_s = shut_down(bench_of(tmp_path, {"late": valve}, late_s=0.3))
    assert not left and valve.levels["a"] == 0.0
    assert took_s > 0.05, "the time at which it came to stay there is told, not the first one"


def test_told_is_not_safe_until_it_is_read_back(tmp_path):
    devices = {"mute": Valve(None, answers=False)}
    left, _, _ = shut_down(bench_of(tmp_path, devices, late_s=0.0))
    remedy = "was commanded safe, and could not be read back (no answer): use the emergency stop"
    assert left == [f"mute: 'a' {remedy}; 'b' {remedy}"]


def test_report_goes_to_the_state_folder_when_that_of_the_run_is_gone(tmp_path, monkeypatch, capfd):
    monkeypatch.setenv("HIL_STATE_DIR", str(tmp_path / "state"))
    file = bench_of(tmp_path, {"healthy": Valve(None)}, late_s=0.0)
    watchdog.take_over(watchdog.Reporter(file, tmp_path / "gone", os.getpid(), "ended"), STOPS)
    (told,) = (tmp_path / "state" / "watchdog").glob("*.json")
    assert "safe_after_s" in told.read_text() and "outputs made safe in" in capfd.readouterr().err


def test_nothing_of_the_working_folder_is_executed(tmp_path, monkeypatch):
    for name in ("queue", "json", "socket"):
        (tmp_path / f"{name}.py").write_text(f"open({str(tmp_path / 'executed')!r}, 'w')\n")
    with served("hpv41-modbus-tcp", tmp_path, *PATIENT) as (file, _):
        monkeypatch.chdir(tmp_path)
        heart = HeartbeatClient(file, tmp_path / "run")
        heart.wait_until_ready()
        heart.say_farewell()
    assert not (tmp_path / "executed").exists()


def test_watchdog_that_dies_says_why(tmp_path, capfd):
    missing = tmp_path / "nowhere"
    assert watchdog.main(str(tmp_path / "bench.toml"), "1", str(tmp_path), str(missing)) == 3
    said = capfd.readouterr()
    assert said.out.startswith("error died of FileNotFoundError") and "hil watchdog: died of" in said.err


def test_run_hears_what_its_watchdog_died_of(tmp_path, monkeypatch):
    path = tmp_path / "bench.toml"
    path.write_text(moved(bench_text("hpv41-modbus-tcp"), tmp_path), encoding="utf-8")
    heart = HeartbeatClient(read_bench(path), tmp_path / "run")  # nobody serves the device
    with pytest.raises(HardwareError, match=r"^the watchdog process: io: .*cannot be reached"):
        heart.wait_until_ready()
    monkeypatch.setattr(sys, "executable", "/bin/false")
    heart = HeartbeatClient(read_bench(path), tmp_path / "run")
    with pytest.raises(HardwareError, match="the watchdog process: ended with status 1"):
        heart.wait_until_ready()
