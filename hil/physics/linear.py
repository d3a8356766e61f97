"""Exact steps of linear stages, and the delay line. A step of infinity is the steady state."""

from __future__ import annotations

import math
from typing import Any

from hil.physics.effect import compiled

# Below it series are nearer than quotients that cancel.
_SMALL = 1e-5


def first_order(time_constant_s: float, step_s: float) -> tuple[float, float, float]:
    """(a, g0, g1) with y₁ = a·y₀ + g0·u₀ + g1·u₁, exact for an input that runs straight from u₀ to u₁."""
    if math.isinf(step_s) or time_constant_s <= 1e-9:
        return 0.0, 0.0, 1.0
    ratio = time_constant_s / step_s
    a = math.exp(-1.0 / ratio)
    g1 = 1.0 - ratio * (1.0 - a)
    return a, 1.0 - a - g1, g1


def held_first_order(time_constant_s: float, step_s: float) -> float:
    """A with y₁ = a·y₀ + (1 − a)·u, exact for an input held over the step."""
    if math.isinf(step_s) or time_constant_s <= 1e-9:
        return 0.0
    return math.exp(-step_s / time_constant_s)


def braked_mass(mass: float, drag: float, step_s: float) -> tuple[float, float, float, float]:
    """Step of m·ẍ + d·ẋ = F, exact for a force held over the step: (keep, mobility, travel, compliance).

    v₁ = keep·v + mobility·F and x₁ = x + travel·v + compliance·F; over a step of infinity it is at rest, all are 0.
    """
    if math.isinf(step_s):
        return 0.0, 0.0, 0.0, 0.0
    rate = drag / mass
    lost = rate * step_s
    keep = math.exp(-lost)
    if lost < _SMALL:
        travel = (1.0 - lost / 2.0) * step_s
        return keep, travel / mass, travel, (0.5 - lost / 6.0) * step_s**2 / mass
    faded = -math.expm1(-lost)
    return keep, faded / (rate * mass), faded / rate, (step_s - faded / rate) / (rate * mass)


def second_order(frequency_rad_s: float, damping: float, step_s: float) -> tuple[float, ...]:
    """Step of ẍ = ω²(u − x) − 2ζω·ẋ, exact for an input that runs straight from u₀ to u₁.

    Returns (xx, xv, x0, x1, vx, vv, v0, v1): x₁ = xx·x + xv·v + x0·u₀ + x1·u₁ and the same for the velocity.
    """
    if math.isinf(step_s):
        return 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0
    w, h, decay = frequency_rad_s, step_s, damping * frequency_rad_s
    xx, xv, vx, vv = free_motion(w, decay, h)
    # The ramp's own solution is x = u − k·slope, v = slope; the rest is free motion from the difference.
    k = 2.0 * damping / w
    return (
        xx, xv, -xx - (xx * k - xv - k) / h, 1.0 + (xx * k - xv - k) / h,
        vx, vv, -vx - (vx * k - vv + 1.0) / h, (vx * k - vv + 1.0) / h,
    )  # fmt: skip


def free_motion(w: float, decay: float, h: float) -> tuple[float, float, float, float]:
    """Step of ẍ = −ω²x − 2·decay·ẋ over h: (xx, xv, vx, vv) with x₁ = xx·x + xv·v and v₁ = vx·x + vv·v."""
    beat2 = w * w - decay * decay
    if beat2 > 1e-12 * w * w:
        beat = math.sqrt(beat2)
        fade = math.exp(-decay * h)
        cosine, sine = fade * math.cos(beat * h), fade * math.sin(beat * h) / beat
    elif beat2 < -1e-12 * w * w:
        beat = math.sqrt(-beat2)
        slow, fast = math.exp(-(decay - beat) * h), math.exp(-(decay + beat) * h)
        cosine, sine = (slow + fast) / 2.0, (slow - fast) / (2.0 * beat)
    else:
        fade = math.exp(-decay * h)
        cosine, sine = fade, fade * h
    return cosine + decay * sine, sine, -w * w * sine, cosine - decay * sine


def delay_steps(dead_time_s: float, step_s: float) -> float:
    """A dead time in sub-steps for `delayed`; the steady state is marked by −1."""
    return -1.0 if math.isinf(step_s) else dead_time_s / step_s


@compiled
def delayed(line: Any, value: float, steps: float) -> float:
    """`value` as it was `steps` sub-steps ago; between two stored values the mean over the step is kept.

    `line` is a ring with its write position in the last word. Negative `steps` fill it (steady state).
    """
    size = len(line) - 1
    if steps < 0.0:
        line[:] = value
        line[size] = 0.0
        return value
    at = int(line[size])
    line[at] = value
    line[size] = at + 1 if at + 1 < size else 0
    whole = min(int(steps), size - 2)
    part = min(steps - whole, 1.0)
    newer = at - whole
    if newer < 0:
        newer += size
    older = newer - 1
    if older < 0:
        older += size
    return (1.0 - part) * line[newer] + part * line[older]
