"""Resonance: an oil spring, a line or the structure swings after each change."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hil.physics.effect import Effect, EffectParameter, Seen, at_rest, compiled
from hil.physics.steps import spring_step


@compiled
def transform(
    value: float,
    state: Any,
    xx: float,
    xv: float,
    x0: float,
    x1: float,
    vx: float,
    vv: float,
    v0: float,
    v1: float,
    share: float,
) -> float:
    """A second-order stage of unit gain beside a direct path; state: position, velocity, last input."""
    place = xx * state[0] + xv * state[1] + x0 * state[2] + x1 * value
    speed = vx * state[0] + vv * state[1] + v0 * state[2] + v1 * value
    state[0] = place
    state[1] = speed
    state[2] = value
    return value + share * (place - value)


def coefficients(parameters: Mapping[str, float], step_s: float) -> dict[str, float]:
    """The exact step of the stage."""
    period = parameters["period"]
    stage = spring_step(1.0, 1.0, math.inf)
    if period > 1e-6:
        stage = spring_step(2.0 * math.pi / period, parameters["damping"], step_s)
    return stage | {"share": parameters["share"]}


def starts(seen: Seen) -> list[dict[str, float]]:
    """Periods from a few samples to a second, and those of lines that stand out, each in a part of the signal."""
    periods = seen.periods_s(0.02, 0.04, 0.08, 0.12, 0.17, 0.25, 0.4, 0.8, 1.5)
    return [{"share": 0.4, "period": period, "damping": 0.1} for period in periods]


EFFECT = Effect(
    name="resonance",
    title="resonance",
    hooks=("flow", "sensor", "recorder"),
    parameters=(
        EffectParameter("share", "1", 0.0, 0.4, 0.0, 1.0, "share of the signal that goes through the swinging part"),
        EffectParameter("period", "s", None, 0.1, 0.005, 2.0, "period of the oscillation"),
        EffectParameter("damping", "1", None, 0.15, 0.005, 0.6, "damping ratio: well under one, or it would not ring"),
    ),
    transform=transform,
    starts=starts,
    memory=3,
    settle=at_rest,
    coefficients=coefficients,
    equation="ÿ/ω² + 2ζ·ẏ/ω + y = u",
    signature="ringing of one period after steps, a peak in the frequency response, no distortion",
    source="Jelali, Kroll: Hydraulic Servo-systems, 2003, ch. 4",
    sentence="Something swings with a period of {period} after each change.",
)
