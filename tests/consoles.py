"""A console as its operator starts it: `hil console` in a lab's folder, on a port of its own."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from tests.waits import PATIENCE_S

INSTALLED = Path(__file__).parent.parent / "sim_devices" / "benches" / "brevini-hpv41.toml"


@dataclass(frozen=True)
class Lab:
    """A folder with a bench in real time, and the console that shows it.

    Attributes:
        folder: of the lab; its runs lie in `runs`.
        address: of the console.
        process: of the console.
    """

    folder: Path
    address: str
    process: subprocess.Popen[str]

    @property
    def runs(self) -> Path:
        return self.folder / "runs"

    def control(self, run: str) -> dict[str, object]:
        """What a run says of how it is stopped."""
        told: dict[str, object] = json.loads((self.runs / run / "control.json").read_text(encoding="utf-8"))
        return told


def real_time_bench(folder: Path, name: str = "real", channels: int = 0) -> Path:
    """The simulated HPV41 by the wall clock; `channels` more inputs that see the flow."""
    text = INSTALLED.read_text(encoding="utf-8")
    text = text.replace('simulated = "in_process"', 'simulated = "in_process"\ntime = "real"\nbuffer_s = 20.0', 1)
    text = text.replace("block_s = 1.0 ", "block_s = 0.1 ", 1)
    text = text.replace('name = "HPV41 on the simulated bench"', f'name = "HPV41 in real time, {name}"', 1)
    extra = [
        f'[channels."flow {i}"]\ndevice = "daq"\nterminal = "ai{4 + i}"\nunit = "l/min"\n'
        'calibration = { slope = 10.0, uncertainty = 1.0, date = 2026-03-02, source = "simulated" }\n'
        for i in range(channels)
    ]
    seen = "".join(f'"flow {i}" = {{ signal = "flow", noise = 0.3 }}\n' for i in range(channels))
    text = text.replace("[interlocks.over-pressure]", "\n".join([*extra, "[interlocks.over-pressure]"]), 1) + seen
    path = folder / f"{name}.toml"
    path.write_text(text, encoding="utf-8")
    return path


@contextmanager
def console(folder: Path, port: int = 0) -> Iterator[Lab]:
    """A console in a folder; what it started is ended with it, unless it was killed."""
    environment = {**os.environ, "HIL_STATE_DIR": str(folder / "state"), "HIL_LANGUAGE": "en", "LC_ALL": "C.UTF-8"}
    places = ["--benches", folder, "--archive", folder / "runs"]
    process = subprocess.Popen(
        [sys.executable, "-m", "hil", "console", "--port", str(port), *places],
        stdout=subprocess.PIPE, text=True, env=environment, cwd=folder,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert line.startswith("console at http"), line
        yield Lab(folder, line.split()[2].rstrip("/"), process)
    finally:
        was_killed = process.poll() is not None
        process.send_signal(signal.SIGINT)
        process.wait(PATIENCE_S)
        assert process.stdout is not None
        process.stdout.close()
        if not was_killed:
            _end_all(folder)


def _end_all(folder: Path) -> None:
    """Runs outlive a console: end those that are left."""
    for path in folder.glob("runs/*/control.json"):
        with suppress(OSError, ValueError, KeyError):
            os.kill(int(json.loads(path.read_text(encoding="utf-8"))["pid"]), signal.SIGKILL)
