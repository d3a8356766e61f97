"""Servo valve swept slowly without load: current in, flow out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hil.physics.plant import Hook, Parameter, Plant, Signal


def equations(current: Any, x: Any, c: Any, hook: Any) -> Any:  # noqa: ARG001  (no states)
    """One sample of a sweep so slow that nothing moves late: torque motor → spool → flow.

    The spool stands where the torque motor wants it, in mA of torque-motor current.
    """
    torque = hook.coil(current)
    opening = hook.opening(torque - c.null)
    pressure = hook.supply(c.supply, c.share * opening)
    flow = c.gain * opening * math.sqrt(max(pressure, 0.0) / c.supply)
    flow = hook.flow(flow, c.share * opening)
    reading = hook.sensor(flow)
    return reading  # noqa: RET504  (a hook's value needs a name)


def coefficients(p: Mapping[str, float], _step_s: float) -> dict[str, float]:
    """Gain and null as they are."""
    return {"gain": p["flow_gain"], "null": p["null"], "supply": p["supply_pressure"], "share": 1.0 / 25.0}


PLANT = Plant(
    name="servo-valve",
    title="servo valve without load",
    inputs=(Signal("current", "mA", 25.0),),
    output=Signal("flow", "l/min", 10.0),
    parameters=(
        Parameter("flow_gain", "l/min/mA", 0.4, -20.0, 20.0, "flow per current", hook="flow"),
        Parameter("null", "mA", 0.0, -10.0, 10.0, "current at which nothing flows", hook="opening"),
        Parameter("supply_pressure", "bar", 70.0, 1.0, 400.0, "supply pressure at no flow", fixed=True, hook="supply"),
    ),
    hooks=(
        Hook("coil", "torque motor", "mA", 25.0),
        Hook("opening", "spool", "mA", 25.0),
        Hook("supply", "supply", "bar", 70.0, extra="flow"),
        Hook("flow", "orifice", "l/min", 10.0, extra="opening"),
        Hook("sensor", "sensor", "l/min", 10.0),
    ),
    equations=equations,
    coefficients=coefficients,
    sub_step_s=1.0,
    source="Merritt: Hydraulic Control Systems, 1967, ch. 7; SAE ARP490",
)
