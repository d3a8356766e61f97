"""Sticking stem of a control valve: it stays while the controller moves, and jumps when it breaks loose."""

from __future__ import annotations

from typing import Any

from hil.physics.effect import Effect, EffectParameter, compiled, grid, shares


@compiled
def transform(value: float, state: Any, band: float, jump: float) -> float:
    """The stem breaks loose `band` away from where the spring would have it, and stops at that less `jump`.

    State: the place of the stem. One sample's motion is a jump or a slip, so that steps of any length hold.
    """
    away = value - state[0]
    if away > band:
        state[0] = value - band * (1.0 - jump)
    elif away < -band:
        state[0] = value + band * (1.0 - jump)
    return state[0]


EFFECT = Effect(
    name="stem_friction",
    known_as="friction",
    title="sticking stem",
    hooks=("stem",),
    parameters=(
        EffectParameter("band", "{value}", 0.0, 0.005, 0.0, 0.2, "half of the band in which the stem sticks"),
        EffectParameter("jump", "1", None, 0.5, 0.0, 1.0, "share of that band by which it jumps when it breaks loose"),
    ),
    transform=transform,
    starts=grid(band=shares("amplitude", 0.05, 0.2, 0.5), jump=(0.2, 0.9)),
    memory=1,
    equation="x stays while |u − x| ≤ S, then goes to u ∓ S·(1 − j)",
    signature="the process value steps while the controller output ramps; the loop cycles by itself",
    source="He, Wang, Pottmann, Qin: A curve fitting method for detecting valve stiction, "
    "Ind. Eng. Chem. Res. 46(13), 2007",
    sentence="The stem sticks: the controller must move by {band} before it breaks loose.",
    multimodal=True,
)
