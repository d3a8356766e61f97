"""Friction of the moving part: Coulomb, stiction, Stribeck, and the elastic give before it breaks away."""

from __future__ import annotations

import math
from typing import Any

from hil.physics.effect import Effect, EffectParameter, Seen, compiled

_ITERATIONS = 6


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

    Bristles (state: their deflection) carry the load until they slip at `presliding`; the step is implicit, so
    that it is stable however stiff they are. With no presliding the part stops at once and truly sticks.
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
    speed, deflection = value, state[0]
    for _ in range(6):
        level = coulomb * (1.0 + (stiction - 1.0) * math.exp(-((speed / stribeck) ** 2)))
        slip = 1.0 + step_s * stiffness * abs(speed) / level
        # linear in the speed but for the slip: v = v_free - mobility * stiffness * (z + h*v) / slip
        share = mobility * stiffness / slip
        speed = (value - share * state[0]) / (1.0 + share * step_s)
        deflection = (state[0] + step_s * speed) / slip
    state[0] = deflection
    return stiffness * deflection


@compiled
def settle(value: float, state: Any) -> float:
    """At rest and centred: no force yet."""
    state[0] = 0.0
    return 0.0 * value


def starts(seen: Seen) -> list[dict[str, float]]:
    """Small to large against the swing, stiff and softer bristles."""
    levels = [share * seen.swing for share in (0.03, 0.12, 0.4)]
    return [
        {"coulomb": level, "stiction": stiction, "stribeck": speed, "presliding": give * level}
        for level in levels
        for stiction in (1.1, 1.5)
        for speed in (seen.swing, 0.2 * seen.swing)
        for give in (0.003, 0.03)
    ]


EFFECT = Effect(
    name="friction",
    title="friction with sticking",
    hooks=("force",),
    parameters=(
        EffectParameter("coulomb", "{value}", 0.0, 0.02, 0.0, 0.2, "sliding friction as the command it withstands"),
        EffectParameter("stiction", "1", None, 1.2, 1.0, 3.0, "static over sliding friction"),
        EffectParameter("stribeck", "{motion}/s", None, 0.1, 0.005, 5.0, "speed at which stiction has faded"),
        EffectParameter("presliding", "{motion}", None, 0.002, 1e-5, 0.05, "elastic give before it breaks away"),
    ),
    transform=transform,
    starts=starts,
    memory=lambda _parameters, _step_s: 1,
    settle=settle,
    equation="ż = v − |v|·z/z_s(v);  F = (F_C/z_0)·z;  F_ss = F_C·(1 + (r − 1)·exp(−(v/v_s)²))·sgn v",
    signature="phase lag that stays as frequency falls, odd harmonics, residual at reversals of motion; "
    "small amplitudes look slower",
    source="Canudas de Wit et al., IEEE TAC 40(3), 1995; Armstrong-Hélouvry et al., Automatica 30(7), 1994",
    sentence="The moving part sticks: {coulomb} of command is needed before it moves again after a reversal.",
)
