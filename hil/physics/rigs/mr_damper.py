"""Magneto-rheological damper on a shaker: velocity is imposed, force is measured, the magnet's current is held."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hil.physics.plant import Hook, Parameter, Plant, Signal


def equations(velocity: Any, x: Any, c: Any, hook: Any) -> Any:
    """One sub-step: oil through the gap, the gas spring, what yields in the magnetic field, and the load cell."""
    flow = hook.opening(velocity)
    x.travel += c.step * velocity
    force = c.viscous * flow + c.spring * x.travel
    force = hook.field(force, velocity)
    reading = hook.sensor(force + c.zero)
    return reading  # noqa: RET504  (a hook's value needs a name)


def coefficients(p: Mapping[str, float], step_s: float) -> dict[str, float]:
    """Coefficients of one sub-step."""
    return {
        "viscous": p["viscous"],
        "spring": p["spring"],
        "zero": p["zero"],
        "step": 0.0 if math.isinf(step_s) else step_s,
    }


PLANT = Plant(
    name="mr-damper",
    title="magneto-rheological damper under test",
    inputs=(Signal("velocity", "cm/s", 15.0),),
    output=Signal("force", "N", 80.0),
    parameters=(
        Parameter("viscous", "N*s/cm", 5.0, -1e3, 1e3, "force per speed, with the signs of the bench", hook="opening"),
        Parameter("spring", "N/cm", 0.0, -100.0, 1e3, "force of the gas per travel", hook="field"),
        Parameter("zero", "N", 0.0, -100.0, 100.0, "force at rest: gas, zero of the load cell", hook="sensor"),
    ),
    hooks=(
        Hook("opening", "gap", "cm/s", 15.0),
        Hook("field", "magnetic field", "N", 80.0, extra="velocity", motion_unit="cm", motion_scale=1.0),
        Hook("sensor", "load cell", "N", 80.0),
    ),
    states={"travel": 1},
    equations=equations,
    coefficients=coefficients,
    sub_step_s=0.005,
    source="Spencer, Dyke, Sain, Carlson: Phenomenological model for magnetorheological dampers, "
    "J. Eng. Mech. 123(3), 1997",
)
