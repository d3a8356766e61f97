"""The studies' units of another structure are what the study takes them for."""

import csv
import json

import numpy as np
import pytest

from hil.physics.model import save_model, typical_model
from tests.studies import cases
from tests.studies.cases import CONDITIONS, NOTHING, Case, Outcome, cases_of, examined, seal, skeleton, skeletons
from tests.studies.excitation import OTHER, USUAL
from tests.studies.names import RANGES, right_names
from tests.studies.table import as_json


@pytest.mark.parametrize("name", skeletons())
def test_a_skeleton_has_what_is_asked_of_one(name):
    module = skeleton(name)
    unit = module.draw(np.random.default_rng(1))
    assert unit != module.draw(np.random.default_rng(2))
    assert module.PLANT in RANGES and list(module.NOISE) == list(module.CHANNELS)[1:]
    assert all(right_names(name, change) for change in module.CHANGES) and len(module.CHANGES) >= 7
    for change in module.CHANGES.values():
        assert change(unit, 0.0) == unit != change(unit, 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("name", skeletons())
def test_a_change_shows_more_the_larger_it_is(name):
    module = skeleton(name)
    low, high, _ = RANGES[module.PLANT]
    command = 0.5 * (low + high) + 0.4 * (high - low) * USUAL["steps"](np.random.default_rng(1), module.STEP_S)
    unit, output = module.draw(np.random.default_rng(1)), list(module.CHANNELS)[1]
    as_it_is = module.respond(unit, command)[output]
    for change in module.CHANGES.values():
        small, large = (
            np.std(module.respond(change(unit, amount), command)[output] - as_it_is) for amount in (0.1, 1.0)
        )
        assert small <= large > 0.0  # a stop that is not reached yet shows nothing


def test_commands_stay_in_their_range_and_differ_from_draw_to_draw():
    for make in (*USUAL.values(), *OTHER.values()):
        one, other = (make(np.random.default_rng(seed), 0.002) for seed in (1, 2))
        assert one.shape == other.shape == (10_000,) and not np.array_equal(one, other)
        assert np.max(np.abs(one)) <= 1.0


def test_a_unit_is_the_same_in_all_its_cases_and_its_changes_are_drawn_evenly():
    (first, *changed), *_ = cases_of(skeletons(), 1, 2, 7)
    assert first.change == NOTHING and len(changed) == 2 and all(0.3 <= case.wanted <= 10.0 for case in changed)
    drawn = {case.rng("unit").random() for case in (first, *changed)}
    assert len(drawn) == 1 and len({case.rng("after").random() for case in (first, *changed)}) == 3


def test_a_seal_is_that_of_its_truths():
    one, other = (cases_of(["axis_belt"], 2, 1, seed) for seed in (7, 8))
    assert seal(one) == seal(one) != seal(other)


class Typical:
    """A program that identifies nothing, and keeps what it is asked."""

    def identify(self, recordings, plant, model):
        save_model(typical_model(plant), model)
        kept = {"skeleton": {}, "covariance": {"names": [], "matrix": []}}
        model.write_text(json.dumps(json.loads(model.read_text()) | kept))

    def diagnose(self, model, recordings, out):
        answer = {"verdict": "consistent", "effects": [], "changed_parameters": [], "not_separable": []}
        (out / "diagnosis.json").write_text(json.dumps(answer))
        (out / "model.json").write_text(model.read_text())


def test_a_condition_takes_away_what_it_says_and_nothing_else(tmp_path, monkeypatch):
    monkeypatch.setattr(cases, "PYTHON", Typical())
    [unit] = cases_of(["cylinder_elastic"], 1, 0, 7)

    def asked(condition):
        [outcome] = examined(unit, tmp_path, condition)
        assert not outcome.error
        place = tmp_path / "cylinder_elastic-0-7" / condition / NOTHING
        heading, *rows = csv.reader((place / "later-0.csv").read_text().splitlines())
        return heading, np.array(rows, dtype=float), json.loads((place / "model.json").read_text())

    heading, rows, model = asked("")
    assert len(heading) == 5 and {"skeleton", "covariance"} < set(model)
    assert asked("no-inner-signals")[0] == heading[:3]
    assert set(asked("no-skeleton-misfit")[2]) == set(model) - {"skeleton"}
    assert set(asked("no-prior")[2]) == set(model) - {"covariance"}
    np.testing.assert_array_equal(asked("a-third")[1], rows[: round(len(rows) / 3)])
    noisier = asked("noise-twice")[1] - rows
    assert np.std(noisier[:, 2]) == pytest.approx(skeleton("cylinder_elastic").NOISE["position"], rel=0.05)
    assert len(CONDITIONS) == 6


def test_what_is_counted():
    def said(change, verdict, *named, alike=()):
        return Outcome(Case("hpv41_direct", 0, change, 1.0, 1), 2.0 * (change != NOTHING), verdict, named, alike)

    found = [
        said(NOTHING, "consistent"), said(NOTHING, "explained", "friction"), said("play", "explained", "backlash"),
        said("play", "unexplained"), said("play", "explained", "friction"), said("play", "consistent"),
        said("play", "explained", "friction", alike=("friction", "backlash")),
    ]  # fmt: skip
    counts = as_json(found)["all"]
    hits = {name: one["hits"] for name, one in counts.items()}
    assert hits == {
        "unchanged": 2, "alarms": 1, "changed": 5, "noticed": 4, "right": 1, "in_set": 2, "wrong": 1, "failed": 0,
    }  # fmt: skip
    assert counts["alarms"]["interval"] == pytest.approx((0.0126, 0.9874), abs=1e-4)
