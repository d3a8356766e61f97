"""Hysteresis of the magnetic circuit: rate-independent, with minor loops, memory of reversals, closed by saturation."""

from __future__ import annotations

from typing import Any

from hil.physics.effect import Effect, EffectParameter, compiled, grid, shares

PLAYS = 8


@compiled
def narrowing(value: float, full_scale: float, closing: float) -> float:
    """How many times narrower than about zero a loop is: near saturation iron has less left to remember."""
    away = closing * value / full_scale
    return 1.0 + away * away


@compiled
def transform(
    value: float, state: Any, full_scale: float, width: float, reach: float, least: float, closing: float
) -> float:
    """Prandtl–Ishlinskii: plays with radii from `least` of `reach` to all of it; their mean lags by up to `width`.

    Near saturation iron has less left to remember, and the loop narrows.
    """
    lag = 0.0
    for k in range(8):
        radius = reach * (least + (1.0 - least) * (k + 0.5) / 8.0)
        if value - state[k] > radius:
            state[k] = value - radius
        elif state[k] - value > radius:
            state[k] = value + radius
        lag += (value - state[k]) / radius
    return value - width * lag / 8.0 / narrowing(value, full_scale, closing)


EFFECT = Effect(
    name="hysteresis",
    title="magnetic hysteresis",
    hooks=("command", "coil", "pilot"),
    parameters=(
        EffectParameter("width", "{value}", 0.0, 0.015, 0.0, 0.2, "half width of the major loop"),
        EffectParameter("reach", "{value}", None, 0.06, 0.002, 1.0, "travel after a reversal until the loop is full"),
        EffectParameter(
            "least", "1", None, 0.1, 0.0, 0.8, "smallest radius of a play, as share of it", telling="upper end"
        ),
        EffectParameter(
            "closing", "1", None, 1.0, 0.0, 5.0, "full scale over the drive at which the loop is half as wide"
        ),
    ),
    transform=transform,
    starts=grid(width=shares("amplitude", 0.02, 0.08, 0.25), reach=shares("amplitude", 0.1, 0.4, 1.5)),
    memory=PLAYS,
    equation="y = u − w·mean_k[(u − play_{r_k}(u))/r_k] / (1 + (c·u/U)²),  r_k evenly from l·r to r",
    signature="a loop that does not depend on speed, rounded after reversals, minor loops that close",
    source="Brokate, Sprekels: Hysteresis and Phase Transitions, 1996",
    sentence="The magnet remembers: going up and coming down differ by ±{width}.",
)
