"""HydraForce SP08-47C cartridge valve with differential cylinder and LVDT, in a closed position loop."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hil.physics.linear import delay_steps, delayed
from hil.physics.plant import Hook, Parameter, Plant, Signal
from hil.physics.steps import lag_step, spring_step


def equations(request: Any, x: Any, c: Any, hook: Any) -> Any:
    """One sub-step: request → controller → spool → metering edges → cylinder → LVDT, fed back.

    Valve command and opening are in % of full stroke, position in mm. The controller sees the reading as it
    stands in the middle of the sub-step, which makes the loop accurate to second order; the recorder reads
    beside the loop.
    """
    request = hook.command(request)
    error = request - (1.5 * x.reading - 0.5 * x.earlier)
    command = min(max(c.loop_gain * error, -100.0), 100.0)
    command = hook.coil(command)
    drive = delayed(x.line, command, c.dead_steps)
    free_position = c.xx * x.spool + c.xv * x.speed + c.compliance * drive
    free_speed = c.vx * x.spool + c.vv * x.speed + c.mobility * drive
    force = hook.force(free_speed, c.mobility)
    x.spool = free_position - c.compliance * force
    x.speed = free_speed - c.mobility * force
    opening = hook.opening(x.spool)
    share = 0.01 * opening
    supply = hook.supply(c.supply, share)
    load = hook.load_pressure(0.0, 0.008 * x.cylinder)
    velocity = share * math.sqrt(max(supply - (load if share > 0.0 else -load), 0.0) / c.supply)
    if velocity > 0.0:
        velocity = velocity * c.extend
    else:
        velocity = velocity * c.retract
    velocity = hook.flow(velocity, share)
    x.cylinder += c.half_step * (x.velocity + velocity)
    x.velocity = velocity
    x.cylinder = hook.load(x.cylinder)
    position = hook.position(x.cylinder)
    x.lvdt = c.m_keep * x.lvdt + c.m_old * x.position + c.m_new * position
    x.position = position
    x.earlier = x.reading
    x.reading = hook.sensor(x.lvdt)
    recorded = hook.recorder(x.reading)
    return recorded, x.spool, supply


def coefficients(p: Mapping[str, float], step_s: float) -> dict[str, float]:
    """Coefficients of one sub-step from the physical parameters."""
    spool = spring_step(p["spool_frequency"], p["spool_damping"], step_s)
    return (
        spool
        | lag_step("m", p["sensor_lag"], step_s)
        | {
            "loop_gain": p["loop_gain"],
            "dead_steps": delay_steps(p["dead_time"], step_s),
            "extend": p["speed_extend"],
            "retract": p["speed_extend"] * p["speed_ratio"],
            "half_step": 0.0 if math.isinf(step_s) else step_s / 2.0,
            "supply": p["supply_pressure"],
        }
    )


def initial(_p: Mapping[str, float], inputs: tuple[float, ...], output: float) -> dict[str, float]:
    """The cylinder stands where the first reading says, or at the request when there is none."""
    start = inputs[0] if math.isnan(output) else output
    return {"cylinder": start, "position": start, "lvdt": start, "reading": start, "earlier": start}


PLANT = Plant(
    name="hydraforce-sp08-47c",
    title="HydraForce SP08-47C with cylinder and LVDT",
    inputs=(Signal("request", "mm", 125.0),),
    output=Signal("position", "mm", 125.0),
    observed=(Signal("spool position", "%", 100.0), Signal("supply pressure", "bar", 100.0)),
    parameters=(
        Parameter("loop_gain", "%/mm", 1.3, 0.05, 20.0, "valve command per position error", hook="coil"),
        Parameter("dead_time", "s", 0.002, 0.0, 0.3, "amplifier and transport", growth="dead_time", hook="command"),
        Parameter("spool_frequency", "rad/s", 75.0, 5.0, 600.0, "natural frequency of the spool", hook="opening"),
        Parameter("spool_damping", "1", 0.7, 0.05, 5.0, "damping ratio of the spool", hook="opening"),
        Parameter("speed_extend", "mm/s", 185.0, 5.0, 2000.0, "extension at full opening", hook="flow"),
        Parameter(
            "speed_ratio", "1", 1.5, 0.1, 10.0, "retraction over extension: area ratio", change="asymmetry", hook="flow"
        ),
        Parameter("sensor_lag", "s", 0.001, 0.0, 0.2, "time constant of the LVDT", growth="sensor_lag", hook="sensor"),
        Parameter("supply_pressure", "bar", 100.0, 1.0, 400.0, "supply pressure at no flow", fixed=True, hook="supply"),
    ),
    hooks=(
        Hook("command", "command", "mm", 125.0),
        Hook("coil", "amplifier", "%", 100.0),
        Hook("force", "spool", "%", 100.0, extra="mobility"),
        Hook("opening", "orifice", "%", 100.0),
        Hook("supply", "supply", "bar", 100.0, extra="flow"),
        Hook("load_pressure", "cylinder", "bar", 100.0, extra="travel"),
        Hook("flow", "flow", "mm/s", 200.0, extra="opening"),
        Hook("load", "cylinder", "mm", 125.0),
        Hook("position", "linkage", "mm", 125.0),
        Hook("sensor", "sensor", "mm", 125.0),
        Hook("recorder", "recorder", "mm", 125.0),
    ),
    states={
        "spool": 1, "speed": 1, "velocity": 1, "cylinder": 1, "position": 1, "lvdt": 1, "reading": 1, "earlier": 1,
    },
    lines_s={"line": "dead_time"},
    equations=equations,
    coefficients=coefficients,
    sub_step_s=0.001,
    initial=initial,
    source="Gunay: Mathematical modelling and analysis of cartridge proportional valve, 2017",
)  # fmt: skip
