"""Electro-hydraulic actuator: a motor turns a pump, the pump moves a differential cylinder; pressures are measured."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hil.physics.plant import Hook, Parameter, Plant, Signal


def equations(motor_speed: Any, pressure_a: Any, pressure_b: Any, x: Any, c: Any, hook: Any) -> Any:
    """One sub-step: motor speed → pump flow → piston. Flows are counted in mm/s of extension.

    What the pump delivers into the smaller, rod-side chamber moves the piston faster.
    """
    velocity = c.extend * motor_speed
    if motor_speed < 0.0:
        velocity = c.retract * motor_speed
    velocity = hook.chamber(velocity, pressure_a - pressure_b)
    x.place += c.step * velocity
    x.place = hook.load(x.place)
    reading = hook.sensor(x.place)
    return reading, velocity


def coefficients(p: Mapping[str, float], step_s: float) -> dict[str, float]:
    """Coefficients of one sub-step; before the first sample the piston rests."""
    extend = p["travel_per_turn"] / 60.0
    return {
        "extend": extend,
        "retract": extend * p["area_ratio"],
        "step": 0.0 if math.isinf(step_s) else step_s,
    }


def initial(_p: Mapping[str, float], _inputs: tuple[float, ...], output: float) -> dict[str, float]:
    """The piston stands where the first reading says."""
    return {"place": 0.0 if math.isnan(output) else output}


PLANT = Plant(
    name="electro-hydraulic-actuator",
    title="electro-hydraulic actuator",
    inputs=(Signal("motor speed", "rpm", 2000.0), Signal("pressure A", "bar", 50.0), Signal("pressure B", "bar", 50.0)),
    output=Signal("position", "mm", 50.0),
    observed=(Signal("velocity", "mm/s", 25.0),),
    parameters=(
        Parameter(
            "travel_per_turn",
            "mm",
            0.7,
            0.001,
            100.0,
            "extension per turn: displacement over piston area",
            hook="chamber",
        ),
        Parameter(
            "area_ratio", "1", 1.4, 0.2, 5.0, "retraction over extension per turn", change="asymmetry", hook="chamber"
        ),
    ),
    hooks=(
        Hook("chamber", "chambers", "mm/s", 25.0, extra="pressure", motion_unit="mm", motion_scale=25.0),
        Hook("load", "piston", "mm", 50.0),
        Hook("sensor", "sensor", "mm", 50.0),
    ),
    states={"place": 1},
    equations=equations,
    coefficients=coefficients,
    sub_step_s=0.01,
    initial=initial,
    source="Merritt: Hydraulic Control Systems, 1967, ch. 6",
)
