"""Coil lag: inductance and eddy currents delay the force behind the command."""

from __future__ import annotations

from typing import Any

from hil.physics.effect import Effect, EffectParameter, Seen, compiled
from hil.physics.effects.sensor_lag import coefficients
from hil.physics.effects.sensor_lag import starts as lags


@compiled
def transform(value: float, state: Any, keep: float, keep_second: float, direct: float) -> float:
    """Two first-order lags in a row, past which a part goes at once; the second lag may be instant."""
    state[0] = keep * state[0] + (1.0 - keep) * value
    state[1] = keep_second * state[1] + (1.0 - keep_second) * state[0]
    return state[1] + direct * (value - state[1])


def starts(seen: Seen) -> list[dict[str, float]]:
    """As for a sensor, and one with a part that goes at once."""
    return [*lags(seen), {"lag": 0.05, "second": 0.0, "direct": 0.1}]


EFFECT = Effect(
    name="coil_lag",
    title="lag of the coil",
    hooks=("command", "coil", "pilot"),
    parameters=(
        EffectParameter("lag", "s", 0.0, 0.02, 0.0, 0.5, "time constant L/R"),
        EffectParameter("second", "1", None, 0.0, 0.0, 1.0, "time constant of eddy currents, as a share of it"),
        EffectParameter("direct", "1", None, 0.0, 0.0, 0.5, "share that eddy currents let pass at once"),
    ),
    transform=transform,
    starts=starts,
    memory=lambda _parameters, _step_s: 2,
    coefficients=lambda parameters, step_s: {**coefficients(parameters, step_s), "direct": parameters["direct"]},
    equation="F = e·F(i) + (1 − e)·F₂, (T·s + 1)·(r·T·s + 1)·F₂ = F(i)",
    signature="phase and gain fall with frequency before the metering edge, no distortion of its own",
    source="Facts: V = R·i + L·di/dt; Kallenbach et al.: Elektromagnete, 2012",
    sentence="The magnet builds up its force late: time constant {lag}.",
)
