"""A program of ours as a stranger starts it, and all that it says: on its terminal, in its files, to who pressed."""

from __future__ import annotations

import fcntl
import json
import os
import re
import signal
import subprocess
import sys
import termios
import threading
import time
import urllib.request
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.outside.coupler import Coupler

BENCHES = Path(__file__).parents[2] / "sim_devices" / "benches"
STRANGER = Path(__file__).parent / "stranger"
WATCHDOG_S = 10.0


@dataclass
class Program:
    """What was started, and where it works.

    Attributes:
        answers: (when it came, what the stop listener answered); one that was paused hears a press late.
        terminal: the near end of its terminal, where it has one.
        deaf: nobody reads that terminal any more.
    """

    folder: Path
    process: subprocess.Popen[bytes]
    terminal: int | None = None
    shown: bytes = b""
    deaf: bool = False
    answers: list[tuple[float, dict[str, Any]]] = field(default_factory=list)

    @property
    def run(self) -> Path:
        """The run folder."""
        return self.folder / "run"

    @property
    def said(self) -> str:
        """The lines that it said, of its watchdog process too."""
        err = self.folder / "err"
        text = err.read_bytes() if err.exists() else self.shown  # of a terminal that is closed what was read before
        plain = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", text.decode("utf-8", "replace").replace("\r", "\n"))
        lines = [line for line in plain.splitlines() if line.startswith("hil") or "Traceback" in line]
        return " | ".join(lines)

    def told(self, name: str) -> dict[str, Any] | None:
        """What stands in a file of the run, or of its state folder where the run folder is gone."""
        for path in (self.run / name, *(self.folder / "state").glob(f"{Path(name).stem}/*.json")):
            with suppress(OSError, ValueError):
                content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
                return content
        return None

    @property
    def printed(self) -> dict[str, Any] | None:
        """What `--json` printed."""
        try:
            content: dict[str, Any] = json.loads((self.folder / "out").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        return content

    @property
    def watchdog(self) -> int | None:
        """The process that watches over this one, None when it is gone."""
        for folder in Path("/proc").glob("[0-9]*"):
            with suppress(OSError):
                words = (folder / "cmdline").read_bytes().split(b"\0")
                if b"hil.bench.watchdog" in words and str(self.process.pid).encode() in words:
                    return int(folder.name)
        return None

    def press(self) -> None:
        """The stop button of a page: what it is answered stands in `answers`."""
        threading.Thread(target=self._press, daemon=True).start()

    def _press(self) -> None:
        with suppress(OSError, ValueError, KeyError, TypeError):
            control = self.told("control.json") or {}  # gone with a run that has ended
            asked = urllib.request.Request(control["stop_url"], data=f"token={control['token']}".encode())
            with urllib.request.urlopen(asked, timeout=30.0) as answer:
                told = json.load(answer)
                self.answers.append((time.time(), told))

    def keep_shown(self) -> None:
        """Keep what its terminal shows, until that is closed."""
        with suppress(OSError):
            while self.terminal is not None:
                if self.deaf:
                    time.sleep(0.05)
                    continue
                self.shown += os.read(self.terminal, 4096)

    def end(self) -> None:
        """Leave no process behind."""
        with suppress(OSError, AttributeError):
            os.kill(self.watchdog or 0, signal.SIGKILL) if self.watchdog else None
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.process.kill()
            self.process.wait()
        near, self.terminal = self.terminal, None
        if near is not None and self.deaf is not None:
            with suppress(OSError):
                os.close(near)


def bench(folder: Path, coupler: Coupler, rate_hz: int = 8) -> Path:
    """The shipped bench with this device, which has no watchdog of its own: nobody helps the program."""
    carrier = "tcp" if ":" in coupler.address else "rtu"
    text = (BENCHES / f"hpv41-modbus-{carrier}.toml").read_text(encoding="utf-8")
    text = re.sub(r'\naddress = ".*"', f'\naddress = "{coupler.address}"', text, count=1)
    text = re.sub(r"sample_rate_hz = \d+", f"sample_rate_hz = {rate_hz}", text.replace("\nwatchdog_s = 1.0\n", "\n", 1))
    name = re.sub(r"\W", "-", coupler.address)
    text = text.replace("block_s = 0.1", f"block_s = 0.25\nwatchdog_s = {WATCHDOG_S}").replace("HPV41 on", f"{name} on")
    path = folder / "bench.toml"
    path.write_text(text, encoding="utf-8")
    return path


def step_command(path: Path) -> list[str]:
    """A step up and down whose figures are known."""
    told = [part for setting in ("levels=0,50,0", "hold_s=2") for part in ("--set", setting)]
    return [
        "-m",
        "hil",
        "run",
        "step_response",
        "--bench",
        str(path),
        "--out",
        str(path.parent / "run"),
        "--json",
        *told,
    ]


def run_command(path: Path, *settings: str) -> list[str]:
    """`hil run stand` on a bench."""
    told = [part for setting in settings for part in ("--set", setting)]
    return ["-m", "hil", "run", "stand", "--bench", str(path), "--out", str(path.parent / "run"), "--json", *told]


def started(folder: Path, words: list[str], on_a_terminal: bool = False) -> Program:
    """A program of ours in a folder of its own."""
    paths = os.pathsep.join([str(STRANGER), str(BENCHES.parents[1])])
    environment = {**os.environ, "PYTHONPATH": paths, "HIL_STATE_DIR": str(folder / "state"), "HIL_LANGUAGE": "en"}
    command = [sys.executable, *words]
    if not on_a_terminal:
        with (folder / "out").open("wb") as out, (folder / "err").open("wb") as err:
            process = subprocess.Popen(
                command, env=environment, cwd=folder, stdin=subprocess.DEVNULL, stdout=out, stderr=err,
                preexec_fn=_usual,
            )  # fmt: skip
            return Program(folder, process)
    near, far = os.openpty()

    def take_terminal() -> None:
        _usual()
        os.setsid()
        fcntl.ioctl(0, termios.TIOCSCTTY, 0)

    with (folder / "out").open("wb") as out:
        process = subprocess.Popen(
            command, env=environment, cwd=folder, stdin=far, stdout=out, stderr=far, preexec_fn=take_terminal
        )
    os.close(far)
    program = Program(folder, process, near)
    threading.Thread(target=program.keep_shown, daemon=True).start()
    return program


def _usual() -> None:
    for number in (signal.SIGHUP, signal.SIGINT, signal.SIGQUIT, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)
