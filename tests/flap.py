"""A throttle flap that is driven to levels drawn at random, with friction in it."""

from __future__ import annotations

import numpy as np

from hil.identification.preparation.experiment import Experiment, experiment
from hil.physics.compose import plant
from hil.physics.simulate import ActiveEffect
from tests.answers import answer

FLAP = plant("throttle-flap")
NOISE_V = 0.003
TIME_S = 0.02 * np.arange(1000.0)


def recorded(
    name: str, coulomb: float, seed: int, rest: float = FLAP.typical["rest"], levels: int = 40, samples: int = 1
) -> Experiment:
    """What is recorded of it over 20 s, so many `samples` in 20 ms, noise of `NOISE_V` in the reading."""
    rng = np.random.default_rng(seed)
    command = np.repeat(rng.uniform(-15.0, 15.0, levels), samples * len(TIME_S) // levels)
    friction = ActiveEffect(
        "friction", "force", {"coulomb": coulomb, "stiction": 1.2, "stribeck": 0.5, "presliding": 0.01}
    )
    noise = NOISE_V * rng.standard_normal(len(command))
    made = answer(FLAP, command, 0.02 / samples, friction, noise=noise, start=2.5, name=name, rest=rest)
    return experiment(made, FLAP)
