"""A missed certificate says why, in physics: looked for within a time, once the verdict is on disk."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hil.api.cause import of_diagnosis, of_difference
from hil.diagnosis.diagnosis import ChangedParameter, Quantity
from hil.findings.collect import findings_of
from hil.findings.results import read_results
from hil.passport.change import Change, Size
from hil.passport.difference import DateDifference
from hil.record.cause import ANSWER, Cause, Found
from hil.record.folder import read, write
from hil.record.measurement import Findings, Measurement
from hil.record.recording import Channel, Recording
from hil.report.comparisons import comparison_sentences
from hil.session import cause
from hil.session.cause import with_cause
from hil.session.outcome import Outcome
from hil.session.procedure import load_procedure
from hil.session.results import cause_found_before, write_outcome

RISE = Measurement("rise", "ms", "rise", high=100.0)
LEAKS = Found("leakage", "", 80.0, None, 140.0, 0.5, "ml/min")
LEAKED = Change("leakage", "orifice", "valve", "leakage", Size(80.0, 0.5), Size(140.0, 0.5), "ml/min", 0.6, None)
WARMER = Change("oil temperature", "oil", "bench", "t", Size(40.0, None), Size(50.0, None), "°C", None, None)


@pytest.fixture
def certifies():
    return replace(load_procedure("step_response"), certificate=True)


def missed(tmp_path: Path, rise: float = 170.0) -> Outcome:
    meta = {
        "procedure": "step_response", "valve": {"serial": "A7", "plant": "efc-good"}, "outcome": "completed",
        "started_utc": datetime(2026, 1, 1, tzinfo=UTC).isoformat(),
    }  # fmt: skip
    folder = tmp_path / "run"
    write(Recording(str(folder), np.arange(3.0), {"flow": Channel("flow", "l/min", np.zeros(3))}, meta), folder)
    return write_outcome(read(folder), Findings((RISE.of(rise, 2.0),)), folder)


def answers(monkeypatch: pytest.MonkeyPatch, script: str) -> None:
    """What stands in for the command: a script that may sleep, fail or print."""

    def stand_in(_: str, arguments: Sequence[str], **how: Any) -> Any:
        return subprocess.Popen([sys.executable, "-c", script, *arguments], **how)

    monkeypatch.setattr(cause, "child", stand_in)


def found(outcome: Outcome) -> Cause:
    assert outcome.findings.cause is not None
    return outcome.findings.cause


def test_what_a_diagnosis_finds_stands_on_page_one(tmp_path, certifies, monkeypatch):
    answer = ANSWER.dump_json(Cause("", verdict="parameter_change", found=(LEAKS,)), by_alias=True).decode()
    answers(monkeypatch, f"print({answer!r})")
    made = with_cause(certifies, missed(tmp_path), str(tmp_path), 600.0, lambda _d, _t: None)
    assert made.exit_status == 1
    page = made.report.read_text(encoding="utf-8")
    assert "What differs from the model of the type: leakage 80 → 140.0 ± 1.0 ml/min." in page
    kept = findings_of(read_results(made.folder / "results.json")).cause
    assert kept == found(made) and 0.0 < found(made).seconds < 600.0
    assert found(made).command == f"hil diagnose --model efc-good {made.folder} --out DIR"


def test_a_difference_names_the_largest_share_first_and_a_part_as_a_part():
    found = DateDifference((WARMER, LEAKED), (), "changed", is_part=True, not_searched=("a led-back search",))
    cause = of_difference(found)
    assert (cause.verdict, cause.not_searched) == ("partly_explained", "a led-back search")
    assert [one.name for one in cause.found] == ["leakage", "oil temperature"]
    assert cause.found[0] == Found("leakage", "valve", 80.0, 0.5, 140.0, 0.5, "ml/min", share=0.6)


def test_a_diagnosis_names_effects_with_what_they_were_then_parameters():
    effect = SimpleNamespace(name="friction", parameters={"coulomb": Quantity(4.8, 0.1, "%", "")})
    changed = (
        ChangedParameter("coulomb", 2.1, 4.8, 0.1, "%", ""),
        ChangedParameter("leakage", 80.0, 140.0, 0.5, "ml/min", "m"),
    )
    found: Any = SimpleNamespace(
        verdict="explained", effects=(effect,), changed_parameters=changed, not_separable=(("friction", "backlash"),),
        work={"not_searched": ()},
    )  # fmt: skip
    assert of_diagnosis(found).found == (
        Found("friction", "", 2.1, None, 4.8, 0.1, "%", alike=("backlash",)), replace(LEAKS, meaning="m"),
    )  # fmt: skip


def test_a_search_that_does_not_end_is_ended(tmp_path, certifies, monkeypatch):
    mark = tmp_path / "pid"
    answers(monkeypatch, f"import os, time; open({str(mark)!r}, 'w').write(str(os.getpid())); time.sleep(3600)")
    begun_s = time.monotonic()
    made = with_cause(certifies, missed(tmp_path), str(tmp_path), 0.6, lambda _d, _t: None)
    assert time.monotonic() - begun_s < 600.0, "it was ended, not waited for"
    assert (made.findings.verdict, made.exit_status, found(made).reason) == ("fail", 1, "out of time")
    assert "The cause was not found within 0.6 s." in made.report.read_text(encoding="utf-8")
    if mark.exists():
        with pytest.raises(ProcessLookupError):
            os.kill(int(mark.read_text(encoding="utf-8")), 0)


def test_ctrl_c_during_the_search_keeps_the_verdict(tmp_path, certifies, monkeypatch):
    answers(monkeypatch, "import time; time.sleep(60)")

    def stopped(_done, text):
        assert "verdict written; looking for the cause" in text
        raise KeyboardInterrupt

    made = with_cause(certifies, missed(tmp_path), str(tmp_path), 30.0, stopped)
    assert (made.findings.verdict, made.exit_status) == ("fail", 1)
    assert "the search was stopped" in made.report.read_text(encoding="utf-8")


def test_a_search_that_fails_says_why(tmp_path, certifies):
    made = with_cause(certifies, missed(tmp_path), str(tmp_path), 600.0, lambda _d, _t: None)
    (said,) = comparison_sentences(made.findings)
    assert said.startswith("The cause is not known:") and "no channel 'current'" in said


def test_a_search_that_breaks_is_no_answer(tmp_path, certifies, monkeypatch):
    answers(monkeypatch, "print('{'); raise SystemExit(1)")
    made = with_cause(certifies, missed(tmp_path), str(tmp_path), 600.0, lambda _d, _t: None)
    assert found(made).reason == "no answer"


@pytest.mark.parametrize("case", ["passed", "no certificate", "switched off"])
def test_nothing_is_looked_for_where_nothing_is_asked(tmp_path, certifies, monkeypatch, case):
    answers(monkeypatch, "raise SystemExit('must not run')")
    procedure = replace(certifies, certificate=case != "no certificate")
    outcome = missed(tmp_path, 60.0 if case == "passed" else 170.0)
    made = with_cause(procedure, outcome, str(tmp_path), 0.0 if case == "switched off" else 20.0, lambda _d, _t: None)
    assert made.findings.cause is None


ASKED = Cause("hil diff A B --model M", "A", "", (), "", "", 12.0, 60.0)
FRICTION = Found("friction", "valve", 2.1, 0.1, 4.8, 0.1, "%", share=0.97)


@pytest.mark.parametrize(
    ("told", "says"),
    [
        (replace(ASKED, verdict="changed", found=(FRICTION,)),
         "A of this unit: friction 2.10 ± 0.20 → 4.80 ± 0.20 % (the valve's). This took 12 s"),
        (replace(ASKED, verdict="partly_explained", found=(FRICTION,)), "This does not explain all of it."),
        (replace(ASKED, verdict="explained", found=(replace(FRICTION, alike=("backlash",)),)),
         "or backlash: these data do not tell which"),
        (replace(ASKED, verdict="changed", found=(FRICTION, replace(FRICTION, name="dead_time", share=0.0))),
         "(the valve's); 1 smaller."),
        (replace(ASKED, verdict="changed", found=(FRICTION, replace(FRICTION, name="leakage"))),
         "one by itself need not be so."),
        (replace(ASKED, verdict="unexplained"), "nothing that is known explains it"),
        (replace(ASKED, verdict="unexplained", not_searched="two causes"),
         "not found within 60 s: two causes were not looked at."),
        (replace(ASKED, verdict="unchanged"), "not known: the recorded answer agrees with the run A"),
    ],
)  # fmt: skip
def test_a_cause_is_said_as_far_as_it_is_known(told, says):
    (said,) = comparison_sentences(Findings((RISE.of(170.0, 2.0),), cause=told))
    assert says in said and "`hil diff A B --model M` looks again" in said


def test_a_report_made_again_keeps_the_cause(tmp_path):
    outcome = missed(tmp_path)
    kept = replace(outcome.findings, cause=replace(ASKED, verdict="changed", found=(FRICTION,)))
    write_outcome(read(outcome.folder), kept, outcome.folder)
    assert cause_found_before(outcome.folder) == kept.cause
