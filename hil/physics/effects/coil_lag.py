"""Coil lag: inductance and eddy currents delay the force behind the command."""

from __future__ import annotations

from typing import Any

from hil.physics.effect import Effect, EffectParameter, Seen, compiled
from hil.physics.effects.sensor_lag import coefficients
from hil.physics.effects.sensor_lag import starts as lags
from hil.physics.effects.sensor_lag import transform as lagging


@compiled
def transform(
    value: float, state: Any, full_scale: float,
    xx: float, xv: float, vx: float, vv: float, direct: float, saturating: float,
) -> float:  # fmt: skip
    """A lag of first or second order, past which a part goes at once: the more of it, the more the iron saturates."""
    late = lagging(value, state, xx, xv, vx, vv)
    share = late / full_scale
    return late + min(direct + saturating * share * share, 1.0) * (value - late)


def starts(seen: Seen) -> list[dict[str, float]]:
    """As for a sensor, and one with a part that goes at once."""
    return [*lags(seen), {"lag": 0.05, "second": 0.0, "direct": 0.1}]


EFFECT = Effect(
    name="coil_lag",
    title="lag of the coil",
    hooks=("command", "coil", "pilot"),
    parameters=(
        EffectParameter("lag", "s", 0.0, 0.02, 0.0, 0.5, "time constant L/R, with that of eddy currents"),
        EffectParameter("second", "1", None, 0.0, 0.0, 1.0, "0: inductance alone, 1: eddy currents as slow as it"),
        EffectParameter("direct", "1", None, 0.0, 0.0, 0.5, "share that eddy currents let pass at once"),
        EffectParameter("saturating", "1", None, 0.1, 0.0, 4.0, "share more of it at full scale: inductance falls"),
    ),
    transform=transform,
    starts=starts,
    memory=lambda _parameters, _step_s: 2,
    coefficients=lambda parameters, step_s: {
        **coefficients(parameters, step_s),
        **{name: parameters[name] for name in ("direct", "saturating")},
    },
    equation="F = (e + k·(F₂/U)²)·F(i) + (1 − e − k·(F₂/U)²)·F₂, (r·T²/4·s² + T·s + 1)·F₂ = F(i)",
    signature="phase and gain fall with frequency before the metering edge, no distortion of its own",
    source="Facts: V = R·i + L·di/dt; Kallenbach et al.: Elektromagnete, 2012",
    sentence="The magnet builds up its force late: time constant {lag}.",
)
