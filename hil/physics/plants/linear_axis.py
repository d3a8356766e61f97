"""Linear axis: a mass on a guide, driven by a force, its position measured."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hil.physics.linear import braked_mass, delay_steps, delayed
from hil.physics.plant import Hook, Parameter, Plant, Signal
from hil.physics.stop import speed_after

# Slower than anything that an axis is driven with, faster than a force needs to carry it out of its stroke.
_OBSERVER_RAD_S = 2.0


def equations(force: Any, x: Any, c: Any, hook: Any) -> Any:
    """One sub-step of m·ẍ + b·ẋ = F, exact for a held force."""
    force = hook.command(force)
    force = delayed(x.line, force, c.dead_steps)
    force = hook.coil(force)
    free_speed = c.keep * x.speed + c.mobility * force
    dragging = hook.drag(free_speed)
    more_drag = c.viscous * (dragging - free_speed)
    friction = hook.force(free_speed - c.mobility * more_drag, c.mobility)
    opposing = more_drag + friction
    net = force - opposing
    before = x.place
    x.place += c.travel * x.speed + c.compliance * net
    x.speed = free_speed - c.mobility * opposing
    reached = hook.load(x.place)
    x.speed = speed_after(x.speed, x.place, before, reached)
    x.place = reached
    reading = hook.sensor(x.place)
    return reading, x.speed


def coefficients(p: Mapping[str, float], step_s: float) -> dict[str, float]:
    """Coefficients of one sub-step; at rest before the first sample."""
    keep, mobility, travel, compliance = braked_mass(p["mass"], p["viscous"], step_s)
    return {
        "dead_steps": delay_steps(p["dead_time"], step_s),
        "viscous": p["viscous"],
        "keep": keep,
        "mobility": mobility,
        "travel": travel,
        "compliance": compliance,
    }


def initial(_p: Mapping[str, float], _inputs: tuple[float, ...], output: float) -> dict[str, float]:
    """The carriage stands where the first reading says."""
    return {"place": 0.0 if math.isnan(output) else output}


def observer(_p: Mapping[str, float], interval_s: float) -> dict[str, float]:
    """Luenberger's, with two equal poles."""
    return {"place": 2.0 * _OBSERVER_RAD_S * interval_s, "speed": _OBSERVER_RAD_S**2 * interval_s}


PLANT = Plant(
    name="linear-axis",
    title="linear axis",
    inputs=(Signal("force", "N", 500.0),),
    output=Signal("position", "m", 0.25),
    observed=(Signal("velocity", "m/s", 0.2),),
    parameters=(
        Parameter("mass", "kg", 100.0, 0.1, 1e5, "moved mass", hook="force"),
        Parameter("viscous", "N*s/m", 200.0, 0.0, 1e6, "viscous friction of the guide", hook="force"),
        Parameter(
            "dead_time", "s", 0.001, 0.0, 0.1, "drive and transport", fixed=True, growth="dead_time", hook="command"
        ),
    ),
    hooks=(
        Hook("command", "command", "N", 500.0),
        Hook("coil", "drive", "N", 500.0),
        Hook("force", "guide", "N", 500.0, extra="mobility", motion_unit="m", motion_scale=0.25),
        Hook("drag", "guide", "m/s", 0.2),
        Hook("load", "carriage", "m", 0.25),
        Hook("sensor", "sensor", "m", 0.25),
    ),
    states={"speed": 1, "place": 1},
    lines_s={"line": "dead_time"},
    equations=equations,
    coefficients=coefficients,
    sub_step_s=0.001,
    initial=initial,
    observer=observer,
    source="Janot, Gautier, Brunot: Data Set and Reference Models of EMPS, nonlinearbenchmark.org 2019",
)
