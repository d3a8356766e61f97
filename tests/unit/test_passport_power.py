"""What limits would have caught: least faults of a unit's own model, confirmed, resumable, on the passport."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace

import pytest
from pypdf import PdfReader

from hil.api import issue_passport, run
from hil.diagnosis.search.terms import all_terms
from hil.passport import power
from hil.passport.contents import lay_out
from hil.passport.unit import read_unit_runs
from hil.physics.model import typical_model
from hil.session.results import evaluated

pytestmark = pytest.mark.xdist_group("power of a passport")  # on one worker: it is fitted once

CHANGE, OVERSHOOT = "change, 0 → 50 %", "overshoot, 0 → 50 %"
TRIED = ("full_flow", "load_force at spool", "sensor_lag")


@pytest.fixture(autouse=True)
def a_short_search(monkeypatch):
    def few(*posed):
        return tuple(term for term in all_terms(*posed) if term.label in TRIED)

    monkeypatch.setattr("hil.diagnosis.search.terms.all_terms", few)
    monkeypatch.setattr(power, "REPEATS", 10)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A run on the simulated HPV41: one step, its change and its overshoot limited."""
    at = tmp_path_factory.mktemp("power") / "run"
    limits = [f"{CHANGE}=19..24", f"{OVERSHOOT}=..30"]
    run("step_response", "brevini-hpv41", at, levels=(0.0, 50.0), hold_s=1.0, serial="7", limits=limits)
    return at


@pytest.fixture
def unit(folder):
    return read_unit_runs([folder]).runs[0]


@pytest.fixture
def model():
    return replace(typical_model("brevini-hpv41"), input="command [%]", output="flow [l/min]")


def silent(_done: float, _text: str) -> None:
    pass


def sizes(found: power.Power, limit: str) -> dict[str, float]:
    return {fault.name: fault.size for fault in found.faults if fault.limit == limit}


def test_least_size_is_where_the_value_leaves_its_guarded_limit(unit, model):
    """The flow is proportional to the full flow: it fails where the change is U and 1.6 scatters beyond 24 l/min."""
    found = power.power_of(unit, model, silent)
    change = unit.results[CHANGE]
    assert change.value and change.expanded and change.repeatability
    needed = (24.0 + change.expanded + 1.64 * change.repeatability) / change.value
    flow = next(fault for fault in found.faults if fault.name == "full_flow")
    assert flow.limit == CHANGE and flow.size / flow.nominal == pytest.approx(needed, rel=0.03)
    assert all(fault.failed >= 0.95 * fault.repeats for fault in found.faults)
    assert OVERSHOOT in found.unbroken and not found.unproven
    assert set(found.tried) == set(TRIED)


def test_stopped_it_goes_on_where_it_was(unit, model, tmp_path, monkeypatch):
    kept, evaluations = tmp_path / "kept.json", list[int]()

    def counting(*given):
        evaluations.append(1)
        warnings.warn("Mean of empty slice", RuntimeWarning, stacklevel=1)  # of a valve that does not open: no news
        return evaluated(*given)

    def stopping(_done, text):
        if text.endswith(OVERSHOOT):
            raise KeyboardInterrupt

    monkeypatch.setattr(power, "evaluated", counting)
    whole = power.power_of(unit, model, silent)
    needed = len(evaluations)
    with pytest.raises(KeyboardInterrupt):
        power.power_of(unit, model, stopping, kept)
    before = len(evaluations) - needed
    assert power.power_of(unit, model, silent, kept) == whole
    assert 0 < before < len(evaluations) - needed <= needed
    assert not kept.exists()


def test_passport_says_it_in_the_annex_and_in_a_file(folder, tmp_path):
    found = issue_passport(folder, tmp_path / "unit.pdf", power=True)
    (one,) = found.powers
    assert "full_flow" in sizes(one, CHANGE)
    lay_out(found.path.read_bytes(), tmp_path / "inside")
    inside = json.loads((tmp_path / "inside" / "power.json").read_text("utf-8"))
    assert inside["schema"] == "hil.power/1" and inside["runs"][0]["unbroken"] == [OVERSHOOT]
    text = " ".join("".join(page.extract_text() for page in PdfReader(found.path).pages).split())
    assert "What these limits would have caught" in text and "full flow" in text
    assert not list(tmp_path.glob(".*.json"))
