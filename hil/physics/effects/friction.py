"""Friction of the moving part: Coulomb, stiction, Stribeck, and the elastic give before it breaks away."""

from __future__ import annotations

import math
from typing import Any

from hil.physics.effect import Effect, EffectParameter, Seen, compiled


@compiled
def transform(
    value: float,
    mobility: float,
    step_s: float,
    state: Any,
    coulomb: float,
    stiction: float,
    stribeck: float,
    presliding: float,
) -> float:
    """The friction force of one sub-step.

    Bristles carry the load until they slip at `presliding`; the step is implicit, so that it is stable however stiff
    they are, but for how slippery it is, which is that of the last speed: a guess from the free one would be wrong by
    all that friction takes of it. With no presliding the part stops at once and truly sticks. State: deflection, speed.
    """
    if presliding <= 0.0:
        stopping = value / mobility
        if abs(stopping) <= coulomb * stiction:
            return stopping
        sliding = coulomb * (1.0 + (stiction - 1.0) * math.exp(-((value / stribeck) ** 2)))
        if abs(stopping) <= sliding:
            return stopping
        return math.copysign(sliding, value)
    if coulomb <= 0.0:
        return 0.0
    stiffness = coulomb / presliding
    level = coulomb * (1.0 + (stiction - 1.0) * math.exp(-((state[1] / stribeck) ** 2)))
    wear = step_s * stiffness / level
    grip = mobility * stiffness
    speed = _slipping(value, value - grip * state[0], grip * step_s, wear)
    state[0] = (state[0] + step_s * speed) / (1.0 + wear * abs(speed))
    state[1] = speed
    return stiffness * state[0]


@compiled
def _slipping(free: float, drive: float, grip: float, wear: float) -> float:
    """The speed v at the end of the sub-step, of v·(1 + wear·|v| + grip) = free·(1 + wear·|v|) − (free − drive)."""
    along = free if drive >= 0.0 else -free
    linear = 1.0 + grip - wear * along
    root = math.sqrt(linear * linear + 4.0 * wear * abs(drive))
    speed = 2.0 * abs(drive) / (linear + root) if linear > 0.0 else (root - linear) / (2.0 * wear)
    return math.copysign(speed, drive)


@compiled
def settle(value: float, state: Any) -> float:
    """At rest and centred: no force yet."""
    state[:] = 0.0
    return 0.0 * value


def starts(seen: Seen) -> list[dict[str, float]]:
    """Small to large against the amplitude, stiff and softer bristles."""
    levels = [share * seen.amplitude for share in (0.03, 0.12, 0.4)]
    return [
        {"coulomb": level, "stiction": stiction, "stribeck": speed, "presliding": give * level}
        for level in levels
        for stiction in (1.1, 1.5)
        for speed in (seen.amplitude, 0.2 * seen.amplitude)
        for give in (0.003, 0.03)
    ]


EFFECT = Effect(
    name="friction",
    title="friction with sticking",
    hooks=("force",),
    parameters=(
        EffectParameter("coulomb", "{value}", 0.0, 0.02, 0.0, 0.2, "Coulomb friction, as the equivalent command"),
        EffectParameter("stiction", "1", None, 1.2, 1.0, 3.0, "static over sliding friction"),
        EffectParameter("stribeck", "{motion}/s", None, 0.1, 0.005, 5.0, "speed at which stiction has faded"),
        EffectParameter(
            "presliding", "{motion}", None, 0.002, 1e-5, 0.03, "elastic give before it breaks away", telling="upper end"
        ),
    ),
    transform=transform,
    starts=starts,
    memory=2,
    settle=settle,
    equation="ż = v − |v|·z/z_s(v);  F = (F_C/z_0)·z;  F_ss = F_C·(1 + (r − 1)·exp(−(v/v_s)²))·sgn v",
    signature="phase lag that stays as frequency falls, odd harmonics, residual at reversals of motion; "
    "small amplitudes look slower",
    source="Canudas de Wit et al., IEEE TAC 40(3), 1995; Armstrong-Hélouvry et al., Automatica 30(7), 1994",
    sentence="The moving part sticks: {coulomb} of command is needed before it moves again after a reversal.",
    multimodal=True,
)
