"""Twenty who look on: no sample is lost, and the blocks of the run come no later than without a console."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import numpy as np
import pytest

import hil
from tests.chromium import chromium
from tests.consoles import console, real_time_bench
from tests.waits import until

pytestmark = [pytest.mark.slow, pytest.mark.alone, pytest.mark.xdist_group("console")]

CHANNELS, RATE_HZ, MEASURE_S, PLAIN = 8, 1000.0, 30.0, 19
LATER_S = 5e-3
LINE_BYTES = 25


@dataclass
class Viewer:
    """A plain client of the stream: keeps every byte until the run is over."""

    address: str
    received: list[bytes] = field(default_factory=list)

    def look(self) -> None:
        with urlopen(self.address, timeout=600.0) as stream:
            while (line := stream.readline()) and not line.startswith(b"event: over"):
                self.received.append(line)

    @property
    def pictures(self) -> list[dict[str, Any]]:
        return [json.loads(line[6:]) for line in self.received if line.startswith(b"data: {") and len(line) > 10]


class Observer(threading.Thread):
    """Sees from outside when each block is in the journal; shares no code with what writes it."""

    def __init__(self, run: Path) -> None:
        super().__init__(daemon=True)
        self._run, self._over = run, threading.Event()
        self.seen: list[tuple[float, int]] = []

    def run(self) -> None:
        journal, size = self._run / "samples.log", 0
        while not self._over.is_set():
            now = journal.stat().st_size if journal.exists() else 0
            if now > size:
                self.seen.append((time.monotonic(), now // LINE_BYTES))
                size = now
            time.sleep(5e-4)

    def lateness_s(self) -> np.ndarray[Any, Any]:
        """Of each block: when it was seen, less the stamp of its last sample, against the promptest of all."""
        self._over.set()
        self.join()
        text = (self._run / "samples.log").read_bytes()
        rows = [int(text[i : i + LINE_BYTES].split()[0]) for i in range(0, len(text), LINE_BYTES)]
        stamps = hil.read(self._run).time_s
        at = np.array([seen_s - stamps[rows[lines - 1] - 1] for seen_s, lines in self.seen])
        return at - at.min()


def drive(folder: Path, name: str, viewers: Sequence[Viewer] = (), page: Any = None) -> tuple[Path, Observer]:
    """A run of a sine on the bench in real time, seen by an observer and by viewers."""
    run = folder / "runs" / name
    settings = {"frequencies": "1", "amplitudes": "20", "biases": "50", "measure_s": f"{MEASURE_S:g}"}
    command = [sys.executable, "-m", "hil", "run", "frequency_response", "--bench", str(folder / "eight.toml"),
               "--out", str(run), *(f"--set={key}={value}" for key, value in settings.items())]  # fmt: skip
    process = subprocess.Popen(command, env={**os.environ, "HIL_STATE_DIR": str(folder / "state")}, cwd=folder,
                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # fmt: skip
    until(lambda: (run / "samples.log").exists() and (run / "samples.log").stat().st_size > 0)
    observer = Observer(run)
    observer.start()
    threads = [threading.Thread(target=viewer.look, daemon=True) for viewer in viewers]
    for thread in threads:
        thread.start()
    if page is not None:
        page.goto(f"/live/{name}")
    until(lambda: (run / "end.json").exists(), 3.0 * MEASURE_S, 0.2)
    assert process.wait(600.0) in (0, 1)
    for thread in threads:
        thread.join(600.0)
    return run, observer


def test_twenty_viewers_lose_nothing_and_delay_nothing(tmp_path):
    path = real_time_bench(tmp_path, "eight", channels=CHANNELS - 5)
    path.write_text(path.read_text(encoding="utf-8").replace("block_s = 0.1 ", "block_s = 0.05 "), encoding="utf-8")
    _run, alone = drive(tmp_path, "alone")
    with ExitStack() as stack:
        browser = stack.enter_context(chromium())
        lab = stack.enter_context(console(tmp_path))
        page = browser.new_page(base_url=lab.address)
        viewers = [Viewer(f"{lab.address}/live/watched/stream") for _ in range(PLAIN)]
        run, watched = drive(tmp_path, "watched", viewers, page)
        page.wait_for_selector("#lanes.old")
        assert page.locator(".lane").count() == CHANNELS
    p99_alone, p99_watched = (float(np.quantile(one.lateness_s(), 0.99)) for one in (alone, watched))
    print(f"p99 of lateness: alone {1e3 * p99_alone:.2f} ms, with {PLAIN + 1} viewers {1e3 * p99_watched:.2f} ms")

    recording = hil.read(run)
    assert len(recording.channels) == CHANNELS
    (sine,) = (part for part in recording.meta["parts"] if part["kind"] == "sine")
    measured_s = recording.time_s[sine["first"] : sine["first"] + sine["count"]]
    assert len(measured_s) >= MEASURE_S * RATE_HZ
    assert np.allclose(np.diff(measured_s), 1.0 / RATE_HZ)
    assert [event for event in recording.meta["events"] if "late" in event["event"]] == []
    for viewer in viewers:
        assert_saw_all(viewer.pictures, recording)
    assert p99_watched < p99_alone + LATER_S


def assert_saw_all(pictures: list[dict[str, Any]], recording: hil.Recording) -> None:
    """Every stretch of the run came, with the extremes of its samples."""
    assert pictures[-1]["rows"] == len(recording)
    seen: dict[int, tuple[float, float]] = {}
    for picture in pictures:
        told = picture.get("fine", {"t": []})
        for i, start_s in enumerate(told["t"]):
            seen[round(start_s / 0.02)] = (told["low"][1][i], told["high"][1][i])
    where = np.floor(recording.time_s / 0.02 + 1e-6).astype(int)
    values = list(recording.channels.values())[1].values
    assert sorted(seen) == np.unique(where).tolist()
    for key, (low, high) in seen.items():
        part = values[where == key]
        assert (low, high) == pytest.approx((part.min(), part.max()), rel=1e-4, abs=1e-6)
