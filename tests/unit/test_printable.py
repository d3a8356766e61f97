"""Names that others wrote reach no terminal as commands."""

import io
import json
import os
import pty
import shlex
import subprocess
import sys
from pathlib import Path
from unittest.mock import patch

import pytest

from hil.printable import Printable, printable, printable_streams, raw
from hil.stderr import write

TITLE = "\x1b]0;pwned\x07"


@pytest.mark.parametrize(
    ("text", "seen"),
    [
        (TITLE, r"\x1b]0;pwned\x07"), ("\x9b31m", r"\x9b31m"), ("a\rb", r"a\rb"), ("\u202egnp.exe", r"\u202egnp.exe"),
        ("a\r\nb\n\tc", "a\r\nb\n\tc"), ("Öl ±5 % µm ω", "Öl ±5 % µm ω"), ("\x00\x08\x7f", r"\x00\x08\x7f"),
    ],
)  # fmt: skip
def test_printable_shows_what_commands_a_terminal(text, seen):
    assert printable(text) == seen


def test_printable_stream_is_the_stream_otherwise():
    inner = io.StringIO()
    stream = Printable(inner)
    print("a", TITLE, file=stream)  # type: ignore[call-overload]
    stream.writelines([TITLE])
    assert inner.getvalue() == "a \\x1b]0;pwned\\x07\n\\x1b]0;pwned\\x07"
    assert raw(stream) is inner and not stream.isatty()  # type: ignore[arg-type]


def test_write_shows_it_on_stderr(capfd):
    write(f"{TITLE}\n", 1.0)
    assert capfd.readouterr().err == "\\x1b]0;pwned\\x07\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / f"na{TITLE}me.csv").write_text(f"time [s],fl{TITLE}ow [l/min]\n0,1\n0.1,2\n0.2,3\n")
    (tmp_path / f"bad{TITLE}.csv").write_text(f"time [s],fl{TITLE}ow [l/min]\n0,1\n0.1,2\n0.2,x{TITLE}\n")
    (tmp_path / "line\nbreak.csv").write_text("time [s],flow [l/min]\n0,1\n0.1,x\n")
    return tmp_path


def test_names_of_columns_and_files_command_no_terminal(folder, command_line):
    assert folder.exists()
    for words in (["convert", f"na{TITLE}me.csv", f"out{TITLE}.csv"], ["convert", f"bad{TITLE}.csv", "x.csv"],
                  ["convert", f"no{TITLE}.csv", "x.csv"], [f"no{TITLE}"], ["list", TITLE], ["check", TITLE],
                  ["runs", "--archive", ".", "--serial", TITLE]):  # fmt: skip
        before = sys.stdout, sys.stderr
        _, out, err = command_line(*words)
        assert (sys.stdout, sys.stderr) == before
        assert "\x1b" not in out + err and "\x07" not in out + err


def test_a_name_with_a_new_line_is_one_line(folder, refused):
    assert folder.exists()
    refused("convert", "line\nbreak.csv", "x.csv")


def test_a_terminal_sees_no_command(folder):
    ours, theirs = pty.openpty()
    words = [sys.executable, "-m", "hil", "convert", f"na{TITLE}me.csv", "x.csv"]
    done = subprocess.run(words, cwd=folder, stdin=theirs, stdout=theirs, stderr=theirs, check=False)
    os.close(theirs)
    seen = b""
    try:
        while piece := os.read(ours, 4096):
            seen += piece
    except OSError:  # nobody writes there any more
        pass
    os.close(ours)
    assert done.returncode == 0 and b"pwned" in seen and b"\x1b]0" not in seen


def test_printable_streams_escape_what_their_encoding_lacks_as_json_does():
    inner = io.TextIOWrapper(io.BytesIO(), encoding="latin-1", write_through=True)
    with patch.object(sys, "stdout", inner), printable_streams():
        print(json.dumps("80 → 0 %, 20 °C", ensure_ascii=False))
    inner.seek(0)
    assert json.loads(inner.read()) == "80 → 0 %, 20 °C"


def test_stream_that_is_full_is_named(tmp_path):
    words = [sys.executable, "-P", "-m", "hil", "list"]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(words, stdout=full, stderr=subprocess.PIPE, text=True, cwd=tmp_path, check=False)
    assert (done.returncode, done.stderr) == (2, "hil: <stdout>: No space left on device\n")


@pytest.mark.parametrize("closed", [">&-", "<&- >&- 2>&-"])
def test_closed_streams_end_no_command(closed, tmp_path):
    run = "run jog --bench brevini-hpv41 --out run --set value=5 --set for_s=0.1"
    shell = f"{shlex.quote(sys.executable)} -P -m hil {run} {closed}"
    assert subprocess.run(["sh", "-c", shell], cwd=tmp_path, check=False).returncode == 0
    assert (tmp_path / "run" / "report.html").is_file()
