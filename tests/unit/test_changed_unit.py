"""Base parameters that changed: a unit that has changed, or the effect that one of them has grown into."""

import numpy as np
import pytest

from hil.diagnosis.diagnose import diagnose
from hil.physics.model import typical_model
from tests.answers import answer
from tests.concealed import bound

EFC = typical_model("cummins-efc")


@pytest.mark.parametrize(
    ("changed", "verdict", "effects"),
    [
        ({"closed_pressure": 2.5}, "explained", ["leakage"]),
        ({"closed_pressure": 1.4, "pressure_span": 1.12}, "parameter_change", []),
    ],
)
def test_a_parameter_is_told_as_an_effect_unless_others_changed_by_more(changed, verdict, effects):
    truth = {name: times * EFC.values[name] for name, times in changed.items()}
    time_s = np.arange(0.0, 8.0, 0.004)
    current = 1.6 + 0.4 * np.sin(time_s) + 0.05 * np.sign(np.sin(7.0 * time_s))
    noises = {f"sweep-{seed}": np.random.default_rng(seed).normal(0.0, 0.5, 2000) for seed in (1, 2)}
    made = [answer(EFC.definition, current, 0.004, noise=noise, name=name, **truth) for name, noise in noises.items()]
    told = diagnose(EFC, bound(EFC, made)).diagnosis
    assert told.verdict == verdict
    assert [f.name for f in told.effects] == effects
    assert {c.name: c.after / c.before for c in told.changed_parameters} == pytest.approx(changed, rel=0.05)
