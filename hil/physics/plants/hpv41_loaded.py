"""Brevini HPV41 under commanded supply, load, tank pressure and oil: compensator, leakage and flow force."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from hil.physics.effect import compiled
from hil.physics.linear import delay_steps, delayed, held_first_order
from hil.physics.plant import Parameter, Signal
from hil.physics.plants import brevini_hpv41, four_way_valve
from hil.physics.plants.brevini_hpv41 import metered
from hil.physics.plants.four_way_valve import warmer
from hil.physics.steps import lag_step, spring_step

OF = brevini_hpv41.PLANT
LAB = four_way_valve.PLANT
_NOT_HERE = ("pilot_ratio", "spool_ratio", "supply_pressure")
_FROM_LAB = (
    "null",
    "null_supply",
    "null_tank",
    "null_temperature",
    "line_lag",
    "thinning",
    "load_flow",
    "rated_supply",
)
_RATED_LOAD_BAR = 35.0  # pressure drop at which the flow of the load orifice is stated
_LINE_TO_LINE = 1e-9  # %, a dead band that is none
_CLOSED = 1e-4  # l/min at 1 bar: less is a load orifice that is shut


@compiled
def covered(opening: float, dead_band: float) -> float:
    """Share of the supply between blocked ports: laminar gaps leak in inverse proportion to what covers them."""
    return min(max(opening / max(dead_band, _LINE_TO_LINE), -1.0), 1.0)


@compiled
def leaking(opening: float, dead_band: float) -> float:
    """Leakage from P to T over that in the middle: a side that has opened leaks through the gap that still covers."""
    return 2.0 * dead_band / (dead_band + max(abs(opening), dead_band, _LINE_TO_LINE))


def equations(command: Any, supply: Any, load: Any, tank: Any, temperature: Any, x: Any, c: Any, hook: Any) -> Any:
    """One sub-step: command → dead time → pilot → spool → compensator, edge and load → flow meter.

    As `brevini-hpv41`, but for what its page takes as given: the compensator keeps `margin` over the edge for as long
    as supply and load leave it that, with a lag of its own; a load pressure pushes the spool back by `give`.
    """
    command = hook.command(command)
    x.supply += c.line_step * (supply - x.supply)
    x.tank += c.line_step * (tank - x.tank)
    x.load += c.line_step * (max(load, 0.0) - x.load)
    reference = delayed(x.line, command, c.dead_steps)
    thin = math.exp(c.thinning * warmer(temperature))  # warm oil is thin: the pilot fills faster, gaps leak more
    step = (1.0 - math.exp(-c.pilot_step * thin)) * (reference - x.pilot)
    step = hook.pilot_step(step)
    x.pilot += step
    drive = hook.pilot(x.pilot)
    drive = drive - c.give * x.across
    free_position = c.xx * x.spool + c.xv * x.speed + c.x0 * x.drive + c.x1 * drive
    free_speed = c.vx * x.spool + c.vv * x.speed + c.v0 * x.drive + c.v1 * drive
    x.drive = drive
    force = hook.force(free_speed, c.mobility)
    x.spool = free_position - c.compliance * force
    x.speed = free_speed - c.mobility * force
    spool = hook.position(x.spool)
    null = c.null + c.null_supply * (x.supply / c.rated - 1.0) + c.null_tank * x.tank / c.rated
    opening = hook.opening(spool - null - c.null_warm * warmer(temperature))
    demand = metered(opening, c.dead_band, c.full_flow, c.exponent)
    pressure = hook.supply(x.supply, demand / c.full_flow)
    drop = max(pressure - x.tank, 0.0)
    throttle = c.load_gain * x.load
    size = 0.0
    if throttle > c.closed:
        # what the compensator takes comes late; the rest lies over edge and load in series
        spare = max(drop - c.margin - (demand / throttle) ** 2, 0.0)
        x.taken = c.t_keep * x.taken + c.t_old * x.spare + c.t_new * spare
        x.spare = spare
        if demand != 0.0:
            series = 1.0 / throttle**2 + c.margin / demand**2
            size = math.sqrt(max(drop - x.taken, 0.0) / series)
        across = (size / throttle) ** 2 if demand >= 0.0 else -((size / throttle) ** 2)
    else:
        x.taken = 0.0
        x.spare = 0.0
        across = drop * covered(opening, c.dead_band)
    x.across = across
    flow = size if demand >= 0.0 else -size
    flow = hook.flow(flow, 0.01 * opening)
    returned = abs(flow) + c.leak * drop * thin * leaking(opening, c.dead_band)
    x.meter = c.m_keep * x.meter + c.m_old * x.flow + c.m_new * flow
    x.flow = flow
    turbine = hook.turbine(x.meter)
    reading = hook.sensor(turbine)
    return reading, spool, across, returned, pressure, x.tank


def coefficients(p: Mapping[str, float], step_s: float) -> dict[str, float]:
    """Coefficients of one sub-step from the physical parameters."""
    return {
        **spring_step(p["spool_frequency"], p["spool_damping"], step_s),
        **lag_step("m", p["sensor_lag"], step_s),
        **lag_step("t", p["compensator_lag"], step_s),
        "dead_steps": delay_steps(p["dead_time"], step_s),
        "pilot_step": min(step_s * p["pilot_rate"], 1e15),
        "line_step": 1.0 - held_first_order(p["line_lag"], step_s),
        "dead_band": p["dead_band"],
        "full_flow": p["full_flow"],
        "exponent": p["curve_exponent"],
        "margin": p["margin"],
        "give": 0.01 * p["give"],
        "leak": 0.01 * p["leakage"],
        "load_gain": 0.01 * p["load_flow"] / math.sqrt(_RATED_LOAD_BAR),
        "closed": _CLOSED,
        "null": p["null"],
        "null_supply": 10.0 * p["null_supply"],
        "null_tank": 10.0 * p["null_tank"],
        "null_warm": p["null_temperature"] / 40.0,
        "thinning": p["thinning"],
        "rated": p["rated_supply"],
    }


PLANT = replace(
    OF,
    name="hpv41-loaded",
    title="Brevini HPV41 with MHPED under commanded pressures and load",
    inputs=(OF.inputs[0], *LAB.inputs[1:]),
    observed=(
        OF.observed[0],
        Signal("load pressure", "bar", 210.0),
        Signal("return flow", "l/min", 70.0),
        Signal("supply pressure", "bar", 210.0),
        Signal("tank pressure", "bar", 20.0),
    ),
    parameters=(
        *(one for one in OF.parameters if one.name not in _NOT_HERE),
        Parameter(
            "margin", "bar", 7.0, 1.0, 30.0, "pressure drop that the compensator keeps over the edge", hook="flow"
        ),
        Parameter(
            "compensator_lag", "s", 0.03, 0.001, 0.5, "time constant of the compensator", fixed=True, hook="flow"
        ),
        Parameter(
            "give", "%", 0.0, 0.0, 10.0, "way of the spool under 100 bar of load pressure", fixed=True, hook="position"
        ),
        Parameter("leakage", "l/min", 0.2, 0.0, 5.0, "from P to T at 100 bar, spool in its middle", hook="flow"),
        *(one for one in LAB.parameters if one.name in _FROM_LAB),
    ),
    states={**OF.states, **dict.fromkeys(("supply", "tank", "load", "taken", "spare", "across"), 1)},
    equations=equations,
    coefficients=coefficients,
    source=OF.source + "; Merritt: Hydraulic Control Systems, 1967, ch. 5 (compensator, laminar gaps)",
)
