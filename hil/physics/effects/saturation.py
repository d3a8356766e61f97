"""Saturation: beyond a limit more input gives no more output."""

from __future__ import annotations

import math

from hil.physics.effect import Effect, EffectParameter, compiled, grid, shares


@compiled
def transform(value: float, limit: float, knee: float, slope: float) -> float:
    """Bend down to `slope` beyond ±limit; a parabola of half width `knee`·limit rounds the corner."""
    size = abs(value)
    if size <= limit * (1.0 - knee):  # written so that no limit at all, infinity, passes everything
        return value
    half = knee * limit
    if size >= limit + half:
        passed = limit
    else:
        over = size - limit + half
        passed = size - over * over / (4.0 * half)
    return math.copysign(passed + slope * (size - passed), value)


EFFECT = Effect(
    name="saturation",
    title="saturation",
    hooks=("command", "coil", "opening", "flow"),
    parameters=(
        EffectParameter("limit", "{value}", math.inf, 0.8, 0.05, 4.0, "largest value that is passed"),
        EffectParameter("knee", "1", None, 0.05, 0.001, 0.5, "half width of the rounding, as a share of the limit"),
        EffectParameter("slope", "1", None, 0.02, 0.0, 0.5, "gain that is left beyond the limit"),
    ),
    transform=transform,
    starts=grid(limit=shares("size", 0.97, 0.9, 0.8, 0.65, 0.5), knee=(0.02, 0.2)),
    equation="y = sgn(u)·[min(|u|, L) + s·max(|u| − L, 0)], rounded over L·(1 ± k)",
    signature="flat tops at large amplitude, odd harmonics without phase, nothing at small amplitude",
    source="Slotine, Li: Applied Nonlinear Control, 1991, ch. 5",
    sentence="Beyond {limit} more command gives no more: something has reached its limit.",
)
