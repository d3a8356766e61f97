"""A unit that did not pass stands beside an earlier run of its serial number, where the archive has one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pytest

from hil.archive.archive import enter
from hil.archive.place import archive_place
from hil.findings.collect import findings_of, results_of
from hil.record.folder import read
from hil.record.measurement import Findings, Measurement
from hil.record.population_comparison import PopulationComparison
from hil.record.recording import Recording
from hil.report.comparisons import comparison_sentences
from hil.report.results import reasons
from hil.session.previous_run import with_earlier
from hil.session.procedure import load_procedure
from tests.kept_runs import kept_run

RISE = Measurement("rise", "ms", "rise", high=100.0)
GAIN = Measurement("gain", "psi per A", "gain")


@pytest.fixture
def lab(tmp_path):
    return tmp_path / "lab"


CERTIFIES = replace(load_procedure("step_response"), certificate=True)


def made(folder: Path, day: int, rise: float, serial: str = "A7") -> tuple[Recording, Findings]:
    found = Findings((RISE.of(rise, 2.0), GAIN.of(8.0, 0.1)))
    kept_run(folder, found.measured, serial, day + 1, procedure="step_response")
    enter(archive_place(str(folder.parent)), [folder])
    return read(folder), found


def beside_earlier(
    lab: Path, then: float = 99.0, change: Callable[[Findings], Findings] = lambda found: found
) -> tuple[Recording, Findings]:
    """A run of 180 ms beside one two days before."""
    made(lab / "good", 0, then)
    recording, found = made(lab / "now", 2, 180.0)
    return recording, with_earlier(CERTIFIES, recording, change(found), lab / "now", str(lab))


def test_what_changed_since_the_run_that_passed_is_said_and_kept_in_the_results(lab):
    made(lab / "worse", 1, 170.0)
    recording, found = beside_earlier(lab, 60.0)
    said, rests = comparison_sentences(found)
    assert "(pass): rise 60.0 ± 4.0 → 180.0 ± 4.0 ms." in said
    assert "gain" not in said
    assert rests.startswith("1 other values did not change beyond their uncertainty, 0 cannot be compared.")
    assert "`hil diff good RUN" in rests
    assert findings_of(results_of(recording, found)).since == found.since


@pytest.mark.parametrize("case", ["passed", "other unit", "later", "no certificate", "no archive"])
def test_nothing_is_said_where_there_is_nothing_to_say(lab, case):
    made(lab / "other", 5 if case == "later" else 0, 60.0, "B1" if case == "other unit" else "A7")
    recording, found = made(lab / "now", 2, 70.0 if case == "passed" else 180.0)
    procedure = replace(CERTIFIES, certificate=case != "no certificate")
    archive = str(lab / "none") if case == "no archive" else str(lab)
    assert with_earlier(procedure, recording, found, lab / "now", archive).since is None


def test_each_miss_states_what_this_bench_would_have_failed(lab):
    [reason] = reasons(beside_earlier(lab)[1])
    assert reason.endswith(
        "2.3 % of tests on this bench would fail a unit exactly at the limit; "
        "3.9 % this unit as it was on 2026-01-01 (99.0 ± 4.0 ms)."
    )


def test_calibration_of_one_bench_adds_nothing_to_the_unit_of_then(lab):
    shared = RISE.of(180.0, 0.5, calibration=2.0)
    since = beside_earlier(lab, change=lambda found: replace(found, measured=(shared, *found.measured[1:])))[1].since
    assert since is not None
    std, guard = np.hypot(2.0, 0.5), 2.0 * np.hypot(2.0, 0.5)
    assert since.missed[0].fail_probability == pytest.approx(1.0 - NormalDist(99.0, std).cdf(100.0 + guard))


def test_a_miss_that_is_a_figure_of_the_condition_too_is_beside_the_unit_of_then(lab):
    figure = replace(RISE, high=75.0).of(180.0, 2.0)
    population = PopulationComparison((replace(figure, verdict=None),), 100)
    since = beside_earlier(lab, change=lambda found: replace(found, population=population))[1].since
    assert since is not None
    assert [one.then.value for one in since.missed] == [99.0]
