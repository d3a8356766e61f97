"""Valves solved in small steps from their published equations, with nothing of `hil.physics`.

Each takes the command that acts, one value for each of its small steps, and gives its channels by name at every one.
Quantities are in the units of the benches: %, l/min, A, psi, mm, bar.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numba import njit
from scipy.interpolate import PchipInterpolator

from hil.record.recording import Array

Channels = dict[str, Array]
Values = Mapping[str, float]


@njit(cache=True)
def _lag(given, time_s, step_s):  # type: ignore[no-untyped-def]
    """First order, exact for what is held over a step."""
    made = np.empty_like(given)
    keep, state = math.exp(-step_s / time_s), given[0]
    for i in range(len(given)):
        made[i] = state
        state = keep * state + (1.0 - keep) * given[i]
    return made


def _straight(given: Array) -> Array:
    """What runs straight from one step to the next, as what would be held for the same effect."""
    made: Array = (given + np.append(given[1:], given[-1])) / 2.0
    return made


@njit(cache=True)
def _pair(given, frequency, damping, friction, step_s):  # type: ignore[no-untyped-def]
    """Second order in sixteenths of each step; friction in the unit of what is given, stopping what it can."""
    made = np.empty_like(given)
    place, speed = given[0], 0.0
    for i in range(len(given)):
        made[i] = place
        for _ in range(16):
            h = step_s / 16.0
            free = speed + h * (frequency**2 * (given[i] - place) - 2.0 * damping * frequency * speed)
            stopping = h * frequency**2 * friction
            speed = math.copysign(max(abs(free) - stopping, 0.0), free)
            place += h * speed
    return made


def _late(given: Array, time_s: float, step_s: float) -> Array:
    """Later by a dead time, between the steps along straight lines."""
    at = np.arange(len(given)) - time_s / step_s
    made: Array = np.interp(at, np.arange(len(given)), given)
    return made


def hpv41(command: Array, p: Values, step_s: float) -> Channels:
    """Dead time, pilot, spool loop, edge with overlap, flow meter (Tørdal, Klausen, Bak)."""
    pilot = _lag(_late(command, p["dead_time"], step_s), 1.0 / p["pilot_rate"], step_s)
    spool = _pair(_straight(pilot), p["spool_frequency"], p["spool_damping"], p.get("friction", 0.0), step_s)
    over = np.maximum(np.abs(spool) - p["dead_band"], 0.0) / (100.0 - p["dead_band"])
    flow = np.sign(spool) * p["full_flow"] * over ** p["curve_exponent"]
    supply = np.full(len(flow), 100.0)
    return {"flow": _lag(_straight(flow), p["sensor_lag"], step_s), "spool position": spool, "supply pressure": supply}


def efc(current: Array, p: Values, step_s: float) -> Channels:
    """Dead time, coil, rotor on its spring, logistic orifice, pressure sensor (Tugsal)."""
    coil = _lag(_late(current, p["dead_time"], step_s), p["coil_lag"], step_s)
    angle = _pair(_straight(coil), p["rotor_frequency"], p["rotor_damping"], p.get("friction", 0.0), step_s)
    share = 1.0 / (1.0 + np.exp(-(angle - p["curve_centre"]) / p["curve_width"]))
    pressure = p["closed_pressure"] + p["pressure_span"] * share
    supply = np.full(len(share), 220.0)
    return {"pressure": _lag(_straight(pressure), p["sensor_lag"], step_s), "supply pressure": supply}


@njit(cache=True)
def _coil(demand, resistance, inductance, step_s):  # type: ignore[no-untyped-def]
    """A current loop of 250 rad/s that 0 … 13.8 V limit, copper that warms by 1.5 K/W in 400 s, from 40 °C on.

    Each step is exact for the regime that it begins in: with Euler's, the loop would be half a step too fast.
    """
    count = len(demand)
    current, volts, warm = np.empty(count), np.empty(count), np.empty(count)
    i, rise = demand[0], 0.0
    for k in range(count):
        ohms = resistance * (1.0 + 0.00393 / (1.0 + 0.00393 * 2.2) * (rise + 40.0 - 22.2))
        volt = min(max(ohms * i + inductance * 250.0 * (demand[k] - i), 0.0), 13.8)
        current[k], volts[k], warm[k] = i, volt, rise + 40.0
        if 0.0 < volt < 13.8:
            i = demand[k] + (i - demand[k]) * math.exp(-250.0 * step_s)
        else:
            i = volt / ohms + (i - volt / ohms) * math.exp(-step_s * ohms / inductance)
        rise += step_s / 400.0 * (1.5 * ohms * i * i - rise)
    return current, volts, warm


def efc_drive(command: Array, p: Values, step_s: float) -> Channels:
    """The EFC behind its current drive, with shunt, voltmeter, thermometer, leakage flow (Tugsal)."""
    demand = _late(command, p["dead_time"], step_s)
    current, volts, warm = _coil(demand, p["resistance"], p["inductance"], step_s)
    torque = _lag(_straight(current), p["coil_lag"], step_s)
    angle = _pair(_straight(torque), p["rotor_frequency"], p["rotor_damping"], p.get("friction", 0.0), step_s)
    through = PchipInterpolator(
        [1.1, 1.2, 1.4, 1.6, 1.8, 2.0, 2.2], [0.0, 0.0005, 0.111, 0.565, 0.758, 1.0, 1.0], extrapolate=False
    )
    at = 1.6 + (angle - p["curve_shift"] - 1.6) / p["curve_stretch"]
    share = np.nan_to_num(through(np.clip(at, 1.1, 2.2)))
    pressure = 2.5 * (p["leakage"] / 80.0) ** 2 + p["pressure_span"] * share
    leak = p["leakage"] * (1.0 - share) * (1.0 - pressure / 220.0) + 3000.0 * share
    return {
        "pressure": _lag(_straight(pressure), p["sensor_lag"], step_s),
        "coil current": _lag(_straight(current), 0.004, step_s), "coil voltage": _lag(volts, 0.004, step_s),
        "coil temperature": warm, "through flow": leak,
        "supply pressure": np.full(len(share), 220.0),
    }  # fmt: skip


@njit(cache=True)
def _loop(request, dead, gain, frequency, damping, extend, retract, lag_s, step_s):  # type: ignore[no-untyped-def]
    count = len(request)
    position, spool = np.empty(count), np.empty(count)
    line = np.zeros(count)
    place = reading = request[0]
    x, speed = 0.0, 0.0
    for k in range(count):
        position[k], spool[k] = reading, x
        line[k] = min(max(gain * (request[k] - reading), -100.0), 100.0)
        at = k - dead
        first = math.floor(at)
        drive = 0.0
        if first >= 0:
            after = line[min(first + 1, k)]
            drive = line[first] + (at - first) * (after - line[first])
        speed += step_s * (frequency**2 * (drive - x) - 2.0 * damping * frequency * speed)
        x += step_s * speed
        place += step_s * 0.01 * x * (extend if x > 0.0 else retract)
        reading += step_s / lag_s * (place - reading)
    return position, spool


def closed(request: Array, p: Values, step_s: float) -> Channels:
    """Position loop, amplifier, spool, cylinder with two areas, LVDT (Gunay)."""
    extend = p["speed_extend"]
    position, spool = _loop(
        request, p["dead_time"] / step_s, p["loop_gain"], p["spool_frequency"], p["spool_damping"], extend,
        extend * p["speed_ratio"], p["sensor_lag"], step_s,
    )  # fmt: skip
    return {"position": position, "spool position": spool, "supply pressure": np.full(len(request), 100.0)}


@njit(cache=True)
def _cylinder(opening, edges, leakage, mass, viscous, coulomb, load, lag_s, step_s):  # type: ignore[no-untyped-def]
    """Four edges, two chambers, a piston of 50 mm with a rod of 30 mm and 250 mm of stroke; 100 bar."""
    head, rod = math.pi / 4.0 * 2500.0, math.pi / 4.0 * (2500.0 - 900.0)
    count = len(opening)
    position, first, second = np.empty(count), np.empty(count), np.empty(count)
    place = reading = rate = 0.0
    b = max(50.0, -10.0 * load / rod)
    a = (b * rod + 10.0 * load) / head
    for k in range(count):
        position[k], first[k], second[k] = reading, a, b
        share = min(max(0.01 * opening[k], -1.0), 1.0)
        if share >= 0.0:
            drop_a, drop_b, wide_a, wide_b = 100.0 - a, -b, edges[0] * share, edges[3] * share
        else:
            drop_a, drop_b, wide_a, wide_b = -a, 100.0 - b, -edges[1] * share, -edges[2] * share
        past = leakage * (a - b)
        into_a = wide_a * drop_a / math.sqrt(abs(drop_a) + 1.0) - past - head * rate
        into_b = wide_b * drop_b / math.sqrt(abs(drop_b) + 1.0) + past + rod * rate
        a = max(a + step_s * 12000.0 * into_a / (1e5 + head * (125.0 + place)), 0.0)
        b = max(b + step_s * 12000.0 * into_b / (1e5 + rod * (125.0 - place)), 0.0)
        push = 0.1 * (a * head - b * rod) - load - viscous * rate
        free = rate + 1e3 * step_s / mass * push
        stopping = 1e3 * step_s / mass * coulomb
        rate = math.copysign(max(abs(free) - stopping, 0.0), free)
        place += step_s * rate
        if abs(place) > 125.0:
            place, rate = math.copysign(125.0, place), 0.0
        reading += step_s / lag_s * (place - reading)
    return position, first, second


@njit(cache=True)
def _play(given, half):  # type: ignore[no-untyped-def]
    made = np.empty_like(given)
    held = 0.0
    for k in range(len(given)):
        held = min(max(held, given[k] - half), given[k] + half)
        made[k] = held
    return made


def opened(current: Array, p: Values, step_s: float) -> Channels:
    """Coils with a magnetic loop, spool, four edges, two chambers, piston, LVDT (Gunay; Merritt)."""
    held = _play(_late(current, p["dead_time"], step_s), p["hysteresis"] / 2.0)
    drive = np.sign(held) * np.clip((np.abs(held) - p["first_flow"]) * 100.0 / p["flow_range"], 0.0, 100.0)
    spool = _pair(drive, p["spool_frequency"], p["spool_damping"], 0.0, step_s)
    edge = p["rated_flow"] * 1e6 / 60.0 / math.sqrt(35.0)
    edges = edge * np.array([1.0, p["edge_a_return"], p["edge_supply_b"], p["edge_b_return"]])
    position, a, b = _cylinder(
        _straight(spool), edges, p["piston_leakage"] / 6.0, p["mass"], p["viscous"], p["coulomb"], p["load"],
        p["sensor_lag"], step_s,
    )  # fmt: skip
    return {"position": position, "spool position": spool, "pressure A": a, "pressure B": b}
