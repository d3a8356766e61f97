"""Dry friction of a part whose displacement is imposed: elastic at first, unequal in the two directions."""

from __future__ import annotations

import math
from typing import Any

from hil.physics.effect import Effect, EffectParameter, compiled, grid, shares
from hil.physics.effects.seal_friction import settle


@compiled
def transform(
    value: float, displacement: float, state: Any, coulomb: float, presliding: float, backwards: float
) -> float:
    """Add the friction of an imposed displacement; state: shear from −backwards to 1, displacement before.

    The step is exact for motion one way, so that it holds for samples of any distance.
    """
    step = displacement - state[1]
    state[1] = displacement
    if step != 0.0:
        slip = 1.0 if step > 0.0 else -backwards
        state[0] = slip + (state[0] - slip) * math.exp(-abs(step) / presliding)
    return value + coulomb * state[0]


EFFECT = Effect(
    name="band_friction",
    known_as="friction",
    title="dry friction of the band",
    hooks=("band",),
    parameters=(
        EffectParameter("coulomb", "{value}", 0.0, 0.3, 0.0, 3.0, "sliding friction forwards"),
        EffectParameter(
            "presliding", "{motion}", None, 0.05, 1e-4, 1.0, "travel in which most of the friction builds up"
        ),
        EffectParameter("backwards", "1", None, 1.0, 0.1, 10.0, "friction backwards over that forwards"),
    ),
    transform=transform,
    starts=grid(coulomb=shares("size", 0.5, 3.0), presliding=(0.02, 0.1, 0.3)),
    memory=2,
    settle=settle,
    equation="F = F_C·z;  dz/dx = (s − z·sgn v)/x_0,  s = 1 forwards, r backwards",
    signature="a loop of force over travel that does not depend on speed, its corners rounded after each reversal",
    source="Dahl: Solid friction damping of mechanical vibrations, AIAA J. 14(12), 1976",
    sentence="It drags with {coulomb} whichever way it moves, and gives {presliding} before it slides.",
)
