"""Lag of a turbine flow meter: its rotor is driven by the flow, so it is quick at full flow and slow near rest."""

from __future__ import annotations

from typing import Any

from hil.physics.effect import Effect, EffectParameter, compiled, grid


@compiled
def transform(
    value: float, step_s: float, full_scale: float, state: Any, lag: float, rest: float, falling: float
) -> float:
    """A first-order step towards the value midway between the last and this one, at the rate that the reading gives."""
    reading, between = state[0], 0.5 * (state[1] + value)
    state[1] = value
    if lag <= 1e-9:
        state[0] = value
        return value
    rate = (rest + (1.0 - rest) * min(abs(reading) / full_scale, 1.0)) / lag
    if (between - reading) * reading < 0.0:
        rate /= falling
    share = step_s * rate
    state[0] = reading + (between - reading) * share / (1.0 + 0.5 * share)
    return state[0]


EFFECT = Effect(
    name="turbine_lag",
    known_as="sensor_lag",
    title="lag of the sensor",
    hooks=("turbine",),
    parameters=(
        EffectParameter("lag", "s", 0.0, 0.02, 0.0, 0.5, "time constant at full flow"),
        EffectParameter("rest", "1", None, 0.5, 0.05, 1.0, "rate near rest over that at full flow"),
        EffectParameter("falling", "1", None, 1.2, 0.8, 3.0, "time constant of falling over that of rising"),
    ),
    transform=transform,
    starts=grid(lag=(0.01, 0.03, 0.1)),
    memory=2,
    equation="ẏ = (u − y)·(k₀ + (1 − k₀)·|y|/Q)/T, T larger while |y| falls",
    signature="phase and gain fall with frequency, the more the smaller the flow; spool position is on time",
    source="Grey: Transient response of the turbine flowmeter, Jet Propulsion 26, 1956",
    sentence="The flow meter, not the valve, is slow: at full flow it follows with a time constant of {lag}.",
)
