"""Supply droop: supply pressure falls when much flow is drawn, and recovers through an accumulator."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hil.physics.effect import Effect, EffectParameter, compiled, grid


@compiled
def _drawn(flow: float, lean: float) -> float:
    """The flow demand, which may differ from direction to direction."""
    return flow * (1.0 + lean) if flow > 0.0 else -flow * (1.0 - lean)


@compiled
def transform(
    value: float, flow: float, state: Any, droop: float, power: float, line: float, lean: float, gain: float
) -> float:
    """Supply pressure less the state, which follows the loss at the flow demand with one time constant, and less what
    the line behind the accumulator takes at once.
    """
    drawn = _drawn(flow, lean)
    state[0] += (droop * drawn**power - state[0]) * gain
    return value * max(1.0 - state[0] - line * droop * drawn * drawn, 0.0)


@compiled
def settle(value: float, flow: float, state: Any, droop: float, power: float, line: float, lean: float) -> float:
    """In balance with the first flow."""
    state[0] = droop * _drawn(flow, lean) ** power
    return transform(value, flow, state, droop, power, line, lean, 0.0)


def coefficients(parameters: Mapping[str, float], step_s: float) -> dict[str, float]:
    """What the transform takes, with the share of its way that the pressure goes in a sub-step."""
    recovery = parameters["recovery"]
    gain = -math.expm1(-step_s / recovery) if recovery > 1e-6 else 1.0
    return {**{name: parameters[name] for name in ("droop", "power", "line", "lean")}, "gain": gain}


EFFECT = Effect(
    name="supply_droop",
    title="drooping supply pressure",
    hooks=("supply",),
    parameters=(
        EffectParameter("droop", "1", 0.0, 0.1, 0.0, 0.9, "share of supply pressure lost at full flow"),
        EffectParameter(
            "recovery", "s", None, 0.2, 0.05, 10.0, "time constant of pump and accumulator", telling="ends"
        ),
        EffectParameter("power", "1", None, 2.0, 0.8, 2.5, "1: internal leakage of the pump, 2: losses of the line"),
        EffectParameter("line", "1", None, 0.1, 0.0, 2.0, "loss in the line behind the accumulator, at once, over it"),
        EffectParameter("lean", "1", None, 0.0, -0.5, 0.5, "how much more one direction draws, as into one port"),
    ),
    transform=transform,
    starts=grid(droop=(0.05, 0.2, 0.5), recovery=(0.1, 0.4, 2.0)),
    memory=1,
    settle=settle,
    coefficients=coefficients,
    equation="T·dΔ/dt + Δ = d·|q/q_N|^m,  q = (1 ± e)·demand;  p_s = p_0·(1 − Δ − l·d·(q/q_N)²);  q ∝ √p_s",
    signature="gain falls at high flow on both sides; after a large step the flow sags and recovers",
    source="Merritt: Hydraulic Control Systems, 1967, ch. 11",
    sentence="The supply gives way: at full flow its pressure falls by {droop:%}.",
)
