"""Four-way valve: torque motor, pilot stage, four edges, two chambers; pressures, load and oil are commanded."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hil.physics.effect import compiled
from hil.physics.linear import first_order, free_motion, held_first_order
from hil.physics.plant import Hook, Parameter, Plant, Signal

EDGES = ("pa", "at", "pb", "bt")  # P to A, A to T, P to B, B to T
_RATED_EDGE_BAR = 35.0  # pressure drop of one edge at which flows of valves are stated
_DENSITY = 870.0  # kg/m³, mineral oil
_DISCHARGE = 0.65  # of a sharp edge
_RATED_C = 40.0
_SMOOTH_BAR = 0.1  # below which the load's throttle is laminar
_ENOUGH_L_MIN = 1e-6  # of flow that a chamber may be out of balance
_MOST_STEPS = 60.0
_STATES = (
    "supply",
    "tank",
    "load",
    "flapper",
    "flapper_speed",
    "spool",
    "pressure_a",
    "moved_a",
    "moved_b",
    "pressure_b",
    "flow",
    "meter",
)
_STOP = 110.0  # % of the stroke
_SMALL = 1e-5


@compiled
def warmer(temperature_c: float) -> float:
    """Than the oil at which viscosity and null are stated, in K."""
    return temperature_c - _RATED_C


@compiled
def followed(spool: float, start: float, end: float, ratio: float) -> float:
    """First-order lag over a step of `ratio` time constants, exact for an input straight from start to end; stops."""
    if ratio < _SMALL:
        moved = spool + ratio * (0.5 * (start + end) - spool)
    else:
        keep = math.exp(-ratio)
        late = (1.0 - keep) / ratio
        moved = keep * spool + (late - keep) * start + (1.0 - late) * end
    return min(max(moved, -_STOP), _STOP)


@compiled
def between(pressure: float, supply: float, tank: float) -> float:
    """No chamber comes beyond the pressures that feed and drain it."""
    return min(max(pressure, min(supply, tank)), max(supply, tank))


@compiled
def is_unbalanced(left_a: float, left_b: float) -> bool:
    """Whether flows into and out of a chamber still differ."""
    return left_a * left_a + left_b * left_b > _ENOUGH_L_MIN * _ENOUGH_L_MIN


@compiled
def through(drop: float, turbulent: float, laminar: float) -> float:
    """Flow through a gap at a pressure drop: drop · turbulent = flow·|flow| + 2 · laminar · flow."""
    size = math.sqrt(laminar * laminar + turbulent * abs(drop)) - laminar
    return size if drop >= 0.0 else -size


@compiled
def slope(flow: float, turbulent: float, laminar: float) -> float:
    """Derivative of `through` by the drop."""
    return 0.5 * turbulent / (abs(flow) + laminar)


@compiled
def smooth_root(drop: float) -> float:
    """Root of the size of a drop, no less than that of a tenth of a bar."""
    return math.sqrt(math.sqrt(drop * drop + _SMOOTH_BAR * _SMOOTH_BAR))


@compiled
def load_slope(drop: float, flow: float, root: float, conductance: float) -> float:
    """Derivative of the flow through the load's throttle, conductance · drop / root, by the drop."""
    return conductance / root - 0.5 * flow * drop / root**4


@compiled
def gap(past: float, clearance: float) -> float:
    """Narrowest way between land and edge, in µm, when the land has gone so far past the beginning of the edge."""
    return math.sqrt(max(past, 0.0) ** 2 + clearance * clearance)


@compiled
def laminar_share(past: float, least: float, viscous: float, way: float) -> float:
    """Flow below which a gap is laminar: it is as long as the land covers the bore, and at least as its rounding."""
    return viscous * (least + max(-past, 0.0)) / way


def equations(command: Any, supply: Any, load: Any, tank: Any, temperature: Any, x: Any, c: Any, hook: Any) -> Any:
    """One sub-step: command → torque motor → pilot → spool → edges and chambers → load → flow meter.

    Command and spool in %, pressures in bar, flows in l/min, the load's throttle in % of its opening. Oil in the
    chambers is stiff: their pressures are those at which flows balance, found by Newton's method from where
    they were going.
    """
    command = hook.command(command)
    # what is commanded comes about as fast as lines and the bench's own valves let it
    before = x.supply - x.tank
    x.supply += c.line_step * (supply - x.supply)
    x.tank += c.line_step * (tank - x.tank)
    x.load += c.line_step * (max(load, 0.0) - x.load)
    null = c.null + c.null_supply * (x.supply / c.rated - 1.0) + c.null_tank * x.tank / c.rated
    torque = command - null - c.null_warm * warmer(temperature)
    flapper = c.xx * x.flapper + c.xv * x.flapper_speed + (1.0 - c.xx) * torque
    x.flapper_speed = c.vx * (x.flapper - torque) + c.vv * x.flapper_speed
    # the pilot's flow moves the spool until the feedback spring has brought the flapper back
    speed = math.sqrt(max(0.5 * (before + x.supply - x.tank), 0.0) / c.rated)
    x.spool = followed(x.spool, x.flapper, flapper, c.pilot_step * speed)
    x.flapper = flapper
    spool = hook.position(x.spool)
    opening = hook.opening(spool)
    # how far each land is past the beginning of its rounded edge, in µm
    travel = c.stroke * opening
    past_pa, past_at = travel - c.begin_pa, -travel - c.begin_at
    past_pb, past_bt = -travel - c.begin_pb, travel - c.begin_bt
    viscous = c.viscous * math.exp(-c.thinning * warmer(temperature))
    way_pa = gap(past_pa, c.clearance)
    a_pa, b_pa = c.gain2 * way_pa * way_pa, laminar_share(past_pa, c.least_pa, viscous, way_pa)
    way_at = gap(past_at, c.clearance)
    a_at, b_at = c.gain2 * way_at * way_at, laminar_share(past_at, c.least_at, viscous, way_at)
    way_pb = gap(past_pb, c.clearance)
    a_pb, b_pb = c.gain2 * way_pb * way_pb, laminar_share(past_pb, c.least_pb, viscous, way_pb)
    way_bt = gap(past_bt, c.clearance)
    a_bt, b_bt = c.gain2 * way_bt * way_bt, laminar_share(past_bt, c.least_bt, viscous, way_bt)
    throttle = c.load_gain * x.load
    # Newton's step from the pressures of before; where it leaves more out of balance it is halved
    from_a, from_b, step_a, step_b, share = x.pressure_a, x.pressure_b, x.moved_a, x.moved_b, 1.0
    q_at, q_bt, q_load, left_a, left_b = 0.0, 0.0, 0.0, 1.0, 1.0
    least, steps = math.inf, 0.0
    while is_unbalanced(left_a, left_b) and steps < c.most_steps:
        steps += 1.0
        at_a = between(from_a + share * step_a, x.supply, x.tank)
        at_b = between(from_b + share * step_b, x.supply, x.tank)
        q_pa, q_at = through(x.supply - at_a, a_pa, b_pa), through(at_a - x.tank, a_at, b_at)
        q_pb, q_bt = through(x.supply - at_b, a_pb, b_pb), through(at_b - x.tank, a_bt, b_bt)
        drop = at_a - at_b
        root = smooth_root(drop)
        q_load = throttle * drop / root
        left_a, left_b = q_pa - q_at - q_load, q_pb - q_bt + q_load
        left = left_a * left_a + left_b * left_b
        if left < least:
            least, from_a, from_b, share = left, at_a, at_b, 1.0
            across = load_slope(drop, q_load, root, throttle)
            slope_a = slope(q_pa, a_pa, b_pa) + slope(q_at, a_at, b_at) + across
            slope_b = slope(q_pb, a_pb, b_pb) + slope(q_bt, a_bt, b_bt) + across
            whole = slope_a * slope_b - across * across
            step_a = (slope_b * left_a + across * left_b) / whole
            step_b = (slope_a * left_b + across * left_a) / whole
        else:
            share *= 0.5
    x.moved_a, x.moved_b = c.goes_on * (from_a - x.pressure_a), c.goes_on * (from_b - x.pressure_b)
    x.pressure_a, x.pressure_b = from_a, from_b
    flow = hook.flow(q_load, 0.01 * opening)
    returned = q_at + q_bt + c.pilot_flow * math.sqrt(max(x.supply - x.tank, 0.0) / c.rated)
    x.meter = c.m_keep * x.meter + c.m_old * x.flow + c.m_new * flow
    x.flow = flow
    reading = hook.sensor(x.meter)
    return reading, spool, x.pressure_a, x.pressure_b, x.pressure_a - x.pressure_b, returned, x.supply, x.tank


def coefficients(p: Mapping[str, float], step_s: float) -> dict[str, float]:
    """Coefficients of one sub-step from the physical parameters."""
    decay = p["motor_damping"] * p["motor_frequency"]
    armature = (0.0,) * 4 if math.isinf(step_s) else free_motion(p["motor_frequency"], decay, step_s)
    motor = dict(zip(("xx", "xv", "vx", "vv"), armature, strict=True))
    meter = first_order(p["sensor_lag"], step_s)
    stroke_um = 1e3 * p["stroke"]
    gain = p["rated_flow"] / (stroke_um * math.sqrt(_RATED_EDGE_BAR))
    width_mm = gain / (6e4 * _DISCHARGE * 1e-9 * math.sqrt(2e5 / _DENSITY))
    edges: dict[str, float] = {}
    for edge in EDGES:
        edges[f"begin_{edge}"] = p[f"lap_{edge}"] - p[f"radius_{edge}"]
        edges[f"least_{edge}"] = p[f"radius_{edge}"] + p["clearance"]
    return motor | edges | {
        "line_step": 1.0 - held_first_order(p["line_lag"], step_s),
        "null": p["null"],
        "null_supply": 10.0 * p["null_supply"],
        "null_tank": 10.0 * p["null_tank"],
        "null_warm": p["null_temperature"] / 40.0,
        "rated": p["rated_supply"],
        "pilot_step": min(step_s * p["pilot_rate"], 1e15),
        "pilot_flow": p["pilot_flow"],
        "stroke": 0.01 * stroke_um,
        "clearance": p["clearance"],
        "gain2": gain**2,
        "viscous": _DENSITY * p["viscosity"] / width_mm * gain**2,  # 6·μ/w · gain² in bar, l/min and µm
        "thinning": p["thinning"],
        "load_gain": 0.01 * p["load_flow"] / math.sqrt(_RATED_EDGE_BAR),
        "most_steps": _MOST_STEPS,
        "goes_on": 0.0 if math.isinf(step_s) else 1.0,  # from the steady state pressures do not go on as they came
        "m_keep": meter[0],
        "m_old": meter[1],
        "m_new": meter[2],
    }  # fmt: skip


def _edge(edge: str, way: str) -> tuple[Parameter, Parameter]:
    """Lap and rounding of one edge."""
    return (
        Parameter(f"lap_{edge}", "um", 5.0, -100.0, 200.0, f"overlap of the edge {way}", hook="opening"),
        Parameter(f"radius_{edge}", "um", 5.0, 0.0, 200.0, f"rounding of the edge {way}", hook="opening"),
    )


PLANT = Plant(
    name="four-way-valve",
    title="four-way valve with pilot stage",
    inputs=(
        Signal("command", "%", 100.0),
        Signal("supply setting", "bar", 210.0),
        Signal("load orifice", "%", 100.0),
        Signal("tank setting", "bar", 20.0),
        Signal("oil temperature", "degC", 100.0),
    ),
    output=Signal("flow", "l/min", 40.0),
    observed=(
        Signal("spool position", "%", 100.0),
        Signal("pressure A", "bar", 210.0),
        Signal("pressure B", "bar", 210.0),
        Signal("load pressure", "bar", 210.0),
        Signal("return flow", "l/min", 40.0),
        Signal("supply pressure", "bar", 210.0),
        Signal("tank pressure", "bar", 20.0),
    ),
    parameters=(
        *_edge("pa", "from P to A"),
        *_edge("at", "from A to T"),
        *_edge("pb", "from P to B"),
        *_edge("bt", "from B to T"),
        Parameter("clearance", "um", 4.0, 1.0, 30.0, "between land and bore", hook="opening"),
        Parameter("rated_flow", "l/min", 28.0, 1.0, 300.0, "through one edge at full stroke and 35 bar", hook="flow"),
        Parameter("stroke", "mm", 0.4, 0.05, 5.0, "of the spool at 100 %", fixed=True, hook="opening"),
        Parameter(
            "motor_frequency", "rad/s", 600.0, 50.0, 6000.0, "natural frequency of the armature", hook="position"
        ),
        Parameter("motor_damping", "1", 0.6, 0.05, 3.0, "damping ratio of the armature", hook="position"),
        Parameter("pilot_rate", "rad/s", 250.0, 5.0, 3000.0, "bandwidth of the pilot at rated supply", hook="position"),
        Parameter("pilot_flow", "l/min", 0.4, 0.0, 5.0, "of the pilot at rated supply", fixed=True, hook="flow"),
        Parameter("null", "%", 0.0, -20.0, 20.0, "command at which the spool is in its middle", hook="command"),
        Parameter(
            "null_supply", "%", 0.0, -3.0, 3.0, "its shift for 10 % of supply pressure", fixed=True, hook="command"
        ),
        Parameter(
            "null_tank",
            "%",
            0.0,
            -3.0,
            3.0,
            "its shift for a tank pressure of 10 % of supply",
            fixed=True,
            hook="command",
        ),
        Parameter("null_temperature", "%", 0.0, -8.0, 8.0, "its shift for 40 K", fixed=True, hook="command"),
        Parameter(
            "sensor_lag", "s", 0.004, 0.0, 0.2, "time constant of the flow meter", growth="sensor_lag", hook="sensor"
        ),
        Parameter(
            "line_lag", "s", 0.02, 0.002, 1.0, "time constant of commanded pressures and load", fixed=True, hook="flow"
        ),
        Parameter("viscosity", "mm2/s", 32.0, 2.0, 300.0, "of the oil at 40 °C", fixed=True, hook="flow"),
        Parameter(
            "thinning",
            "1/K",
            0.03,
            0.0,
            0.06,
            "share of its viscosity that the oil loses by warming",
            fixed=True,
            hook="flow",
        ),
        Parameter(
            "load_flow", "l/min", 100.0, 1.0, 500.0, "through the open load orifice at 35 bar", fixed=True, hook="flow"
        ),
        Parameter(
            "rated_supply",
            "bar",
            210.0,
            10.0,
            400.0,
            "supply pressure at which pilot and null are stated",
            fixed=True,
            hook="command",
        ),
    ),
    hooks=(
        Hook("command", "command", "%", 100.0),
        Hook("position", "spool", "%", 100.0),
        Hook("opening", "orifice", "%", 100.0),
        Hook("flow", "load", "l/min", 40.0, extra="opening"),
        Hook("sensor", "sensor", "l/min", 40.0),
    ),
    states=dict.fromkeys(_STATES, 1),
    equations=equations,
    coefficients=coefficients,
    sub_step_s=0.001,
    source="Merritt: Hydraulic Control Systems, 1967, ch. 5 and 7; Eryilmaz, Wilson: Unified modeling and analysis of "
    "a proportional valve, J. Franklin Inst. 343, 2006",
)
