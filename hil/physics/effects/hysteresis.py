"""Hysteresis of the magnetic circuit: rate-independent, with minor loops and memory of reversals."""

from __future__ import annotations

from typing import Any

from hil.physics.effect import Effect, EffectParameter, Seen, compiled

PLAYS = 8


@compiled
def transform(value: float, state: Any, width: float, reach: float) -> float:
    """Prandtl–Ishlinskii: equal plays with radii up to `reach`; their mean lags the input by up to `width`."""
    lag = 0.0
    for k in range(8):
        radius = reach * (k + 0.5) / 8.0
        if value - state[k] > radius:
            state[k] = value - radius
        elif state[k] - value > radius:
            state[k] = value + radius
        lag += (value - state[k]) / radius
    return value - width * lag / 8.0


def starts(seen: Seen) -> list[dict[str, float]]:
    """Small to large against the swing, quickly and slowly filled loops."""
    return [
        {"width": share * seen.swing, "reach": reach * seen.swing}
        for share in (0.02, 0.08, 0.25)
        for reach in (0.1, 0.4, 1.5)
    ]


EFFECT = Effect(
    name="hysteresis",
    title="magnetic hysteresis",
    hooks=("command", "coil", "pilot"),
    parameters=(
        EffectParameter("width", "{value}", 0.0, 0.015, 0.0, 0.2, "half width of the major loop"),
        EffectParameter("reach", "{value}", None, 0.06, 0.002, 1.0, "travel after a reversal until the loop is full"),
    ),
    transform=transform,
    starts=starts,
    memory=lambda _parameters, _step_s: PLAYS,
    equation="y = u − w·mean_k[(u − play_{r_k}(u))/r_k],  r_k spread evenly up to the reach",
    signature="a loop that does not depend on speed, rounded after reversals, minor loops that close",
    source="Brokate, Sprekels: Hysteresis and Phase Transitions, 1996",
    sentence="The magnet remembers: going up and coming down differ by ±{width}.",
)
