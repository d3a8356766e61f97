"""A throttle flap that is driven to levels drawn at random, with friction in it."""

from __future__ import annotations

import numpy as np

from hil.identification.preparation.experiment import Experiment, experiment
from hil.physics.compose import plant
from hil.physics.simulate import ActiveEffect, Drive, simulate
from hil.record.recording import recording

FLAP = plant("throttle-flap")
NOISE_V = 0.003
TIME_S = 0.02 * np.arange(1000.0)


def recorded(
    name: str, coulomb: float, seed: int, rest: float = FLAP.typical["rest"], levels: int = 40, samples: int = 1
) -> Experiment:
    """What is recorded of it over 20 s, so many `samples` in 20 ms, noise of `NOISE_V` in the reading."""
    rng = np.random.default_rng(seed)
    time_s = 0.02 / samples * np.arange(samples * len(TIME_S))
    command = np.repeat(rng.uniform(-15.0, 15.0, levels), len(time_s) // levels)
    friction = ActiveEffect(
        "friction", "force", {"coulomb": coulomb, "stiction": 1.2, "stribeck": 0.5, "presliding": 0.01}
    )
    angle = simulate(FLAP, {**FLAP.typical, "rest": rest}, Drive(command[None, :], 2.5, 0.02 / samples), [friction])[0]
    angle = angle + NOISE_V * rng.standard_normal(len(angle))
    return experiment(recording(name, time_s, {"motor command [V]": command, "flap angle [V]": angle}), FLAP)
