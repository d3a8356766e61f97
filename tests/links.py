"""Benches whose devices are served on real links, in this process or one of their own, with the plant behind them."""

from __future__ import annotations

import random
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from hil.bench.find import benches
from hil.bench.read import BenchFile, read_bench
from hil.bench.twin import serve
from hil.description.find import descriptions
from hil.errors import RangeError
from hil.rig import Rig
from tests.driven import silent_rig
from tests.waits import PATIENCE_S

_ANY = random.SystemRandom()  # workers that share a seed must not ask for the same
SELDOM = tuple((f"sample_rate_hz = {rate_hz}\n", "sample_rate_hz = 20\n") for rate_hz in (50, 100))
# What a link waits for an answer, and how often it is asked, where that is not what is tried: a busy computer is slow.
ANSWERS = (
    *SELDOM,
    *((f'driver = "{name}"\n', f'driver = "{name}"\ntimeout_s = 3.0\nlongest_reply_s = 3.0\n')
      for name in ("modbus", "ascii_module", "scpi", "text", "can", "canopen", "canopen_valve", "j1939_valve",
                   "pwm_amplifier")),
)  # fmt: skip
# Devices' own watchdogs wait as well.
PATIENT = (
    ("node = 1\nwatchdog_s = 0.5\n", "node = 1\nwatchdog_s = 10.0\n"),
    ("node = 1\n\n", "node = 1\nwatchdog_s = 10.0\n\n"),
    ("valve = 1\n", "valve = 1\nwatchdog_s = 10.0\n"),
    ("watchdog_s = 1.0\n", "watchdog_s = 10.0\n"),
)
CALM = (
    *PATIENT,
    *SELDOM,
    *((f"noise = {std}", "noise = 0.01") for std in ("0.3", "0.1", "0.2")),
)


@contextmanager
def opened(file: BenchFile, run: Path, settings: dict[str, Any] | None = None) -> Iterator[Rig]:
    """A rig, opened again while this computer is so busy that a link measures itself as too slow for its rate."""
    with ExitStack() as stack:
        for tries_left in reversed(range(20)):
            try:
                rig = stack.enter_context(silent_rig(file, run, settings))
                break
            except RangeError:
                if not tries_left:
                    raise
                time.sleep(0.5)
        yield rig


def free_port() -> int:
    """A port that nobody has, below those that the system gives to connections: one of these may be gone soon."""
    while True:
        port = _ANY.randrange(15_000, 32_000)
        with suppress(OSError), socket.socket() as probe:
            probe.bind(("127.0.0.1", port))
            return port


def bench_text(bench: str, *changes: tuple[str, str]) -> str:
    """A bench file that packages bring along, by name, its text changed."""
    text = benches()[bench].read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text or (old, new) in CALM, old
        text = text.replace(old, new)
    return text


def patient_valve(folder: Path) -> str:
    """The description of the ISOBUS valve, in this folder, with times that a busy computer keeps; its file's name."""
    valve = descriptions()["isobus-valve"]
    text = valve.read_text(encoding="utf-8").replace("isobus-valve.dbc", str(valve.with_suffix(".dbc")))
    text = text.replace("timeout_s = 0.3", "timeout_s = 1.0").replace("time_s = 0.3", "time_s = 4.0")
    (folder / "patient.toml").write_text(text, encoding="utf-8")
    return "patient.toml"


def answered(text: str, answers: tuple[tuple[str, str], ...] = ANSWERS) -> str:
    """A bench file whose links wait so long for answers, unless it says how long."""
    if "timeout_s" not in text:
        for driver, patient in answers:
            text = text.replace(driver, patient)
    return text


def moved(text: str, folder: Path) -> str:
    """A bench file with every address at a place of its own: a free port, a name in a folder, a bus of that name."""
    text = re.sub(r"127\.0\.0\.1:\d+", lambda _: f"127.0.0.1:{free_port()}", text)
    return re.sub(r'"(/tmp|virtual:)/?([\w-]+)"', lambda m: f'"{m[1]}{folder.name}-{m[2]}"' if ":" in m[1] else
                  f'"{folder}/{m[2]}"', text)  # fmt: skip


@contextmanager
def served(
    bench: str, folder: Path, *changes: tuple[str, str], quirks: dict[str, dict[str, Any]] | None = None,
    answers: tuple[tuple[str, str], ...] = ANSWERS,
) -> Iterator[tuple[BenchFile, dict[str, Any]]]:  # fmt: skip
    """A bench that packages bring along, by name, its text changed, and its devices by name.

    Links wait for `answers`, unless the changes say how long.
    """
    path = folder / f"{bench}.toml"
    path.write_text(moved(answered(bench_text(bench, *changes), answers), folder), encoding="utf-8")
    file = read_bench(path)
    devices = serve(file, folder, quirks or {})
    try:
        yield file, devices
    finally:
        for device in devices.values():
            device.close()


@contextmanager
def devices_of(path: Path) -> Iterator[tuple[subprocess.Popen[str], list[str]]]:
    """The devices of a bench file in a process of their own, and the lines that it told when they were there."""
    process = subprocess.Popen(
        [sys.executable, "-m", "hil", "devices", str(path)], stdout=subprocess.PIPE, text=True, encoding="utf-8"
    )
    assert process.stdout is not None
    told: list[str] = []
    try:
        while not told or "Ctrl-C" not in told[-1]:
            line = process.stdout.readline()
            assert line, f"the devices ended: {told}"
            told.append(line.strip())
        yield process, told
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            raise
        finally:
            process.stdout.close()
