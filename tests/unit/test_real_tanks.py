"""A plant sampled every few seconds: diagnosed from end to end, with no test of a valve proposed for it."""

import re

import numpy as np

from hil.diagnosis.diagnose import Diagnosed, diagnose
from hil.identification.grey_box.identify import fit_plant, starting_model
from hil.identification.preparation.experiment import experiment
from hil.physics.compose import plant
from hil.physics.simulate import ActiveEffect
from hil.record.recording import Recording
from tests.answers import answer

INTERVAL_S = 4.0


def recorded(name: str, *effects: ActiveEffect, count: int = 600) -> Recording:
    k = np.arange(count)
    voltage = 3.0 + 1.2 * np.sin(k / 21.0) + 0.9 * np.sin(k / 9.0) + 0.6 * np.sin(k / 57.0)
    tanks = plant("cascaded-tanks")
    truth = {"pump": 0.05, "drain_upper": 0.06, "drain_lower": 0.06}
    noise = 0.01 * np.random.default_rng(11).standard_normal(count)
    return answer(tanks, voltage, INTERVAL_S, *effects, noise=noise, start=5.0, name=name, **truth)


SPILLS = ActiveEffect("overflow", "upper", {"brim": 6.5, "caught": 0.4})


def diagnosed(count: int) -> Diagnosed:
    start = starting_model("cascaded-tanks")
    nominal = fit_plant(start, [experiment(recorded("healthy"), start.definition)]).model
    return diagnose(nominal, [experiment(recorded("spills", SPILLS, count=count), start.definition)])


def test_an_overflow_is_found_and_no_valve_test_is_proposed():
    found = diagnosed(800)
    assert found.diagnosis.verdict == "explained"
    assert [effect.name for effect in found.corrected.effects] == ["overflow"]
    values = {name: value.value for name, value in found.corrected.effects[0].parameters.items()}
    assert abs(values["brim"] - 6.5) < 0.1
    assert abs(values["caught"] - 0.4) < 0.05
    assert found.diagnosis.next_test is None


def test_a_recording_too_short_to_judge_a_prediction_names_and_corrects_nothing():
    found = diagnosed(250)
    assert found.diagnosis.verdict == "explained"
    assert [effect.name for effect in found.diagnosis.effects] == ["overflow"]
    assert abs(found.diagnosis.effects[0].parameters["brim"].value - 6.5) < 0.1
    assert re.search("only [1-5] blocks that no fit has seen outlast the settling", found.diagnosis.why_corrected)
    assert found.diagnosis.corrected_is == "nominal"
    assert found.corrected.effects == ()
