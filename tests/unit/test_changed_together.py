"""Several base parameters of an EFC that are far off at once: none stays that only stands for the others."""

from dataclasses import replace

import numpy as np
import pytest

from hil.diagnosis.intake.problem import pose
from hil.diagnosis.verdict.explain import explained
from hil.identification.preparation.experiment import for_model
from hil.physics.model import typical_model
from tests.answers import answer

RATE_HZ = 500.0
GOOD = {"coil_lag": 0.008, "rotor_frequency": 187.0, "rotor_damping": 3.14}
RETURNED = {"coil_lag": 0.008, "rotor_frequency": 33.0, "rotor_damping": 1.09}


def test_a_slow_rotor_is_not_told_as_a_slow_coil():
    typical = typical_model("cummins-efc")
    values = {name: replace(v, value=GOOD.get(name, v.value)) for name, v in typical.parameters.items()}
    good = replace(typical, parameters=values)
    rng = np.random.default_rng(4)
    current = np.repeat(rng.uniform(1.3, 1.75, 24), round(0.25 * RATE_HZ))
    noise = 0.3 * rng.standard_normal(len(current))
    returned = answer(good.definition, current, 1.0 / RATE_HZ, noise=noise, **RETURNED)
    problem = pose(good, [for_model(good, returned)])
    _, choice = explained(problem)
    found = choice.chosen
    assert choice.verdict == "parameter_change"
    told = {term.name: value for term, (value,) in zip(found.terms, found.values, strict=True)}
    assert told == pytest.approx({name: RETURNED[name] for name in ("rotor_frequency", "rotor_damping")}, rel=0.02)
