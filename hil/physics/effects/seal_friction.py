"""Seal friction: grows with the pressure that presses the lip on, and gives elastically before it slides."""

from __future__ import annotations

import math
from typing import Any

from hil.physics.effect import Effect, EffectParameter, Seen, compiled


@compiled
def transform(value: float, displacement: float, state: Any, share: float, constant: float, presliding: float) -> float:
    """Add the friction of an imposed displacement; state: shear of the lip from −1 to 1, displacement before.

    The step is exact for motion one way, so that it holds for samples of any distance.
    """
    step = displacement - state[1]
    state[1] = displacement
    slip = math.copysign(1.0, step)
    state[0] = slip + (state[0] - slip) * math.exp(-abs(step) / presliding)
    return value + (constant + share * abs(value)) * state[0]


@compiled
def settle(value: float, displacement: float, state: Any) -> float:
    """Relaxed at the first displacement."""
    state[0] = 0.0
    state[1] = displacement
    return value


def starts(seen: Seen) -> list[dict[str, float]]:
    """Pressed or plain, stiff and soft lips."""
    return [
        {"share": share, "constant": constant * seen.size, "presliding": give}
        for share, constant in ((0.03, 0.0), (0.01, 0.01), (0.002, 0.02))
        for give in (0.1, 0.5, 2.0)
    ]


EFFECT = Effect(
    name="seal_friction",
    title="friction of the seal",
    hooks=("seal",),
    parameters=(
        EffectParameter("share", "1", 0.0, 0.02, 0.0, 0.5, "friction over the force of the pressure"),
        EffectParameter("constant", "{value}", 0.0, 0.005, 0.0, 0.5, "friction without pressure"),
        EffectParameter("presliding", "mm", None, 0.5, 0.005, 10.0, "travel in which most of the friction builds up"),
    ),
    transform=transform,
    starts=starts,
    memory=2,
    settle=settle,
    equation="F = (F_0 + μ·A·p)·z;  dz/dx = (1 − z·sgn v)/x_0",
    signature="a loop of force over travel that opens with pressure, its corners rounded after each reversal",
    source="Dahl: Solid friction damping of mechanical vibrations, AIAA J. 14(12), 1976",
    sentence="The seal drags with {share:%} of the pressure force and {constant} without pressure.",
)
