"""Servo axis: a carriage on a ball screw in a closed position loop; the force of its drive is recorded."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hil.physics.linear import braked_mass
from hil.physics.plant import Hook, Parameter, Plant, Signal


def equations(reference: Any, x: Any, c: Any, hook: Any) -> Any:
    """One sub-step: position error → speed error → drive voltage → force → m·ẍ + b·ẋ = F, exact for a held force.

    The controller works at its own clock and holds the voltage in between.
    """
    if x.due <= 0.5 * c.step:
        voltage = c.speed_gain * (c.position_gain * (reference - x.place) - x.speed)
        x.voltage = min(max(voltage, -c.limit), c.limit)
        x.due += c.period
    x.due -= c.step
    force = hook.coil(c.motor * x.voltage)
    reading = hook.sensor(force)
    free_speed = c.keep * x.speed + c.mobility * force
    dragging = hook.drag(free_speed)
    more_drag = c.viscous * (dragging - free_speed)
    friction = hook.force(free_speed - c.mobility * more_drag, c.mobility)
    opposing = more_drag + friction
    net = force - opposing
    x.place += c.travel * x.speed + c.compliance * net
    x.speed = free_speed - c.mobility * opposing
    x.place = hook.position(x.place)
    return reading, x.place


def coefficients(p: Mapping[str, float], step_s: float) -> dict[str, float]:
    """Coefficients of one sub-step; at rest before the first sample."""
    keep, mobility, travel, compliance = braked_mass(p["mass"], p["viscous"], step_s)
    settled = math.isinf(step_s)
    return {
        "speed_gain": p["speed_gain"],
        "position_gain": p["position_gain"],
        "limit": p["voltage_limit"],
        "motor": p["motor_gain"],
        "viscous": p["viscous"],
        "step": 0.0 if settled else step_s,
        "period": 0.0 if settled else p["controller_period"],
        "keep": keep,
        "mobility": mobility,
        "travel": travel,
        "compliance": compliance,
    }


def initial(p: Mapping[str, float], inputs: tuple[float, ...], output: float) -> dict[str, float]:
    """The carriage stands where the controller asks for the first force; without a reading, at the reference."""
    error = 0.0 if math.isnan(output) else output / (p["motor_gain"] * p["speed_gain"] * p["position_gain"])
    return {"place": inputs[0] - error}


PLANT = Plant(
    name="servo-axis",
    title="axis in a position loop",
    inputs=(Signal("position reference", "m", 0.25),),
    output=Signal("force", "N", 500.0),
    observed=(Signal("carriage position", "m", 0.25),),
    parameters=(
        Parameter("mass", "kg", 100.0, 0.1, 1e5, "moved mass, motor and screw included", hook="force"),
        Parameter("viscous", "N*s/m", 200.0, 0.0, 1e6, "viscous friction of guide and screw", hook="force"),
        Parameter(
            "position_gain", "1/s", 160.18, 0.1, 1e5, "speed asked for per position error", fixed=True, hook="coil"
        ),
        Parameter("speed_gain", "V*s/m", 243.45, 0.1, 1e6, "voltage per speed error", fixed=True, hook="coil"),
        Parameter("motor_gain", "N/V", 35.1507, 0.01, 1e5, "force per drive voltage", fixed=True, hook="coil"),
        Parameter(
            "controller_period",
            "s",
            0.001,
            1e-5,
            1.0,
            "time between two updates of the controller",
            fixed=True,
            hook="coil",
        ),
        Parameter("voltage_limit", "V", 10.0, 0.1, 1e3, "largest drive voltage", fixed=True, hook="coil"),
    ),
    hooks=(
        Hook("coil", "drive", "N", 350.0),
        Hook("force", "guide", "N", 500.0, extra="mobility", motion_unit="m", motion_scale=0.25),
        Hook("drag", "guide", "m/s", 0.2),
        Hook("position", "screw", "m", 0.25),
        Hook("sensor", "sensor", "N", 500.0),
    ),
    states={"speed": 1, "place": 1, "voltage": 1, "due": 1},
    equations=equations,
    coefficients=coefficients,
    sub_step_s=0.001,
    initial=initial,
    source="Janot, Gautier, Brunot: Data Set and Reference Models of EMPS, nonlinearbenchmark.org 2019",
)
