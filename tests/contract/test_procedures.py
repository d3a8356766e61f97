"""What holds for every installed procedure, and for ours on every installed bench."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from hil.catalog import entries
from hil.findings.collect import results_of
from hil.findings.results import Results
from hil.session.procedure import load_procedure
from tests.driven import driven

NAMES = sorted(entry.name for entry in entries("procedures"))
PAGE = (Path(__file__).parents[2] / "docs" / "reference" / "procedures.md").read_text(encoding="utf-8")
CURVES = PAGE.partition("## What they leave to the report")[2]
BENCHES = ("brevini-hpv41", "cummins-efc", "hydraforce-sp08-47c")
BIAS = {"brevini-hpv41": "60", "cummins-efc": "72", "hydraforce-sp08-47c": "20"}
SHORT = {
    "flow_curve": {"cycle_s": "12"},
    "frequency_response": {"frequencies": "0.5,1,2,4", "amplitudes": "4", "measure_s": "1"},
    "multisine_response": {"low_hz": "0.5", "high_hz": "4.5", "base_hz": "0.5", "amplitudes": "4", "periods": "3"},
    "step_response": {"levels": "40,80"},
    "large_sine": {"frequencies": "0.5", "cycles": "1"},
    "endurance": {"cycles": "12", "keep_every": "3"},
    "fail_safe": {"levels": "80", "repeats": "2"},
    "threshold": {"speed": "1", "reach": "2"},
}


# All that is asked of a run is asked by one worker: it is driven once.
@pytest.fixture(scope="module", params=[
    pytest.param((name, bench), id=f"{name}-{bench}", marks=pytest.mark.xdist_group(f"{name} on {bench}"))
    for name in SHORT for bench in BENCHES
])  # fmt: skip
def done(request, tmp_path_factory):
    """A short run of a procedure on a bench in virtual time, evaluated: (procedure, recording, findings)."""
    name, bench = request.param
    procedure = load_procedure(name)
    given = SHORT[name] | ({"biases": BIAS[bench]} if "biases" in procedure.settings else {})
    recording = driven(procedure, bench, tmp_path_factory.mktemp(name) / "run", given)
    return procedure, recording, procedure.evaluate(recording)


@pytest.mark.parametrize("name", NAMES)
def test_a_procedure_says_what_it_is_takes_and_measures(name):
    procedure = load_procedure(name)
    assert procedure.doc.splitlines()[0].endswith(".")
    assert procedure.measurements
    assert all(m.meaning for m in procedure.measurements)
    assert len({m.name for m in procedure.measurements}) == len(procedure.measurements)
    undescribed = [setting.name for setting in procedure.settings.values() if not setting.meaning]
    assert not undescribed


def test_ours_are_installed():
    assert set(SHORT) <= set(NAMES)


def test_what_is_found_was_declared_and_is_a_number(done):
    procedure, _, findings = done
    declared = {m.name for m in procedure.measurements}
    assert findings.measured
    for measured in findings.measured:
        assert measured.quantity in declared
        assert measured.value is not None
        assert math.isfinite(measured.value), measured
        assert measured.std is None or math.isfinite(measured.std), measured
        assert measured.verdict is None


def test_results_hold_every_value_and_curve_with_its_unit(done):
    _, recording, findings = done
    results = results_of(recording, findings)
    assert Results.model_validate_json(results.as_json()) == results
    assert [value.name for value in results.values] == [measured.name for measured in findings.measured]
    assert results.curves
    plain = {column.name for curve in results.curves for column in curve.columns if column.unit == "1"}
    assert plain <= {"poles", "zeros", "real", "imaginary", "cycle"}, "a column without a unit"


def test_curves_are_those_that_the_reference_describes(done):
    _, _, findings = done
    for name, curve in findings.curves.items():
        for entry in curve if isinstance(curve, list) else [curve]:
            assert set(entry) == documented(name)


def documented(name: str) -> set[str]:
    """The keys of a curve: those in its row of the table, and in the list that follows for some."""
    ((label, keys),) = re.findall(rf"^\| `{name}`[^|]*\|[^|]*\|([^|]*)\|(.*)$", CURVES, re.MULTILINE)
    listed = re.search(rf"^### .*`{name}`$(.*?)(?=^#|\Z)", CURVES, re.MULTILINE | re.DOTALL)
    heads = re.findall(r"^- ([^:]*):", listed[1] if listed else "", re.MULTILINE)
    named = "" if "–" in label else "`label`"
    return set(re.findall(r"`(\w+)`", " ".join((named, keys, *heads))))


def test_the_limits_are_narrowed_to_the_path_before_it_is_driven(done):
    _, recording, _ = done
    command = recording.values(recording.meta["roles"]["command"])
    (tightened,) = [event["details"] for event in recording.meta["events"] if event["event"] == "limits tightened"]
    assert tightened["low"] == pytest.approx(float(command.min()), abs=1e-3 * float(command.max() - command.min()))
    assert tightened["high"] == pytest.approx(float(command.max()), abs=1e-3 * float(command.max() - command.min()))


def test_it_begins_and_ends_at_neutral(done):
    _, recording, _ = done
    command = recording.values(recording.meta["roles"]["command"])
    assert command[-1] == 0.0


def test_a_command_that_goes_one_way_is_told_a_good_bias(done):
    procedure, recording, findings = done
    if procedure.name == "flow_curve":
        told = any("a good bias for dynamic tests" in note for note in findings.notes)
        assert told == ("current" in recording.channels)
