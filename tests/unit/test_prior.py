"""How far base parameters may wander: what identification found of them, or what somebody typed into the file."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hil.diagnosis.intake.prior import Prior
from hil.physics.compose import plant
from hil.physics.model import Covariance, Model, typical_model

AXIS = plant("linear-axis")
FOUND = Covariance(("mass", "viscous"), ((4.0, 3.0), (3.0, 9.0)))


def prior(mass_std: float | None, origin: dict[str, Any]) -> Prior:
    model: Model = typical_model(AXIS.name)
    mass = replace(model.parameters["mass"], std=mass_std)
    made = replace(model, parameters={**model.parameters, "mass": mass}, covariance=FOUND, origin=origin)
    return Prior(made, tuple(p for p in AXIS.parameters if p.name in FOUND.names))


def shape(of: Prior) -> Any:
    """Without the drift that every parameter may have."""
    return of.covariance - np.diag([0.5**2, 1.0**2])


@pytest.mark.parametrize(("std", "origin"), [(None, {}), (5.0, {"std": {"mass": 5.0, "viscous": None}}), (5.0, {})])
def test_what_identification_printed_is_no_prior(std, origin):
    """Its interval holds what the model lacks too; another recording would move the value by less."""
    assert shape(prior(std, origin)) == pytest.approx(np.array(FOUND.matrix))


@pytest.mark.parametrize(
    ("std", "origin"),
    [(50.0, {"std": {"mass": None}}), (50.0, {"std": {"mass": 5.0}}), (0.1, {"std": {"mass": 5.0}}), (0.1, {})],
)
def test_a_typed_std_takes_the_place_of_the_covariance(std, origin):
    assert shape(prior(std, origin)) == pytest.approx(np.array([[std**2, 0.0], [0.0, 9.0]]))


def test_what_the_recordings_in_question_told_is_not_known_beside_them():
    widths = {p.name: p.high - p.low for p in AXIS.parameters}
    own = replace(prior(None, {}), is_own=True)
    assert shape(own) == pytest.approx(np.diag([widths["mass"] ** 2, widths["viscous"] ** 2]))
    typed = replace(prior(50.0, {"std": {"mass": 5.0}}), is_own=True)
    assert shape(typed)[0, 0] == pytest.approx(50.0**2)
