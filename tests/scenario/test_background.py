"""A run in the background of a terminal is not stopped by it: a valve would stand open until somebody types `fg`."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path

import pytest

from tests.outside.running import STRANGER
from tests.waits import PATIENCE_S

STOPPED = 99
SHELL = f"""
import fcntl, os, subprocess, sys, termios

fcntl.ioctl(0, termios.TIOCSCTTY, 0)
told = termios.tcgetattr(0)
told[3] |= termios.TOSTOP
termios.tcsetattr(0, termios.TCSANOW, told)
background = subprocess.Popen(sys.argv[1:], process_group=0)
ended = os.waitpid(background.pid, os.WUNTRACED)[1]
if os.WIFSTOPPED(ended):
    background.kill()
    os._exit({STOPPED})
os._exit(os.waitstatus_to_exitcode(ended))
"""
"""As a shell does it: a terminal of its own that stops who writes to it from the background, and a job there."""


def in_background(*command: str, folder: Path) -> tuple[int, str]:
    """Exit status of a command in the background of a terminal, STOPPED where that has stopped it; and what it said."""
    near, far = os.openpty()
    paths = os.pathsep.join([str(STRANGER), str(Path(__file__).parents[2])])
    environment = {**os.environ, "PYTHONPATH": paths, "HIL_STATE_DIR": str(folder / "state"), "HIL_LANGUAGE": "en"}
    shell = subprocess.Popen(
        [sys.executable, "-c", SHELL, sys.executable, *command], stdin=far, stdout=far, stderr=far, env=environment,
        cwd=folder, start_new_session=True,
    )  # fmt: skip
    os.close(far)
    said: list[bytes] = []

    def listen() -> None:
        with suppress(OSError):  # the far end is closed
            while more := os.read(near, 4096):
                said.append(more)

    reads = threading.Thread(target=listen, daemon=True)
    reads.start()
    try:
        status = shell.wait(PATIENCE_S)
    finally:
        shell.kill()
        reads.join(PATIENCE_S)
        os.close(near)
    return status, b"".join(said).decode(errors="replace")


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="a terminal of its own")
def test_run_in_the_background_of_a_terminal_is_not_stopped(tmp_path):
    run = ["-m", "hil", "run", "stand", "--bench", "brevini-hpv41", "--out", str(tmp_path / "run"), "--set", "rounds=2"]
    status, said = in_background(*run, folder=tmp_path)  # writes: SIGTTOU
    assert status == 0 and "report: " in said, said
    reads = ["--set", "wrong=reads", "--out", str(tmp_path / "reads")]
    status, said = in_background(*run, *reads, folder=tmp_path)  # its procedure reads: SIGTTIN
    assert status != STOPPED and (tmp_path / "reads" / "end.json").exists(), said
