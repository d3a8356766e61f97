"""`hil jog` and `hil calibrate` as an outside observer sees them: the output ends safe, or is said not to be."""

from __future__ import annotations

import fcntl
import os
import re
import select
import signal
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from tests import observer
from tests.links import served
from tests.waits import PATIENCE_S

pytestmark = pytest.mark.slow

# The shell of a terminal: when the first process of a session ends, what nobody has read from the terminal is lost.
SHELL = """
import signal, subprocess, sys, time
command = subprocess.Popen(sys.argv[1:])
signal.signal(signal.SIGINT, signal.SIG_IGN)
signal.signal(signal.SIGHUP, lambda number, _: command.send_signal(number))
status = command.wait()
time.sleep(1.0)
sys.exit(status)
"""


@dataclass
class Jog:
    """A jog to 40 % on a terminal of its own, the line to its device, and what stands there."""

    process: subprocess.Popen[bytes]
    terminal: int
    line: observer.Line
    watch: observer.Watch
    said: list[bytes] = field(default_factory=list)
    listener: threading.Thread | None = None
    is_open: bool = True

    @property
    def text(self) -> str:
        return b"".join(self.said).decode(errors="replace")

    def end(self) -> int:
        status = self.process.wait(PATIENCE_S)
        time.sleep(0.2)
        return status

    def listen(self) -> None:
        """Keep what is said."""
        self.listener = threading.Thread(target=self._listen, daemon=True)
        self.listener.start()

    def _listen(self) -> None:
        with suppress(OSError):
            while self.is_open:
                if select.select([self.terminal], [], [], 0.05)[0]:
                    self.said.append(os.read(self.terminal, 4096))

    def hang_up(self) -> None:
        """Close the terminal; nobody listens there any more, since its number may become another file's."""
        if self.is_open and self.listener is not None:
            self.is_open = False
            self.listener.join()
            os.close(self.terminal)

    @property
    def command(self) -> int:
        """The process number of what the shell started."""
        return int(Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children").read_text(encoding="ascii"))


@contextmanager
def jogging(folder: Path, for_time: str = "60s", *instead: str) -> Iterator[Jog]:
    """A jog, or another command that brings the output to 40 %, instead."""
    # Patience beyond that for an answer: else the watchdog process takes a link that waits for a run that hangs.
    own = ("block_s = 0.1\n", "block_s = 0.1\nwatchdog_s = 20.0\n")
    with served("hpv41-modbus-tcp", folder, ("\nwatchdog_s = 1.0\n", "\n"), own) as (file, devices):
        (device,) = devices.values()
        line = observer.Line(device.port)
        watch = observer.Watch(observer.modbus_tcp(device.port), 0.6)
        path = folder / "driven.toml"
        path.write_text(file.text.replace(f":{device.port}", f":{line.port}"), encoding="utf-8")
        near, far = os.openpty()
        what = instead or ("jog", str(path), "command", "40 %", "--for", for_time)
        command = [
            sys.executable,
            "-c",
            SHELL,
            sys.executable,
            "-m",
            "hil",
            *what,
            "--out",
            str(folder / "run"),
            "--archive",
            str(folder),
        ]
        environment = {**os.environ, "HIL_STATE_DIR": str(folder / "state")}

        def take_terminal() -> None:
            os.setsid()
            fcntl.ioctl(0, termios.TIOCSCTTY, 0)

        process = subprocess.Popen(
            command, env=environment, stdin=far, stdout=far, stderr=far, preexec_fn=take_terminal
        )
        os.close(far)
        jog = Jog(process, near, line, watch)
        jog.listen()
        try:
            assert watch.wait(lambda: (watch.now or 0.0) > 39.0, PATIENCE_S), jog.text
            time.sleep(0.3)
            yield jog
        finally:
            with suppress(OSError, ValueError):
                os.kill(jog.command, signal.SIGKILL)
            process.kill()
            process.wait()
            watch.close()
            line.close()
            jog.hang_up()


def _signal(*numbers: int) -> Callable[[Jog], None]:
    def send(jog: Jog) -> None:
        command = jog.command
        for number in numbers:
            with suppress(ProcessLookupError):
                os.kill(command, number)
            time.sleep(0.05)

    return send


@pytest.mark.parametrize(
    ("end", "status", "says"),
    [
        (lambda jog: os.write(jog.terminal, b" "), 0, "reading, flow"),
        (lambda jog: os.write(jog.terminal, b"\x03"), 130, "stopped; outputs are safe (read back)"),
        (_signal(signal.SIGINT, signal.SIGINT), 130, "stopped; outputs are safe (read back)"),
        (_signal(signal.SIGTERM), 143, "stopped; outputs are safe (read back)"),
        (Jog.hang_up, 129, ""),
    ],
    ids=["a key", "Ctrl-C", "Ctrl-C twice", "SIGTERM", "terminal closed"],
)
def test_it_ends_and_the_output_is_safe(end, status, says, tmp_path):
    with jogging(tmp_path) as jog:
        end(jog)
        assert jog.end() == status, jog.text
        assert abs(jog.watch.now or 0.0) < 0.6
        assert says in jog.text and "NOT SAFE" not in jog.text


def test_time_over(tmp_path):
    with jogging(tmp_path, "1.5s") as jog:
        assert jog.end() == 0, jog.text
        assert abs(jog.watch.now or 0.0) < 0.6
        assert re.search(r"reading, spool position +\d", jog.text)
        assert (tmp_path / "run" / "report.html").is_file()


@pytest.mark.parametrize("signals", [(), (signal.SIGINT, signal.SIGINT)], ids=["alone", "and Ctrl-C twice"])
def test_a_link_that_is_pulled_is_said_to_be_not_safe(signals, tmp_path):
    with jogging(tmp_path) as jog:
        jog.line.dead = True
        _signal(*signals)(jog)
        assert jog.end() == 3, jog.text
        assert abs(jog.watch.now or 0.0) > 30.0 and "NOT SAFE" in jog.text and "outputs are safe" not in jog.text
        jog.line.dead = False
        assert jog.watch.wait(lambda: jog.watch.is_safe, 20.0), "the watchdog process makes it safe"


def test_a_calibration_holds_its_point_as_long_as_it_takes_and_ctrl_c_ends_it(tmp_path):
    told = ("calibrate", str(tmp_path / "driven.toml"), "command", "--reference", "meter 7", "--between", "40..45")
    with jogging(tmp_path, "", *told) as jog:
        before = (tmp_path / "driven.toml").read_bytes()
        time.sleep(4.0)  # twice what the watchdog process allows a program that hangs
        assert jog.process.poll() is None and abs((jog.watch.now or 0.0) - 40.0) < 0.6, jog.text
        os.write(jog.terminal, b"40.2\n")
        assert jog.watch.wait(lambda: (jog.watch.now or 0.0) > 41.0, PATIENCE_S), jog.text
        os.write(jog.terminal, b"\x03")
        assert jog.end() == 130, jog.text
        assert abs(jog.watch.now or 0.0) < 0.6 and "stopped; outputs are safe (read back)" in jog.text
        assert (tmp_path / "driven.toml").read_bytes() == before
