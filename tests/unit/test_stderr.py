"""Writing to who does not read: in time, and as far as it goes."""

import os
import time

import pytest

from hil.stderr import write


def test_full_pipe_holds_nobody_up():
    near, far = os.pipe()
    with os.fdopen(near, "rb") as reader, os.fdopen(far, "w") as stream:
        assert write("here\n", 0.0, stream)
        begun_s = time.monotonic()
        assert not write("x" * (1 << 21), 0.2, stream)
        assert 0.2 <= time.monotonic() - begun_s < 60.0
        assert os.read(reader.fileno(), 5) == b"here\n"


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="no pseudo terminals")
def test_stopped_terminal_holds_nobody_up():
    near, far = os.openpty()
    with os.fdopen(near, "r+b", buffering=0) as keyboard, os.fdopen(far, "w") as terminal:
        keyboard.write(b"\x13")  # Ctrl-S
        begun_s = time.monotonic()
        assert not write("the last word\n", 0.3, terminal)
        assert 0.3 <= time.monotonic() - begun_s < 60.0
        keyboard.write(b"\x11")  # Ctrl-Q
        assert write("the last word\n", 60.0, terminal)
        assert b"the last word" in os.read(keyboard.fileno(), 4096)


def test_whatever_a_stream_cannot_encode_is_written_escaped(tmp_path):
    with (tmp_path / "log").open("w", encoding="ascii") as stream:
        assert write("5 µm\n", 0.0, stream)
    assert (tmp_path / "log").read_text() == "5 \\u00b5m\n"


def test_stream_that_is_none_of_the_system_is_written_to(capsys):
    assert write("said\n", 0.0)
    assert capsys.readouterr().err == "said\n"
