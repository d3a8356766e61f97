"""Coil heating: copper resistance rises with temperature, the force falls over minutes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hil.physics.effect import Effect, EffectParameter, compiled, grid, shares


@compiled
def transform(value: float, state: Any, loss: float, gain: float, full_scale: float) -> float:
    """Value over resistance ratio; state: rise of resistance, heated by the square of what passes."""
    drive = value / full_scale
    state[0] += (loss * drive * drive - state[0]) * gain
    return value / (1.0 + state[0])


@compiled
def settle(value: float, state: Any) -> float:
    """Cold at the start of the recording."""
    state[0] = 0.0
    return value


def coefficients(parameters: Mapping[str, float], step_s: float) -> dict[str, float]:
    """Final loss at rated drive, and the share of the way that the coil warms in one sub-step."""
    return {
        "loss": parameters["loss"],
        "gain": -math.expm1(-step_s / parameters["warming"]),
    }


EFFECT = Effect(
    name="coil_heating",
    title="heating of the coil",
    hooks=("command", "coil", "pilot"),
    parameters=(
        EffectParameter("loss", "1", 0.0, 0.1, 0.0, 2.0, "rise of resistance at rated drive, in the end"),
        EffectParameter("warming", "s", None, 30.0, 1.0, 3000.0, "time constant of warming"),
    ),
    transform=transform,
    starts=grid(loss=(0.03, 0.15, 0.5), warming=shares("duration_s", 0.05, 0.3, 2.0)),
    memory=1,
    settle=settle,
    coefficients=coefficients,
    equation="τ·dϑ/dt + ϑ = h·(i/i_N)²;  F ∝ i/(1 + ϑ)",
    signature="gain falls slowly with the time at high command and recovers at low command",
    source="Copper: R = R20·(1 + 0.00393/K·ΔT); Kallenbach et al.: Elektromagnete, 2012",
    sentence="The coil warms up and loses force: its resistance rises by {loss:%} at full drive, over {warming}.",
)
