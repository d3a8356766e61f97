"""Coil lag: inductance and eddy currents delay the force behind the command."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hil.physics.effect import Effect, EffectParameter, Seen, Start, at_rest, compiled
from hil.physics.effects.sensor_lag import EFFECT as SENSOR_LAG
from hil.physics.effects.sensor_lag import second_order_shape
from hil.physics.linear import free_motion, held_first_order


@compiled
def transform(
    value: float, state: Any, full_scale: float,
    xx: float, xv: float, vx: float, vv: float, direct: float, saturating: float,
) -> float:  # fmt: skip
    """A lag of first or second order, past which a part goes at once: the more of it, the more the iron saturates.

    The free motion from where force and its speed are towards a value that is held over the sub-step, as commands are.
    """
    away, speed = state[0] - value, state[1]
    state[0] = value + xx * away + xv * speed
    state[1] = vx * away + vv * speed
    share = state[0] / full_scale
    return state[0] + min(direct + saturating * share * share, 1.0) * (value - state[0])


def coefficients(parameters: Mapping[str, float], step_s: float) -> dict[str, float]:
    """The free motion over one sub-step, and the shares that pass."""
    given = {name: parameters[name] for name in ("direct", "saturating")}
    names = ("xx", "xv", "vx", "vv")
    shape = second_order_shape(parameters)
    if shape is None:
        return given | dict.fromkeys(names, 0.0) | {"xx": held_first_order(parameters["lag"], step_s)}
    frequency, damping = shape
    return given | dict(zip(names, free_motion(frequency, damping * frequency, step_s), strict=True))


def starts(seen: Seen) -> list[Start]:
    """As for a sensor, and one with a part that goes at once."""
    return [*SENSOR_LAG.starts(seen), {"lag": 0.05, "second": 0.0, "direct": 0.1}]


EFFECT = Effect(
    name="coil_lag",
    title="lag of the coil",
    hooks=("command", "coil", "pilot"),
    parameters=(
        EffectParameter("lag", "s", 0.0, 0.02, 0.0, 0.5, "time constant L/R, with that of eddy currents"),
        EffectParameter("second", "1", None, 0.0, 0.0, 1.0, "0: inductance alone, 1: eddy currents as slow as it"),
        EffectParameter("direct", "1", None, 0.0, 0.0, 0.5, "share that eddy currents let pass at once"),
        EffectParameter("saturating", "1", None, 0.1, 0.0, 4.0, "share more of it at full scale: inductance falls"),
    ),
    transform=transform,
    starts=starts,
    memory=2,
    settle=at_rest,
    coefficients=coefficients,
    equation="F = (e + k·(F₂/U)²)·F(i) + (1 − e − k·(F₂/U)²)·F₂, (r·T²/4·s² + T·s + 1)·F₂ = F(i)",
    signature="phase and gain fall with frequency before the metering edge, no distortion of its own",
    source="Facts: V = R·i + L·di/dt; Kallenbach et al.: Elektromagnete, 2012",
    sentence="The magnet builds up its force late: time constant {lag}.",
)
