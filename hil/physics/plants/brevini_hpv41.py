"""Brevini HPV41: pressure-compensated mobile proportional valve with MHPED spool actuation."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hil.physics.effect import compiled
from hil.physics.linear import delay_steps, delayed, held_first_order
from hil.physics.plant import Hook, Parameter, Plant, Signal
from hil.physics.steps import lag_step, spring_step


@compiled
def metered(opening: float, dead_band: float, full_flow: float, exponent: float) -> float:
    """Flow curve of a spool with overlap: zero inside the dead band, a power law outside."""
    over = abs(opening) - dead_band
    if over <= 0.0:
        return 0.0
    flow = full_flow * (over / (100.0 - dead_band)) ** exponent
    return flow if opening > 0.0 else -flow


def equations(command: Any, x: Any, c: Any, hook: Any) -> Any:
    """One sub-step: command → dead time → pilot → spool → metering edge → flow meter.

    Positions and commands are in % of full stroke, flow in l/min. The command is held over the sub-step;
    from the pilot on, each linear stage is exact for an input that runs straight through the sub-step.
    """
    command = hook.command(command)
    reference = delayed(x.line, command, c.dead_steps)
    # electronics and pilot pressure: first order; each pilot reducing valve serves one side
    if reference >= 0.0:
        step = (1.0 - c.keep_pos) * (reference - x.pilot)
    else:
        step = (1.0 - c.keep_neg) * (reference - x.pilot)
    step = hook.pilot_step(step)
    x.pilot += step
    drive = hook.pilot(x.pilot)
    # spool in closed position loop: second order, with forces expressed as the change of command they equal
    if x.spool >= 0.0:
        free_position = c.xx_pos * x.spool + c.xv_pos * x.speed + c.x0_pos * x.drive + c.x1_pos * drive
        free_speed = c.vx_pos * x.spool + c.vv_pos * x.speed + c.v0_pos * x.drive + c.v1_pos * drive
        mobility = c.mobility_pos
        compliance = c.compliance_pos
    else:
        free_position = c.xx_neg * x.spool + c.xv_neg * x.speed + c.x0_neg * x.drive + c.x1_neg * drive
        free_speed = c.vx_neg * x.spool + c.vv_neg * x.speed + c.v0_neg * x.drive + c.v1_neg * drive
        mobility = c.mobility_neg
        compliance = c.compliance_neg
    x.drive = drive
    force = hook.force(free_speed, mobility)
    x.spool = free_position - compliance * force
    x.speed = free_speed - mobility * force
    spool = hook.position(x.spool)
    opening = hook.opening(spool)
    demand = metered(opening, c.dead_band, c.full_flow, c.exponent)
    pressure = hook.supply(c.supply, demand / c.full_flow)
    flow = demand * math.sqrt(max(pressure, 0.0) / c.supply)
    flow = hook.flow(flow, 0.01 * opening)
    x.meter = c.m_keep * x.meter + c.m_old * x.flow + c.m_new * flow
    x.flow = flow
    turbine = hook.turbine(x.meter)
    reading = hook.sensor(turbine)
    return reading, spool, pressure


def coefficients(p: Mapping[str, float], step_s: float) -> dict[str, float]:
    """Coefficients of one sub-step from the physical parameters."""
    found = {"dead_steps": delay_steps(p["dead_time"], step_s)}
    for side, tempo, stiff in (("pos", 1.0, 1.0), ("neg", p["pilot_ratio"], p["spool_ratio"])):
        found[f"keep_{side}"] = held_first_order(1.0 / (p["pilot_rate"] * tempo), step_s)
        found |= spring_step(p["spool_frequency"] * stiff, p["spool_damping"], step_s, f"_{side}")
    return (
        found
        | lag_step("m", p["sensor_lag"], step_s)
        | {
            "dead_band": p["dead_band"],
            "full_flow": p["full_flow"],
            "exponent": p["curve_exponent"],
            "supply": p["supply_pressure"],
        }
    )


PLANT = Plant(
    name="brevini-hpv41",
    title="Brevini HPV41 with MHPED",
    inputs=(Signal("command", "%", 100.0),),
    output=Signal("flow", "l/min", 70.0),
    observed=(Signal("spool position", "%", 100.0), Signal("supply pressure", "bar", 100.0)),
    parameters=(
        Parameter(
            "dead_time", "s", 0.02, 0.0, 0.2, "bus, electronics and pilot transport", growth="dead_time", hook="command"
        ),
        Parameter("pilot_rate", "rad/s", 7.0, 0.5, 100.0, "bandwidth of the pilot stage", hook="pilot"),
        Parameter("spool_frequency", "rad/s", 33.0, 5.0, 300.0, "natural frequency of the spool loop", hook="position"),
        Parameter("spool_damping", "1", 0.5, 0.05, 3.0, "damping ratio of the spool loop", hook="position"),
        Parameter(
            "dead_band", "%", 20.0, 0.0, 60.0, "overlap on either side of centre", growth="deadband", hook="opening"
        ),
        Parameter("full_flow", "l/min", 70.0, 5.0, 300.0, "flow at full opening", hook="flow"),
        Parameter("curve_exponent", "1", 1.2, 0.4, 4.0, "shape of the metering edge", hook="opening"),
        Parameter(
            "sensor_lag", "s", 0.008, 0.0, 0.2, "time constant of the flow meter", growth="sensor_lag", hook="sensor"
        ),
        Parameter("pilot_ratio", "1", 1.0, 0.2, 5.0, "pilot bandwidth, − side over + side", fixed=True, hook="pilot"),
        Parameter(
            "spool_ratio", "1", 1.0, 0.2, 5.0, "spool frequency, − side over + side", fixed=True, hook="position"
        ),
        Parameter("supply_pressure", "bar", 100.0, 1.0, 400.0, "supply pressure at no flow", fixed=True, hook="supply"),
    ),
    hooks=(
        Hook("command", "command", "%", 100.0),
        Hook("pilot_step", "pilot", "%", 100.0),
        Hook("pilot", "pilot", "%", 100.0),
        Hook("force", "spool", "%", 100.0, extra="mobility"),
        Hook("position", "spool", "%", 100.0),
        Hook("opening", "orifice", "%", 100.0),
        Hook("supply", "supply", "bar", 100.0, extra="flow"),
        Hook("flow", "load", "l/min", 70.0, extra="opening"),
        Hook("turbine", "sensor", "l/min", 70.0),
        Hook("sensor", "sensor", "l/min", 70.0),
    ),
    states={"pilot": 1, "drive": 1, "spool": 1, "speed": 1, "flow": 1, "meter": 1},
    lines_s={"line": "dead_time"},
    equations=equations,
    coefficients=coefficients,
    sub_step_s=0.001,
    source="Tørdal, Klausen, Bak: Experimental System Identification and Black Box Modeling of Hydraulic "
    "Directional Control Valve",
)
