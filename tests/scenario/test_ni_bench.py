"""The shipped bench of a USB-6211, its run and its watchdog process on one board: what stands there is in a file."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from tests.waits import PATIENCE_S, until

HERE = Path(__file__).parents[1]
HALF, RELAY = 5.0, "port1/line0"


class Bench:
    """A board in a file, and `hil run` on it."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.board = folder, folder / "board.json"
        self._told = {"NI_BOARD": str(self.board), "HIL_STATE_DIR": str(folder / "state"),
                      "PYTHONPATH": os.pathsep.join(str(HERE / part) for part in ("stand_in", "stranger"))}  # fmt: skip

    def hil(self, *arguments: str) -> subprocess.Popen[str]:
        pipe, environment = subprocess.PIPE, {**os.environ, **self._told}
        return subprocess.Popen(
            [sys.executable, "-m", "hil", *arguments], env=environment, text=True, stdout=pipe, stderr=pipe
        )

    def start(self, hold_s: float) -> subprocess.Popen[str]:
        return self.hil("run", "tiny_step", "--bench", "hpv41-usb-6211", "--out", str(self.folder / "run"),
                        "--set", "levels=50", "--set", f"hold_s={hold_s}")  # fmt: skip

    def level(self, terminal: str) -> float | None:
        """Where an output stands, as the board has it."""
        if not self.board.exists():
            return None
        levels: dict[str, float] = json.loads(self.board.read_text(encoding="utf-8"))["levels"]
        return levels[terminal]

    def drive(self) -> subprocess.Popen[str]:
        """A run that stands at half its range, the relay closed."""
        process = self.start(hold_s=60.0)
        until(lambda: self.level("ao0") == HALF and self.level(RELAY) == 1.0)
        return process

    def watchdog(self) -> dict[str, Any]:
        told = self.folder / "run" / "watchdog.json"
        until(told.exists)
        time.sleep(0.05)
        found: dict[str, Any] = json.loads(told.read_text(encoding="utf-8"))
        return found


@pytest.fixture
def bench(tmp_path):
    return Bench(tmp_path)


def test_it_runs_with_its_watchdog_and_ends_safe(bench):
    process = bench.start(hold_s=0.3)
    _, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, err
    assert (bench.level("ao0"), bench.level(RELAY)) == (0.0, 0.0)
    header = json.loads((bench.folder / "run" / "run.json").read_text(encoding="utf-8"))
    assert [column["name"] for column in header["samples"]["columns"]] == ["time", "command", "enable", "flow"]


def test_board_is_unplugged_and_found_again_by_the_watchdog_process(bench):
    process = bench.drive()
    unplugged = bench.board.with_suffix(".unplugged")
    unplugged.touch()
    until(lambda: process.poll() is not None)
    assert process.returncode == 3 and bench.level("ao0") == HALF
    unplugged.unlink()  # plugged in again; a real one would have forgotten its levels, this one has not
    _, err = process.communicate(timeout=PATIENCE_S)
    assert "(-200324)" in err and "use the emergency stop" in err
    assert "NOT SAFE: nobody knows where 'command' stands, driven to 50 % last" in err
    assert "nobody knows where 'enable' stands, driven to 1 last" in err
    assert bench.watchdog()["safe_after_s"] >= 0.0
    assert (bench.level("ao0"), bench.level(RELAY)) == (0.0, 0.0)


def test_board_itself_is_examined(bench):
    out, err = bench.hil("check-driver", "ni", "--bench", "hpv41-usb-6211", "--hardware").communicate(
        timeout=PATIENCE_S
    )
    lines = [line.split(maxsplit=1) for line in out.splitlines()[1:-1]]
    verdicts = {text.partition(":")[0]: verdict for verdict, text in lines}
    assert "broken" not in verdicts.values(), out + err
    passed = {check for check, verdict in verdicts.items() if verdict == "passed"}
    assert {"leaves outputs where they are", "tells where outputs stand", "keeps the rate",
            "goes safe immediately and again"} <= passed  # fmt: skip
    assert (bench.level("ao0"), bench.level(RELAY)) == (0.0, 0.0)


@pytest.mark.parametrize("command", [("devices", "hpv41-usb-6211"), ("check-driver", "ni")])
def test_nothing_is_served_for_a_board(bench, command):
    process = bench.hil(*command)
    _, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 2
    assert err.startswith("hil: driver 'ni' has no simulated device: nothing is served for it") and err.count("\n") == 1
