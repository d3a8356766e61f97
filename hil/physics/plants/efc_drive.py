"""Cummins EFC with its coil's electrics: current drive, copper that warms, rotor, orifice, rail pressure, leakage."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from hil.physics.effect import compiled
from hil.physics.linear import delay_steps, delayed, held_first_order
from hil.physics.plant import Hook, Parameter, Plant, Signal
from hil.physics.steps import lag_step, spring_step

COPPER_PER_K = 0.00393  # at 20 °C
COPPER_REFERENCE_C = 22.2  # 72 °F, at which the specification states the resistance
_RATED_LEAKAGE = 80.0  # ml/min, middle of the specified range
_RATED_SUPPLY = 220.0  # psi, at which leakage is specified
_OPEN_FLOW = 3000.0  # ml/min through the open valve

# Currents and shares of the pressure span: the thesis's five step currents, level beyond them.
_CURVE_A = np.array([1.1, 1.2, 1.4, 1.6, 1.8, 2.0, 2.2])
_CURVE_SHARE = np.array([0.0, 0.0005, 0.111, 0.565, 0.758, 1.0, 1.0])
# Slopes of the monotone cubic (PCHIP) through them, per A.
_CURVE_SLOPE = np.array([0.0, 0.0089, 0.8887, 1.3543, 1.0737, 0.0, 0.0])


@compiled
def driven(
    demand: float, current: float, follow: float, keep: float, resistance: float, supply: float, volts: float
) -> float:
    """Coil current at the end of a step: a loop that follows the demand, as far as 0…supply volts let it.

    `follow` and `keep` are what is left of a difference after the step: of the loop, and of the coil alone. Where
    `volts` is above 0 there is no loop: the demand times it is the coil's mean voltage.
    """
    if volts > 0.0:
        rest = demand * volts / resistance
        wanted = rest + keep * (current - rest)
    else:
        wanted = demand + follow * (current - demand)
    most = supply / resistance + keep * (current - supply / resistance)
    least = keep * current
    return min(max(wanted, least), most)


@compiled
def throttle(current: float, shift: float, scale: float, reverse: float) -> float:
    """Share of the pressure span at a rotor angle, expressed as the current that would hold it there."""
    at = 1.6 + (current - shift - 1.6) / scale
    last = len(_CURVE_A) - 1
    if at <= _CURVE_A[0]:
        share = _CURVE_SHARE[0]
    elif at >= _CURVE_A[last]:
        share = _CURVE_SHARE[last]
    else:
        i = 0
        while at > _CURVE_A[i + 1]:
            i += 1
        width = _CURVE_A[i + 1] - _CURVE_A[i]
        t = (at - _CURVE_A[i]) / width
        share = (
            (1.0 + 2.0 * t) * (1.0 - t) ** 2 * _CURVE_SHARE[i]
            + t * (1.0 - t) ** 2 * width * _CURVE_SLOPE[i]
            + t * t * (3.0 - 2.0 * t) * _CURVE_SHARE[i + 1]
            + t * t * (t - 1.0) * width * _CURVE_SLOPE[i + 1]
        )
    return (1.0 - reverse) * share + reverse * (1.0 - share)


def equations(current: Any, x: Any, c: Any, hook: Any) -> Any:
    """One sub-step: demand → current loop → coil → rotor → orifice → rail pressure sensor.

    The rotor's angle is expressed as the current that would hold it there, pressure in psi.
    """
    current = hook.command(current)
    whole = 1.0 * int(c.dead_steps)
    part = c.dead_steps - whole
    demand = delayed(x.line, current, whole)
    resistance = c.resistance * (1.0 + c.copper * (x.warm + c.ambient - c.reference))
    # for the fraction of a step that the dead time has, the demand is still the one before: a loop at the end of its
    # voltage does not respond to their mean as to one after the other
    volts = c.volts_per_unit
    keeps = math.exp(-part * c.over_inductance * resistance)
    follows = math.exp(-part * c.follow_rate)
    before = driven(x.demand, x.current, follows, keeps, resistance, c.supply_voltage, volts)
    # the mean voltage that makes either part of this step of the current; instruments average both over the PWM, alike
    if part > 1e-6:
        averaged = c.a_keep**part
        voltage = resistance * (before - keeps * x.current) / (1.0 - keeps)
        x.shown_voltage = averaged * x.shown_voltage + (1.0 - averaged) * voltage
    keeps = math.exp((part - 1.0) * c.over_inductance * resistance)
    follows = math.exp((part - 1.0) * c.follow_rate)
    reached = driven(demand, before, follows, keeps, resistance, c.supply_voltage, volts)
    x.demand = demand
    if part < 1.0 - 1e-6:
        averaged = c.a_keep ** (1.0 - part)
        voltage = resistance * (reached - keeps * before) / (1.0 - keeps)
        x.shown_voltage = averaged * x.shown_voltage + (1.0 - averaged) * voltage
    x.shown_current = c.a_keep * x.shown_current + c.a_old * x.current + c.a_new * reached
    x.force = c.f_keep * x.force + c.f_old * x.current + c.f_new * reached
    x.current = reached
    x.warm = c.warm_keep * x.warm + (1.0 - c.warm_keep) * c.warming * resistance * reached * reached
    torque = hook.coil(x.force)
    # rotor on its spring: second order, friction as the change of current it withstands
    free_angle = c.xx * x.angle + c.xv * x.speed + c.x0 * x.torque + c.x1 * torque
    free_speed = c.vx * x.angle + c.vv * x.speed + c.v0 * x.torque + c.v1 * torque
    x.torque = torque
    friction = hook.force(free_speed, c.mobility)
    x.angle = free_angle - c.compliance * friction
    x.speed = free_speed - c.mobility * friction
    angle = hook.position(x.angle)
    opening = hook.opening(angle)
    share = throttle(opening, c.shift, c.scale, c.reverse)
    supply = hook.supply(c.supply, share)
    pressure = (c.closed_pressure + c.span * share) * (supply / c.rated_supply)
    pressure = hook.flow(pressure, share)
    leak = (c.leakage * (1.0 - share) * (supply - pressure) + c.open_flow * share * supply) / c.rated_supply
    x.meter = c.m_keep * x.meter + c.m_old * x.pressure + c.m_new * pressure
    x.pressure = pressure
    reading = hook.sensor(x.meter)
    temperature = x.warm + c.ambient
    return reading, x.shown_current, x.shown_voltage, temperature, leak, supply


def coefficients(p: Mapping[str, float], step_s: float) -> dict[str, float]:
    """Coefficients of one sub-step from the physical parameters."""
    made = spring_step(p["rotor_frequency"], p["rotor_damping"], step_s)
    for name, lag in (("a", "averaging_lag"), ("f", "coil_lag"), ("m", "sensor_lag")):
        made |= lag_step(name, p[lag], step_s)
    return made | {
        "dead_steps": delay_steps(p["dead_time"], step_s),
        "resistance": p["resistance"],
        "copper": COPPER_PER_K / (1.0 + COPPER_PER_K * (COPPER_REFERENCE_C - 20.0)),
        "ambient": p["coil_temperature"],
        "reference": COPPER_REFERENCE_C,
        "over_inductance": min(step_s / p["inductance"], 1e9),
        "follow_rate": min(step_s * p["loop_bandwidth"], 1e9),
        "supply_voltage": p["supply_voltage"],
        "volts_per_unit": 0.0,
        "warm_keep": held_first_order(p["warming_time"], step_s),
        "warming": p["warming"],
        "shift": p["curve_shift"],
        "scale": p["curve_stretch"],
        "reverse": p["normally_open"],
        "closed_pressure": p["closed_pressure"] * (p["leakage"] / _RATED_LEAKAGE) ** 2,
        "span": p["pressure_span"],
        "leakage": p["leakage"],
        "open_flow": _OPEN_FLOW,
        "supply": p["supply_pressure"],
        "rated_supply": _RATED_SUPPLY,
    }


def _parameters() -> tuple[Parameter, ...]:
    return (
        Parameter("dead_time", "s", 0.002, 0.0, 0.2, "electronics and transport", growth="dead_time", hook="command"),
        Parameter("resistance", "ohm", 2.1, 0.01, 1e5, "coil at 72 °F; 7.2 for 24 V"),
        Parameter("inductance", "H", 0.09, 1e-4, 1.0, "coil"),
        Parameter("coil_temperature", "degC", 40.0, -40.0, 200.0, "without current: that of the fuel", fixed=True),
        Parameter("warming", "K/W", 1.5, 0.0, 50.0, "temperature rise of the copper over its power", fixed=True),
        Parameter("warming_time", "s", 400.0, 1.0, 1e5, "time constant of the copper's temperature", fixed=True),
        Parameter("supply_voltage", "V", 13.8, 1.0, 40.0, "highest voltage of the drive", fixed=True),
        Parameter("loop_bandwidth", "rad/s", 250.0, 10.0, 5000.0, "current loop of the drive", fixed=True),
        Parameter(
            "coil_lag", "s", 0.008, 0.0, 0.3, "force behind current: eddy currents", growth="coil_lag", hook="coil"
        ),
        Parameter(
            "rotor_frequency", "rad/s", 187.0, 3.0, 500.0, "natural frequency of rotor on spring", hook="position"
        ),
        Parameter("rotor_damping", "1", 3.14, 0.05, 20.0, "damping ratio of the rotor", hook="position"),
        Parameter("curve_shift", "A", 0.0, -1.0, 1.0, "shift of the pressure curve", hook="opening"),
        Parameter("curve_stretch", "1", 1.0, 0.2, 5.0, "width of the pressure curve over the usual", hook="opening"),
        Parameter("averaging_lag", "s", 0.004, 0.0, 0.1, "of the instruments of coil current and voltage", fixed=True),
        Parameter("normally_open", "1", 0.0, 0.0, 1.0, "1 for a valve that current closes", fixed=True),
        Parameter("pressure_span", "psi", 207.0, 10.0, 400.0, "pressure between closed and open", hook="flow"),
        Parameter("leakage", "ml/min", _RATED_LEAKAGE, 0.0, 2000.0, "through the closed valve at 220 psi",
                  growth="leakage", hook="flow"),
        Parameter("closed_pressure", "psi", 2.5, 0.0, 60.0, "rail pressure that 80 ml/min make", fixed=True),
        Parameter("sensor_lag", "s", 0.004, 0.0, 0.2, "time constant of the pressure sensor", growth="sensor_lag",
                  hook="sensor"),
        Parameter("supply_pressure", "psi", 220.0, 10.0, 400.0, "supply pressure", fixed=True, hook="supply"),
    )  # fmt: skip


PLANT = Plant(
    name="efc-drive",
    title="Cummins EFC fuel-control valve with the electrics of its coil",
    inputs=(Signal("current", "A", 3.0),),
    output=Signal("pressure", "psi", 200.0),
    observed=(
        Signal("coil current", "A", 2.0),
        Signal("coil voltage", "V", 12.0),
        Signal("coil temperature", "degC", 100.0),
        Signal("through flow", "ml/min", 100.0),
        Signal("supply pressure", "psi", 220.0),
    ),
    parameters=_parameters(),
    hooks=(
        Hook("command", "command", "A", 1.0),
        Hook("coil", "coil", "A", 1.0),
        Hook("force", "rotor", "A", 1.0, extra="mobility"),
        Hook("position", "rotor", "A", 1.0),
        Hook("opening", "orifice", "A", 1.0),
        Hook("supply", "supply", "psi", 220.0, extra="flow"),
        Hook("flow", "load", "psi", 200.0, extra="opening"),
        Hook("sensor", "sensor", "psi", 200.0),
    ),
    states={
        "demand": 1,
        "current": 1,
        "shown_current": 1,
        "shown_voltage": 1,
        "warm": 1,
        "force": 1,
        "torque": 1,
        "angle": 1,
        "speed": 1,
        "pressure": 1,
        "meter": 1,
    },
    lines_s={"line": "dead_time"},
    equations=equations,
    coefficients=coefficients,
    sub_step_s=0.0005,
    rectifies=True,  # below 0 V there is none: the current decays slowly there, and rises fast
    source="Tugsal: Fault diagnosis of electronic fuel control (EFC) valves via dynamic performance test "
    "method, Purdue 2009; copper and drive as customary",
)
