"""HydraForce SP08-47C with differential cylinder and LVDT in an open loop: coil current in, position out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hil.physics.linear import delay_steps, delayed
from hil.physics.plant import Hook, Parameter, Plant, Signal, Travel
from hil.physics.steps import lag_step, spring_step

_EDGE_DROP_BAR = 35.0  # over one edge at rated flow
# Slower than anything that a cylinder is driven with, faster than a wrong flow needs to carry it out of its stroke.
_OBSERVER_RAD_S = 2.0
_BEYOND = 0.01  # of the stroke: so far beyond an end a transducer may read


def equations(current: Any, x: Any, c: Any, hook: Any) -> Any:
    """One sub-step: current → spool → four edges → two chambers of oil → piston → LVDT.

    A positive current is that of the coil that extends, a negative one that of the other. Below 1 bar the root of a
    pressure drop becomes a line. A pressure is implicit in its own edge, so that a small drop over a wide edge does not
    ring; cavitation holds it at 0. Place and pressures stand at the ends of a sub-step, the speed in its middle
    (leapfrog); edges are open as in the mean of it: second order, so that the piston is neither late nor early.
    """
    current = hook.command(current)
    current = hook.coil(current)
    if current - x.held > c.play:
        x.held = current - c.play
    elif x.held - current > c.play:
        x.held = current + c.play
    drive = min(max(abs(x.held) - c.first, 0.0) * c.per_ampere, 100.0)
    if x.held < 0.0:
        drive = -drive
    # behind the play and the ends of the range, which respond to the mean of two commands otherwise than to one by one
    drive = delayed(x.line, drive, c.dead_steps)
    free_position = c.xx * x.spool + c.xv * x.speed + c.compliance * drive
    free_speed = c.vx * x.spool + c.vv * x.speed + c.mobility * drive
    force = hook.force(free_speed, c.mobility)
    spool = free_position - c.compliance * force
    x.speed = free_speed - c.mobility * force
    opening = hook.opening(0.5 * (x.spool + spool))
    x.spool = spool
    share = min(max(0.01 * opening, -1.0), 1.0)
    supply = hook.supply(c.supply, share)
    from_a = supply
    from_b = 0.0
    edge_a = c.supply_a * share
    edge_b = c.b_return * share
    if share < 0.0:
        from_a = 0.0
        from_b = supply
        edge_a = -c.a_return * share
        edge_b = -c.supply_b * share
    drop_a = from_a - x.pressure_a
    drop_b = from_b - x.pressure_b
    root_a = math.sqrt(abs(drop_a) + 1.0)
    root_b = math.sqrt(abs(drop_b) + 1.0)
    past = c.leakage * (x.pressure_a - x.pressure_b)
    into_a = edge_a * drop_a / root_a - past - c.head_area * x.rate
    into_b = edge_b * drop_b / root_b + past + c.rod_area * x.rate
    stiff_a = c.squeeze / (c.dead_volume + c.head_area * (c.half_stroke + x.place))
    stiff_b = c.squeeze / (c.dead_volume + c.rod_area * (c.half_stroke - x.place))
    give_a = c.leakage + edge_a * (0.5 * abs(drop_a) + 1.0) / (root_a * root_a * root_a)
    give_b = c.leakage + edge_b * (0.5 * abs(drop_b) + 1.0) / (root_b * root_b * root_b)
    x.pressure_a = max(x.pressure_a + stiff_a * into_a / (1.0 + stiff_a * give_a), 0.0)
    x.pressure_b = max(x.pressure_b + stiff_b * into_b / (1.0 + stiff_b * give_b), 0.0)
    push = 0.1 * (x.pressure_a * c.head_area - x.pressure_b * c.rod_area) - c.load
    free_rate = c.keep * (x.rate + c.inverse_mass * push)
    stopped = c.keep * c.inverse_mass * c.coulomb
    x.place += c.step * x.rate
    x.rate = math.copysign(max(abs(free_rate) - stopped, 0.0), free_rate)
    if abs(x.place) > c.half_stroke:
        x.place = math.copysign(c.half_stroke, x.place)
        x.rate = 0.0
    x.place = hook.load(x.place)
    x.lvdt = c.m_keep * x.lvdt + c.m_old * x.before + c.m_new * x.place
    x.before = x.place
    reading = hook.sensor(x.lvdt)
    return reading + c.mid_reading, x.spool, x.pressure_a, x.pressure_b, supply


def coefficients(p: Mapping[str, float], step_s: float) -> dict[str, float]:
    """Coefficients of one sub-step from the physical parameters; lengths in mm, pressures in bar, forces in N."""
    step = 0.0 if math.isinf(step_s) else step_s
    spool = spring_step(p["spool_frequency"], p["spool_damping"], step_s)
    edge = p["rated_flow"] * 1e6 / 60.0 / math.sqrt(_EDGE_DROP_BAR)
    head, rod = (math.pi / 4.0 * p[name] ** 2 for name in ("bore", "rod"))
    per_mass = 1e3 * step / p["mass"]
    return (
        spool
        | lag_step("m", p["sensor_lag"], step_s)
        | {
            "dead_steps": delay_steps(p["dead_time"], step_s),
            "play": p["hysteresis"] / 2.0,
            "first": p["first_flow"],
            "per_ampere": 100.0 / p["flow_range"],
            "supply": p["supply_pressure"],
            "supply_a": edge,
            "a_return": edge * p["edge_a_return"],
            "supply_b": edge * p["edge_supply_b"],
            "b_return": edge * p["edge_b_return"],
            "leakage": p["piston_leakage"] * 1e3 / 60.0 / 100.0,
            "squeeze": step * p["bulk_modulus"],
            "dead_volume": 1e3 * p["dead_volume"],
            "head_area": head,
            "rod_area": head - rod,
            "half_stroke": p["stroke"] / 2.0,
            "mid_reading": p["mid_reading"],
            "load": p["load"],
            "coulomb": p["coulomb"],
            "inverse_mass": per_mass,
            "keep": 1.0 / (1.0 + per_mass * p["viscous"]),
            "step": step,
        }
    )


def initial(p: Mapping[str, float], _inputs: tuple[float, ...], output: float) -> dict[str, float]:
    """The piston stands where the first reading says, mid-stroke without one, held by both chambers."""
    head = math.pi / 4.0 * p["bore"] ** 2
    rod = head - math.pi / 4.0 * p["rod"] ** 2
    half = p["supply_pressure"] / 2.0
    pressure_b = max(half, -10.0 * p["load"] / rod)
    pressure_a = (pressure_b * rod + 10.0 * p["load"]) / head
    place = 0.0 if math.isnan(output) else output - p["mid_reading"]
    start = min(max(place, -p["stroke"] / 2.0), p["stroke"] / 2.0)
    return {"place": start, "before": start, "lvdt": start, "pressure_a": pressure_a, "pressure_b": pressure_b}


def observer(_p: Mapping[str, float], interval_s: float) -> dict[str, float]:
    """The piston and what the LVDT has of it are moved together."""
    return dict.fromkeys(("place", "before", "lvdt"), _OBSERVER_RAD_S * interval_s)


def zero(p: Mapping[str, float], travel: Travel) -> dict[str, float]:
    """What mid-stroke reads: 0, or half a stroke where readings count from an end, or by an end that was run into.

    The middle of what was read where nothing tells it, or both ends.
    """
    half, beyond = p["stroke"] / 2.0, _BEYOND * p["stroke"]
    by_end = [travel.least + half] * travel.ends_at_least + [travel.greatest - half] * travel.ends_at_greatest

    def is_within(mid: float) -> bool:
        return mid - half - beyond <= travel.least and travel.greatest <= mid + half + beyond

    def agrees(mid: float) -> bool:
        return is_within(mid) and all(abs(mid - each) <= beyond for each in by_end)

    if is_within(p["mid_reading"]):
        return {}
    return {"mid_reading": next(filter(agrees, (half, -half, *by_end)), (travel.least + travel.greatest) / 2.0)}


PLANT = Plant(
    name="hydraforce-open-loop",
    title="HydraForce SP08-47C with cylinder and LVDT, open loop",
    inputs=(Signal("current", "A", 1.1),),
    output=Signal("position", "mm", 125.0),
    observed=(
        Signal("spool position", "%", 100.0), Signal("pressure A", "bar", 100.0), Signal("pressure B", "bar", 100.0),
        Signal("supply pressure", "bar", 100.0),
    ),
    parameters=(
        Parameter("dead_time", "s", 0.002, 0.0, 0.3, "amplifier and transport", growth="dead_time", hook="command"),
        Parameter("hysteresis", "A", 0.044, 0.0, 0.3, "width of the loop of the magnet: below 7 % of full current",
                  growth="hysteresis", hook="coil"),
        Parameter("first_flow", "A", 0.4, 0.0, 1.0, "current at which flow begins", growth="deadband", hook="coil"),
        Parameter("flow_range", "A", 0.7, 0.1, 3.0, "current from first to full flow", hook="coil"),
        Parameter("spool_frequency", "rad/s", 75.0, 5.0, 600.0, "natural frequency of the spool", hook="opening"),
        Parameter("spool_damping", "1", 0.7, 0.05, 5.0, "damping ratio of the spool", hook="opening"),
        Parameter("rated_flow", "l/min", 11.4, 0.5, 60.0, "through a full edge at 35 bar over it", hook="opening"),
        Parameter("edge_a_return", "1", 1.0, 0.1, 5.0, "edge A to tank over edge P to A",
                  change="asymmetry", hook="opening"),
        Parameter("edge_supply_b", "1", 1.0, 0.1, 5.0, "edge P to B over edge P to A",
                  change="asymmetry", hook="opening"),
        Parameter("edge_b_return", "1", 1.0, 0.1, 5.0, "edge B to tank over edge P to A",
                  change="asymmetry", hook="opening"),
        Parameter("supply_pressure", "bar", 100.0, 10.0, 240.0, "supply pressure", fixed=True, hook="supply"),
        Parameter("bore", "mm", 50.0, 45.0, 200.0, "diameter of the piston", fixed=True, hook="load"),
        Parameter("rod", "mm", 30.0, 5.0, 40.0, "diameter of the rod", fixed=True, hook="load"),
        Parameter("stroke", "mm", 250.0, 50.0, 1000.0, "from end to end", fixed=True, hook="load"),
        Parameter("dead_volume", "ml", 100.0, 50.0, 2000.0, "of lines and ports, each side", fixed=True, hook="load"),
        Parameter("bulk_modulus", "bar", 12000.0, 2000.0, 16000.0, "of oil with some air", fixed=True, hook="load"),
        Parameter("mass", "kg", 100.0, 20.0, 5000.0, "moved mass", hook="load"),
        Parameter("viscous", "N*s/mm", 2.0, 0.0, 200.0, "viscous friction of piston and guide", hook="load"),
        Parameter("coulomb", "N", 200.0, 0.0, 5000.0, "sliding friction of piston and guide", hook="load"),
        Parameter("load", "N", 0.0, -10000.0, 10000.0, "force against extension", hook="load"),
        Parameter("piston_leakage", "ml/min", 0.0, 0.0, 2000.0, "past the piston at 100 bar",
                  growth="internal_leakage", hook="load"),
        Parameter("sensor_lag", "s", 0.001, 0.0, 0.2, "time constant of the LVDT", growth="sensor_lag", hook="sensor"),
        Parameter("mid_reading", "mm", 0.0, -5000.0, 5000.0, "reading at mid-stroke", fixed=True, hook="sensor"),
    ),
    hooks=(
        Hook("command", "command", "A", 1.1),
        Hook("coil", "amplifier", "A", 1.1),
        Hook("force", "spool", "%", 100.0, extra="mobility"),
        Hook("opening", "orifice", "%", 100.0),
        Hook("supply", "supply", "bar", 100.0, extra="flow"),
        Hook("load", "cylinder", "mm", 125.0),
        Hook("sensor", "sensor", "mm", 125.0),
    ),
    states={
        "held": 1, "spool": 1, "speed": 1, "pressure_a": 1, "pressure_b": 1, "rate": 1, "place": 1, "before": 1,
        "lvdt": 1,
    },
    lines_s={"line": "dead_time"},
    equations=equations,
    coefficients=coefficients,
    sub_step_s=0.0005,
    initial=initial,
    observer=observer,
    zero=zero,
    source="Gunay: Mathematical modelling and analysis of cartridge proportional valve, 2017; currents, hysteresis: "
    "data sheet of the SP08-47D; Merritt: Hydraulic Control Systems, 1967, ch. 5 and 6",
)  # fmt: skip
