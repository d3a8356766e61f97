"""Coil lag: inductance and eddy currents delay the force behind the command."""

from __future__ import annotations

from hil.physics.effect import Effect, EffectParameter
from hil.physics.effects.sensor_lag import coefficients, starts, transform

EFFECT = Effect(
    name="coil_lag",
    title="lag of the coil",
    hooks=("command", "coil", "pilot"),
    parameters=(
        EffectParameter("lag", "s", 0.0, 0.02, 0.0, 0.5, "time constant L/R"),
        EffectParameter("second", "1", None, 0.0, 0.0, 1.0, "time constant of eddy currents, as a share of it"),
    ),
    transform=transform,
    starts=starts,
    memory=lambda _parameters, _step_s: 2,
    coefficients=coefficients,
    equation="(T·s + 1)·(r·T·s + 1)·F = F(i)",
    signature="phase and gain fall with frequency before the metering edge, no distortion of its own",
    source="Facts: V = R·i + L·di/dt; Kallenbach et al.: Elektromagnete, 2012",
    sentence="The magnet builds up its force late: time constant {lag}.",
)
