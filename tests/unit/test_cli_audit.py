"""`hil audit`: the trail is printed, its chain checked, and its head printed to be kept elsewhere."""

import json
import os

import pytest
from audit_trail import read_audit

from hil.bench.audit import Audit, head


@pytest.fixture(autouse=True)
def trail(tmp_path, monkeypatch):
    monkeypatch.setenv("HIL_STATE_DIR", str(tmp_path))
    audit = Audit()
    for number in range(4):
        audit.write("Eva", "drives", {"run": f"runs/{number}", "pid": number})
    return audit.path


def test_trail_is_printed_with_its_head(trail, command_line, prints):
    out = prints("audit")
    assert out.count("Eva  drives  run runs/") == 4
    found = head(trail)
    assert found is not None and (found.number, found.sha256 in out) == (4, True)
    status, out, _ = command_line("audit", "head", "--json")
    told = json.loads(out)
    assert (status, told["line"], told["sha256"]) == (0, 4, found.sha256)
    assert json.loads(prints("audit", "--json"))["lines"][3]["details"]["run"] == "runs/3"


@pytest.mark.parametrize(
    "edit",
    [
        lambda lines: [lines[0], lines[1].replace(b"Eva", b"Ada"), *lines[2:]],
        lambda lines: lines[:1] + lines[2:],
        lambda lines: [*lines[:3], b"nothing\n"],
        lambda lines: [b"[" * 100_000 + b"\n", *lines],
    ],
)
def test_changed_line_is_named_with_status_1(trail, edit, command_line):
    trail.write_bytes(b"".join(edit(trail.read_bytes().splitlines(keepends=True))))
    status, _, err = command_line("audit")
    assert status == 1 and f"{trail}: line " in err and "Traceback" not in err
    assert command_line("audit", "head")[0] == 1


def test_a_trail_cut_off_at_the_end_lacks_the_head_that_was_kept(trail, command_line, prints):
    kept = head(trail)
    assert kept is not None and command_line("audit", "--head", kept.sha256)[0] == 0
    trail.write_bytes(b"".join(trail.read_bytes().splitlines(keepends=True)[:3]))
    prints("audit")  # the chain alone cannot tell
    status, out, _ = command_line("audit", "--head", kept.sha256)
    assert status == 1 and "not in it" in out


def test_a_line_torn_by_a_power_cut_breaks_no_chain(trail, prints):
    os.truncate(trail, trail.stat().st_size - 20)
    prints("audit")
    Audit().write("Eva", "drives", {})
    assert len(list(read_audit(trail))) == 4
    prints("audit")


def test_a_name_does_not_steer_the_terminal(trail, command_line):
    Audit().write("\x1b]0;owned\x07", "drives", {"run": "\x9b2J"})
    _, out, _ = command_line("audit")
    assert "\\x1b]0;owned" in out and not {"\x1b", "\x07", "\x9b"} & set(out)


def test_no_trail_is_said_in_words(trail, prints, refused):
    trail.unlink()
    assert "no lines yet" in prints("audit")
    refused("audit", "head")
    refused("audit", "--file", trail)
