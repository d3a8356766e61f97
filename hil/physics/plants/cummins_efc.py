"""Cummins EFC: rotary electronic fuel-control valve, coil current in, rail pressure out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hil.physics.effect import compiled
from hil.physics.linear import delay_steps, delayed, held_first_order
from hil.physics.plant import Hook, Parameter, Plant, Signal
from hil.physics.steps import lag_step, spring_step
from hil.physics.stop import speed_after


@compiled
def throttled(current: float, centre: float, width: float) -> float:
    """Share of the pressure span that the rotary orifice lets through: closed at 0, open at 1."""
    return 1.0 / (1.0 + math.exp(-(current - centre) / width))


def equations(current: Any, x: Any, c: Any, hook: Any) -> Any:
    """One sub-step: current → coil → rotor → orifice → rail pressure sensor.

    The rotor's angle is expressed as the current that would hold it there, pressure in psi.
    """
    current = hook.command(current)
    reference = delayed(x.line, current, c.dead_steps)
    step = hook.coil_step((1.0 - c.coil_keep) * (reference - x.coil))
    x.coil += step
    torque = hook.coil(x.coil)
    # rotor on its spring: second order, friction as the change of current it withstands
    free_angle = c.xx * x.angle + c.xv * x.speed + c.x0 * x.torque + c.x1 * torque
    free_speed = c.vx * x.angle + c.vv * x.speed + c.v0 * x.torque + c.v1 * torque
    x.torque = torque
    friction = hook.force(free_speed, c.mobility)
    before = x.angle
    x.angle = free_angle - c.compliance * friction
    x.speed = free_speed - c.mobility * friction
    reached = hook.stop(x.angle)
    x.speed = speed_after(x.speed, x.angle, before, reached)
    x.angle = reached
    angle = hook.position(x.angle)
    opening = hook.opening(angle)
    share = throttled(opening, c.centre, c.width)
    supply = hook.supply(c.supply, share)
    pressure = c.closed_pressure + c.span * share * (supply / c.supply)
    pressure = hook.flow(pressure, share)
    x.meter = c.m_keep * x.meter + c.m_old * x.pressure + c.m_new * pressure
    x.pressure = pressure
    reading = hook.sensor(x.meter)
    return reading, angle, supply


def coefficients(p: Mapping[str, float], step_s: float) -> dict[str, float]:
    """Coefficients of one sub-step from the physical parameters."""
    rotor = spring_step(p["rotor_frequency"], p["rotor_damping"], step_s)
    return (
        rotor
        | lag_step("m", p["sensor_lag"], step_s)
        | {
            "dead_steps": delay_steps(p["dead_time"], step_s),
            "coil_keep": held_first_order(p["coil_lag"], step_s),
            "centre": p["curve_centre"],
            "width": p["curve_width"],
            "span": p["pressure_span"],
            "closed_pressure": p["closed_pressure"],
            "supply": p["supply_pressure"],
        }
    )


PLANT = Plant(
    name="cummins-efc",
    title="Cummins EFC fuel-control valve",
    inputs=(Signal("current", "A", 1.0),),
    output=Signal("pressure", "psi", 200.0),
    observed=(Signal("rotor position", "A", 1.0), Signal("supply pressure", "psi", 220.0)),
    parameters=(
        Parameter("dead_time", "s", 0.002, 0.0, 0.2, "electronics and transport", growth="dead_time", hook="command"),
        Parameter(
            "coil_lag",
            "s",
            0.016,
            0.0,
            0.3,
            "force behind current: eddy currents, drive",
            growth="coil_lag",
            hook="coil",
        ),
        Parameter(
            "rotor_frequency", "rad/s", 48.0, 3.0, 500.0, "natural frequency of rotor on spring", hook="position"
        ),
        Parameter("rotor_damping", "1", 0.5, 0.05, 5.0, "damping ratio of the rotor", hook="position"),
        Parameter("curve_centre", "A", 1.58, 0.2, 4.0, "current at half pressure", hook="opening", drift=0.002),
        Parameter("curve_width", "A", 0.1, 0.005, 1.0, "width of the orifice's transition", hook="opening"),
        Parameter("pressure_span", "psi", 207.0, 10.0, 400.0, "pressure between closed and open", hook="flow"),
        Parameter(
            "closed_pressure", "psi", 3.0, -20.0, 60.0, "pressure with the valve closed", growth="leakage", hook="flow"
        ),
        Parameter(
            "sensor_lag",
            "s",
            0.004,
            0.0,
            0.2,
            "time constant of the pressure sensor",
            growth="sensor_lag",
            hook="sensor",
        ),
        Parameter(
            "supply_pressure", "psi", 220.0, 10.0, 400.0, "supply pressure at no flow", fixed=True, hook="supply"
        ),
    ),
    hooks=(
        Hook("command", "command", "A", 1.0),
        Hook("coil_step", "coil", "A", 1.0),
        Hook("coil", "coil", "A", 1.0),
        Hook("force", "rotor", "A", 1.0, extra="mobility"),
        Hook("stop", "rotor", "A", 1.0),
        Hook("position", "rotor", "A", 1.0),
        Hook("opening", "orifice", "A", 1.0),
        Hook("supply", "supply", "psi", 220.0, extra="flow"),
        Hook("flow", "load", "psi", 200.0, extra="opening"),
        Hook("sensor", "sensor", "psi", 200.0),
    ),
    states={"coil": 1, "torque": 1, "angle": 1, "speed": 1, "pressure": 1, "meter": 1},
    lines_s={"line": "dead_time"},
    equations=equations,
    coefficients=coefficients,
    sub_step_s=0.001,
    source="Tugsal: Fault diagnosis of electronic fuel control (EFC) valves via dynamic performance test "
    "method, Purdue 2009",
)
