"""What is said of an output is what stands at the device, seen from outside (`python -m tests.outside` has it all)."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.outside.coupler import Coupler
from tests.outside.judge import Seen, judged
from tests.outside.running import Program
from tests.outside.situations import ENDINGS, OUTAGES_S, drawn, named, outages
from tests.outside.watch import watched
from tests.waits import side_by_side

pytestmark = pytest.mark.xdist_group("watches from outside")  # for clocks: on one worker, beside others that compute
QUICK_S = 3.0  # of a direct link: what it may have sent is there after one second
OUTAGES = {one.name: one for one in outages()}
NAMED = {one.name: one for one in named()}
AT_THE_DESK = (
    *(f"outage of 0.5 s, {ending}" for ending in ENDINGS),
    "watchdog stopped, run ends well", "procedure forks, SIGKILL",
)  # fmt: skip


@pytest.fixture(scope="module")
def seen():
    """What was seen of a few, all at the same time: they wait most of it."""
    every = {**OUTAGES, **NAMED}
    return dict(zip(AT_THE_DESK, side_by_side(lambda name: watched(every[name], QUICK_S), AT_THE_DESK), strict=True))


@pytest.mark.parametrize("name", AT_THE_DESK)
def test_what_is_said_is_so(name, seen):
    assert (seen[name].not_run, seen[name].wrong) == ("", []), seen[name]


@pytest.mark.slow
@pytest.mark.parametrize("name", [*OUTAGES, *NAMED])
def test_every_situation(name):
    seen = watched({**OUTAGES, **NAMED}[name], 30.0)
    assert (seen.not_run, seen.wrong) == ("", []), seen


def test_there_are_twelve_outages_with_five_endings_and_a_seed_is_one_combination():
    assert (len(OUTAGES_S), len(ENDINGS), len(OUTAGES)) == (12, 5, 60)
    assert drawn(7).name == drawn(7).name != drawn(8).name


def said(folder: Path, state: str, sentence: str, code: int, at_s: float) -> Program:
    """A program that has ended with these words."""
    at_utc = time.strftime("%Y-%m-%dT%H:%M:%S+00:00", time.gmtime(at_s))
    told = {"outputs": {"command": {"state": state, "read_back": state == "safe", "at_utc": at_utc}}}
    (folder / "run").mkdir()
    (folder / "run" / "end.json").write_text(json.dumps(told), encoding="utf-8")
    (folder / "out").write_text(json.dumps(told), encoding="utf-8")
    (folder / "err").write_text(f"hil: {sentence}\n", encoding="utf-8")
    process = subprocess.Popen([sys.executable, "-c", f"raise SystemExit({code})"])
    process.wait()
    return Program(folder, process)


@pytest.mark.parametrize(
    ("stands", "state", "sentence", "code", "wrong"),
    [
        (0.0, "safe", "stopped; outputs are safe (read back)", 130, []),
        (70.0, "driven", "NOT SAFE: command stands at 70 %; use the emergency stop", 3, []),
        (70.0, "safe", "stopped; outputs are safe (read back)", 3,
         ["end.json calls", "--json calls", "said read back safe", "said safe, and stands at 70", "nobody says so"]),
        (70.0, "unknown", "NOT SAFE", 130, ["exit status 130, and the output", "exit status 130, and the record"]),
        (0.0, "unconfirmed", "stopped; outputs are safe (read back)", 3, ["the record says ['unconfirmed'], the sent"]),
        (0.0, "safe", "NOT SAFE: use the emergency stop", 3, ["the record says safe, the sentence NOT SAFE"]),
        (0.0, "safe", "Traceback (most recent call last)", 7, ["a traceback", "exit status 7"]),
    ],
)  # fmt: skip
def test_words_that_are_not_so_are_found(stands, state, sentence, code, wrong, tmp_path):
    now_s = time.time()
    program = said(tmp_path, state, sentence, code, now_s - 10.0)
    with Coupler() as coupler:
        coupler.changes += [(now_s - 20.0, 70.0), (now_s - 15.0, stands)]
        seen = judged(Seen("by hand", begun_s=now_s - 16.0, ended_s=now_s - 10.0), coupler, program)
    assert len(seen.wrong) == len(wrong)
    assert all(found.startswith(start) or start in found for found, start in zip(seen.wrong, wrong, strict=True))


@pytest.mark.parametrize(("rise_ms", "wrong"), [(330.0, False), (535.0, True)])
def test_a_figure_that_is_not_so_is_found(rise_ms, wrong, tmp_path):
    program = said(tmp_path, "safe", "", 0, time.time())
    value = {"name": "rise, 0 → 50 %", "value": rise_ms, "std": 25.0, "unit": "ms"}
    (tmp_path / "out").write_text(json.dumps({**(program.printed or {}), "values": [value]}), encoding="utf-8")
    with Coupler() as coupler:
        seen = judged(Seen("by hand", begun_s=time.time(), ended_s=time.time()), coupler, program, measures=True)
    assert bool(seen.wrong) == wrong, seen.wrong
