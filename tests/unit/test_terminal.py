"""Whoever sits at the terminal: a program of its own, whose terminal is the other end of this test."""

import os
import subprocess
import sys
import time
from pathlib import Path

from hil.session.terminal import operator_here
from tests.waits import PATIENCE_S

PROGRAM = f"""
import os, time
os.login_tty(0)
from hil.session.terminal import operator_here
operator = operator_here(is_simulated=True)
print(operator.goes_on_by, flush=True)
while not os.path.exists({{typed!r}}):
    time.sleep(0.01)
operator.ask_to_confirm()
print("is asked", flush=True)
operator.wait({PATIENCE_S})
print("goes on", flush=True)
"""


def test_the_enter_key_confirms_and_what_was_typed_before_does_not(tmp_path):
    ours, theirs = os.openpty()
    typed = tmp_path / "typed"
    program = subprocess.Popen([sys.executable, "-c", PROGRAM.format(typed=str(typed))], stdin=theirs)
    os.close(theirs)
    heard = b""

    def hear(text):
        nonlocal heard
        while text not in heard:
            heard += os.read(ours, 4096)

    try:
        hear(b"press Enter")
        os.write(ours, b"too early\n")
        time.sleep(0.1)
        typed.touch()
        hear(b"is asked")
        time.sleep(0.3)
        assert program.poll() is None
        os.write(ours, b"\n")
        hear(b"goes on")
        assert program.wait(PATIENCE_S) == 0
    finally:
        program.kill()
        program.wait()
        os.close(ours)


def test_nobody_is_at_a_terminal_that_is_none(monkeypatch):
    with Path(os.devnull).open(encoding="utf-8") as nobody:
        monkeypatch.setattr(sys, "stdin", nobody)
        assert [operator_here(simulated).goes_on_by for simulated in (True, False)] == ["", "go on"]
