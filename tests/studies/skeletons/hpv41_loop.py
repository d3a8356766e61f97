"""hpv41_loop: a mobile proportional valve whose electronics close a position loop on the real spool.

Brevini HPV41 with the MHPED module (Tørdal, Klausen, Bak); textbook physics (Merritt; Jelali & Kroll). **What
differs** from a chain of filters and a curve: a controller with a lag term compares the command with the measured
position; the pilot valve's flow moves the piston, so the piston integrates and centring spring, friction and stops
act inside the loop; the spool hangs on the piston and leads two metering edges of unequal overlap and width; a
little friction that really sticks from the start; flow is the lesser of what the compensator allows and what the
supply can push through. 100 % is about 70 l/min, the dead band about ±27 %. Controller, masses and pilot data are
assumed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numba import njit

from tests.studies.skeletons import Array, answering, divided, drawing, more, parameters_of, scaled

PLANT = "brevini-hpv41"
CHANNELS = {"command": "%", "flow": "l/min"}
STEP_S = 0.004
NOISE = {"flow": 0.25}
SUBSTEPS = 60  # 15 kHz
SETTLE_S = 3.0
SHARP = 6.0  # how sharply the compensator hands over to the supply's limit


@dataclass(frozen=True)
class Unit:
    """One valve, its pilot stage and electronics."""

    stroke_mm: float = 7.0  # at 100 %
    electronics_lag_s: float = 0.006
    loop_per_mm: float = 0.17  # pilot opening per mm of error
    loop_lag_gain: float = 1.2  # slow part of the controller over its fast part
    loop_lag_s: float = 0.5
    loop_lag_limit: float = 0.08  # pilot opening
    pilot_rad_per_s: float = 34.0
    pilot_damping: float = 0.65
    pilot_mm_per_s: float = 32.0  # piston speed at full pilot opening without load
    pilot_n: float = 800.0  # force that stalls it at full pilot opening
    spring_n_per_mm: float = 12.0
    coulomb_n: float = 8.0
    breakaway: float = 1.3  # static over Coulomb
    stribeck_mm_per_s: float = 2.0
    one_side_n: float = 0.0  # more friction while it moves towards A
    play_mm: float = 0.0  # half width, between piston and spool
    pickup_shift_mm: float = 0.0
    stop_a_mm: float = 6.75
    stop_b_mm: float = 6.75
    overlap_a_mm: float = 1.85
    overlap_b_mm: float = 2.0
    width_a: float = 0.0166  # l/min per (mm √Pa): of the edge towards A
    width_b: float = 0.0174
    edge_mm: float = 0.08  # radius of an edge
    leak: float = 0.0  # l/min per √Pa, past the edge towards A
    compensator_pa: float = 7.0e5
    supply_pa: float = 1.0e7
    sag_pa_per_lpm: float = 6.0e3
    sag_lag_s: float = 0.03
    line_pa_per_lpm2: float = 1000.0
    sensor_lag_s: float = 0.01


_Parameters = parameters_of(Unit)
SPREAD = {
    "stroke_mm": 0.0,
    "overlap_a_mm": 0.03,
    "overlap_b_mm": 0.03,
    "coulomb_n": 0.2,
    "edge_mm": 0.2,
    "stop_a_mm": 0.01,
    "stop_b_mm": 0.01,
}


draw = drawing(Unit(), SPREAD, 0.05)


@njit(cache=True)
def _speed(p: Any, push: float, speed: float) -> float:
    """Speed of the piston that pilot flow allows once friction is taken off the push."""
    grip = p.coulomb_n * (1.0 + (p.breakaway - 1.0) * math.exp(-abs(speed) / p.stribeck_mm_per_s))
    grip += p.one_side_n if push > 0.0 else 0.0
    return 0.0 if abs(push) <= grip else math.copysign(abs(push) - grip, push) * p.pilot_mm_per_s / p.pilot_n


@njit(cache=True)
def _edge(p: Any, past_mm: float) -> float:
    """Opening of a straight edge, rounded over its radius."""
    return 0.5 * (past_mm + math.sqrt(past_mm * past_mm + p.edge_mm * p.edge_mm))


@njit(cache=True)
def _side(p: Any, gain: float, supply_pa: float) -> float:
    """Flow through one edge in l/min: the compensator's drop, or what supply and lines leave."""
    kept = gain * math.sqrt(p.compensator_pa)
    left = gain * math.sqrt(max(supply_pa, 1.0e4) / (1.0 + p.line_pa_per_lpm2 * gain * gain))
    high = max(kept, left, 1.0e-9)
    return float(kept * left / high / ((kept / high) ** SHARP + (left / high) ** SHARP) ** (1.0 / SHARP))


@njit(cache=True)
def _step(p: Any, s: Array, command: float, dt: float) -> None:
    """Electronics, pilot, piston, spool, flow and sensor over one step."""
    s[0] += (command * 0.01 * p.stroke_mm - s[0]) * dt / (p.electronics_lag_s + dt)
    error = s[0] - s[4] - p.pickup_shift_mm
    slow = p.loop_lag_gain * p.loop_per_mm * error
    s[1] += (max(-p.loop_lag_limit, min(p.loop_lag_limit, slow)) - s[1]) * dt / p.loop_lag_s
    opening = max(-1.0, min(1.0, p.loop_per_mm * error + s[1]))
    w = p.pilot_rad_per_s
    s[3] += dt * w * (w * (opening - s[2]) - 2.0 * p.pilot_damping * s[3])
    s[2] += dt * s[3]
    s[5] = _speed(p, p.pilot_n * s[2] - p.spring_n_per_mm * s[4], s[5])
    s[4] = max(-p.stop_b_mm, min(p.stop_a_mm, s[4] + dt * s[5]))
    s[6] = max(s[4] - p.play_mm, min(s[4] + p.play_mm, s[6]))
    supply = p.supply_pa - p.sag_pa_per_lpm * s[7]
    towards_a = _side(p, p.width_a * _edge(p, s[6] - p.overlap_a_mm) + p.leak, supply)
    flow = towards_a - _side(p, p.width_b * _edge(p, -s[6] - p.overlap_b_mm), supply)
    s[7] += (abs(flow) - s[7]) * dt / p.sag_lag_s
    s[8] += (flow - s[8]) * dt / (p.sensor_lag_s + dt)


@njit(cache=True)
def _run(p: Any, command: Array, step_s: float, substeps: int) -> Array:
    out = np.empty(command.size)
    dt = step_s / substeps
    s = np.zeros(9)  # reference, slow part, pilot, its rate, piston, its speed, spool, flow drawn, sensor
    for _ in range(int(SETTLE_S / dt)):
        _step(p, s, command[0], dt)
    for k in range(command.size):
        out[k] = s[8]
        for _ in range(substeps):
            _step(p, s, command[k], dt)
    return out


respond = answering(_run, _Parameters, CHANNELS, STEP_S, SUBSTEPS)
"""Flow, without noise, at the samples of a command in %."""


CHANGES = {
    "friction_rise": more(coulomb_n=90.0),
    "breakaway_rise": more(breakaway=9.0),
    "stiction_one_side": more(one_side_n=120.0),
    "play": more(play_mm=0.7),
    "slower_pilot": divided(pilot_rad_per_s=0.6),
    "damping_change": scaled(pilot_damping=-0.55),
    "orifice_clogged": scaled(pilot_mm_per_s=-0.65),
    "edge_worn": more(edge_mm=1.8),
    "leakage": more(leak=0.012),
    "supply_sag": more(sag_pa_per_lpm=2.4e5),
    "zero_shift": more(pickup_shift_mm=0.8),
    "gain_loss": lambda u, a: replace(u, compensator_pa=u.compensator_pa * (1.0 - 0.25 * a) ** 2),
    "stroke_stop": more(stop_a_mm=-2.8, stop_b_mm=-2.8),
    "sensor_lag": more(sensor_lag_s=0.08),
}
