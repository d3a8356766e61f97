"""End stop: the part cannot go further."""

from __future__ import annotations

import math

from hil.physics.effect import Effect, EffectParameter, Seen, compiled


@compiled
def transform(value: float, upper: float, lower: float) -> float:
    """Clip between the stops."""
    return min(max(value, lower), upper)


def starts(seen: Seen) -> list[dict[str, float]]:
    """Just inside either end of what the model reaches, the other stop out of reach; and inside both."""
    reach = seen.high - seen.low
    uppers = [{"upper": seen.high - share * reach, "lower": seen.low - reach} for share in (0.02, 0.08, 0.2, 0.35)]
    lowers = [{"lower": seen.low + share * reach, "upper": seen.high + reach} for share in (0.02, 0.08, 0.2, 0.35)]
    both = [{"upper": seen.high - share * reach, "lower": seen.low + share * reach} for share in (0.04, 0.1)]
    return uppers + lowers + both


EFFECT = Effect(
    name="end_stop",
    title="end stop",
    hooks=("load", "stop", "position"),
    parameters=(
        EffectParameter("upper", "{value}", math.inf, 0.8, -2.0, 4.0, "upper stop", by_law=0.003),
        EffectParameter("lower", "{value}", -math.inf, -3.0, -4.0, 2.0, "lower stop", by_law=0.003),
    ),
    transform=transform,
    starts=starts,
    equation="x_lower ≤ x ≤ x_upper",
    signature="the position stays flat at one value whatever the command does",
    source="Jelali, Kroll: Hydraulic Servo-systems, 2003, ch. 4",
    sentence="It runs against a stop: below at {lower:?}, above at {upper:?}.",
)
