"""Rate limit: the part follows no faster than its supply of pilot flow or current allows."""

from __future__ import annotations

import math
from typing import Any

from hil.physics.effect import Effect, EffectParameter, Seen, compiled


@compiled
def transform(value: float, step_s: float, state: Any, rate: float) -> float:
    """Follow at most `rate` per second."""
    most = rate * step_s
    state[0] += min(max(value - state[0], -most), most)
    return state[0]


def starts(seen: Seen) -> list[dict[str, float]]:
    """Rates that the model reaches: of its steps, well above what it reaches most of the time, and below."""
    top = max(seen.speeds[2], 1e-9)
    return [{"rate": share * top} for share in (25.0, 6.0, 1.5, 0.8, 0.4, 0.2, 0.1, 0.05)]


EFFECT = Effect(
    name="rate_limit",
    title="slew rate limit",
    hooks=("command", "coil", "pilot", "opening", "position"),
    parameters=(EffectParameter("rate", "{value}/s", math.inf, 2.0, 0.02, 200.0, "fastest change", by_law=0.02),),
    transform=transform,
    starts=starts,
    memory=1,
    equation="|dy/dt| ≤ R",
    signature="steps become ramps of constant slope, bandwidth falls as amplitude grows",
    source="Merritt: Hydraulic Control Systems, 1967, ch. 7",
    sentence="It moves no faster than {rate}, however large the step.",
)
