"""What the compiled kernel could not survive is refused before it runs; names that exist are said."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from hil.catalog import entries
from hil.errors import InputError, UnknownNameError
from hil.physics.compose import effect, effects, plant
from hil.physics.simulate import ActiveEffect, Drive, Twin, simulate

VALVE = plant("brevini-hpv41")
COUNT = 10


def run(inputs: np.ndarray, effects: tuple[ActiveEffect, ...] = (), **given: Any) -> np.ndarray:
    return simulate(VALVE, VALVE.typical, Drive(inputs, math.nan, 1e-3), effects, **given)


@pytest.mark.parametrize(
    ("inputs", "given", "said"),
    [
        (np.zeros(COUNT), {}, r"inputs of shape \(10,\); a row of one or more samples .* command \[%\]"),
        (np.zeros((2, COUNT)), {}, r"inputs of shape \(2, 10\)"),
        (np.zeros((1, 0)), {}, r"inputs of shape \(1, 0\)"),
        (np.zeros((1, COUNT)), {"trace": np.zeros((1, COUNT))}, r"trace of shape \(1, 10\); a row of 10 samples"),
        (np.zeros((1, COUNT)), {"inject": ("flow", np.zeros(3))}, r"disturbance at flow of shape \(3,\).*\(10,\)"),
        (np.zeros((1, COUNT)), {"inject": ("flwo", np.zeros(COUNT))}, "did you mean 'flow'"),
        (np.zeros((1, COUNT)), {"effects": (ActiveEffect("friction", "flow", {}),)}, "'friction at flow'.*known: "),
    ],
)
def test_what_does_not_fit_is_refused(inputs: np.ndarray, given: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        run(inputs, **given)


def test_a_twin_refuses_a_block_of_another_shape() -> None:
    twin = Twin(VALVE, VALVE.typical, 1e-3)
    twin.advance(np.zeros((1, COUNT)))
    with pytest.raises(InputError, match="inputs of shape"):
        twin.advance(np.zeros((2, COUNT)))


def test_an_effect_is_found_under_its_name() -> None:
    assert tuple(effect(entry.name) for entry in entries("effects")) == effects()
    assert [found.name for found in effects()] == [entry.name for entry in entries("effects")]
    with pytest.raises(UnknownNameError, match="no effect named 'fricton', did you mean 'friction'"):
        effect("fricton")
