"""Effects that the nominal model has already: what grew or shrank in them is told as that, and not as other physics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil.diagnosis.diagnose import Diagnosed, diagnose
from hil.identification.preparation.experiment import for_model
from hil.passport.difference import difference
from hil.passport.sources import Dated
from hil.physics.model import Model, ModelEffect, Value, typical_model
from hil.physics.simulate import ActiveEffect
from hil.record.recording import Recording
from tests.answers import answer
from tests.concealed import NOISE, PLANT, RATE_HZ, commands

KNOWN_TO = 0.05


def model(coulomb: float = 0.8, known_to: float = KNOWN_TO) -> Model:
    """An HPV41 that was identified with its friction."""
    values = {"coulomb": Value(coulomb, "%", known_to), "stiction": Value(1.0, "1", None),
              "stribeck": Value(10.0, "%/s", None), "presliding": Value(0.6, "%", None)}  # fmt: skip
    return replace(typical_model(PLANT), effects=(ModelEffect("friction", "force", values),))


def steps(coulomb: float, *others: ActiveEffect, seed: int = 3) -> Recording:
    """What a unit with so much friction does."""
    rng, unit = np.random.default_rng(seed), model(coulomb)
    command = commands(rng)["steps"]
    noise, effects = NOISE * rng.standard_normal(len(command)), (*unit.active_effects, *others)
    return answer(unit.definition, command, 1.0 / RATE_HZ, *effects, noise=noise, name="steps", factor=4.0)


def told(nominal: Model, made: Recording) -> Diagnosed:
    return diagnose(nominal, [for_model(nominal, made)])


@pytest.mark.parametrize("coulomb", [1.6, 0.4])
def test_more_or_less_friction_is_friction(coulomb):
    found = told(model(), steps(coulomb))
    (friction,) = found.diagnosis.effects
    grown = friction.parameters["coulomb"]
    assert (found.diagnosis.verdict, friction.name, grown.was) == ("explained", "friction", 0.8)
    assert grown.std is not None
    assert abs(grown.value - coulomb) < 3.0 * grown.std < 0.1
    assert "instead of 0.80" in friction.sentence
    assert "What the model has of friction" in found.diagnosis.headline
    assert found.diagnosis.as_dict()["effects"][0]["parameters"]["coulomb"]["from"] == 0.8
    (kept,) = found.corrected.effects
    assert kept.parameters["coulomb"].value == grown.value
    assert kept.parameters["presliding"].value == 0.6


def test_new_physics_beside_it_is_told_as_new():
    play = ActiveEffect("backlash", "opening", {"half_width": 2.0})
    found = told(model(), steps(0.8, play)).diagnosis
    assert [(f.name, f.is_new) for f in found.effects] == [("backlash", True)]
    assert found.headline.startswith("The model leaves out backlash")
    (limit,) = (one for one in found.limits if one.effect == "friction")
    assert limit.about == 0.8


@pytest.mark.parametrize("coulomb", [0.76, 0.84])
def test_a_change_too_small_to_be_named_lies_within_its_limit_either_way(coulomb):
    found = told(model(known_to=0.001), steps(coulomb)).diagnosis
    assert not found.effects
    (limit,) = (one for one in found.limits if one.effect == "friction")
    assert 0.03 < limit.upper < 0.2


def test_what_was_known_no_better_is_no_news():
    found = told(model(known_to=0.2), steps(1.0))
    assert found.diagnosis.verdict == "consistent"
    assert any("instead of 0.8 %, within what was known of it" in text for text in found.diagnosis.warnings)
    assert found.corrected.effects[0].parameters["coulomb"].value == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(("before", "after"), [(0.8, 1.6), (1.6, 0.8)])
def test_two_dates_of_a_unit_tell_how_it_grew(before, after):
    first, second = (Dated(name, (steps(c, seed=s),)) for name, c, s in (("old", before, 3), ("new", after, 4)))
    (change,) = (c for c in difference(first, second, model()).changes if c.stage)
    assert (change.name, change.parameter) == ("friction", "coulomb")
    assert (change.before.value, change.after.value) == pytest.approx((before, after), abs=0.06)
    assert change.before.std is not None
    assert change.before.std < 0.03
