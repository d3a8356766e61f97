"""cylinder_four_edges: a 4/3 cartridge valve drives a vertical differential cylinder, after Gunay 2017.

HydraForce SP08-47C. Textbook physics (Merritt; Jelali & Kroll). **What differs** from a chain of gain, lag and
integrator: two chamber pressures with a bulk modulus that softens at low pressure; four metering edges, each with its
own width and overlap; a spool with mass, captured centring springs and true sticking; a coil whose field lags and
remembers; a seal whose friction grows with pressure; a little leakage and weight from the start. Outward motion is
positive. The paper states neither supply pressure nor masses nor current: these are assumed, the current after the
maker's data sheet.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from tests.studies.skeletons import Array, answering, drawing, more, parameters_of, scaled

PLANT = "hydraforce-open-loop"
CHANNELS = {"current": "A", "position": "mm", "pressure A": "bar", "pressure B": "bar"}
STEP_S = 0.002
NOISE = {"position": 0.05, "pressure A": 2.0, "pressure B": 2.0}
SUBSTEPS = 40  # 20 kHz
SETTLE_S = 0.5
GRAVITY = 9.81
ROOT_PA = 5.0e4  # below this drop an orifice turns laminar
SEAT_M = 2.0e-5  # travel over which a captured spring takes up its preload
STOP_N_PER_M, STOP_NS_PER_M = 3.0e7, 1.0e5


@dataclass(frozen=True)
class Unit:
    """One valve and cylinder."""

    coil_n_per_a: float = 26.0
    field_lag_s: float = 0.007
    remanence_a: float = 0.008
    remanence_span_a: float = 0.15
    spool_kg: float = 0.03
    spool_ns_per_m: float = 70.0
    spring_n_per_m: float = 12.0e3
    preload_n: float = 4.0
    seat_shift_m: float = 1.0e-5
    spool_coulomb_n: float = 0.25
    spool_breakaway: float = 1.3  # static over Coulomb
    spool_one_side_n: float = 0.0  # more friction while it moves towards extension
    spool_play_m: float = 0.0  # half width, between rod and spool
    spool_stroke_m: float = 1.75e-3
    width_pa_m: float = 1.95e-3
    width_pb_m: float = 1.75e-3
    width_at_m: float = 2.15e-3
    width_bt_m: float = 1.85e-3
    overlap_pa_m: float = 0.52e-3
    overlap_pb_m: float = 0.55e-3
    overlap_at_m: float = 0.46e-3
    overlap_bt_m: float = 0.49e-3
    edge_radius_m: float = 2.5e-5
    inlet_open: float = 1.0  # share of the inlet edges that is free
    discharge: float = 0.62
    oil_kg_per_m3: float = 865.0
    valve_leak_m3_per_pa_s: float = 2.0e-14
    supply_pa: float = 1.3e7
    supply_pa_s_per_m3: float = 4.0e9  # droop
    supply_lag_s: float = 0.012
    modulus_pa: float = 1.1e9
    modulus_soft_pa: float = 6.0e5  # pressure at which half the modulus is left
    bore_m2: float = 1963.5e-6
    ring_m2: float = 1256.6e-6
    stroke_m: float = 0.25
    dead_m3: float = 1.5e-4
    load_kg: float = 150.0
    seal_n: float = 180.0
    seal_n_per_pa: float = 1.5e-5
    seal_ns_per_m: float = 2500.0
    sensor_lag_s: float = 0.002


_Parameters = parameters_of(Unit)
SPREAD = {
    "bore_m2": 0.0,
    "ring_m2": 0.0,
    "stroke_m": 0.0,
    "seat_shift_m": 2.0,
    "inlet_open": 0.0,
    "oil_kg_per_m3": 0.01,
    "spool_coulomb_n": 0.15,
    "edge_radius_m": 0.2,
    "valve_leak_m3_per_pa_s": 0.25,
    "seal_n": 0.15,
    "remanence_a": 0.2,
    "coil_n_per_a": 0.03,
}


draw = drawing(Unit(), SPREAD, 0.05)


@njit(cache=True)
def _edge(p: Any, width_m: float, lap_m: float, travel_m: float, drop_pa: float) -> float:
    """Flow through one rounded edge, plus its leakage."""
    past = travel_m - lap_m
    area = width_m * 0.5 * (past + math.sqrt(past * past + p.edge_radius_m**2))
    root = drop_pa / math.sqrt(math.sqrt(drop_pa * drop_pa + ROOT_PA * ROOT_PA))
    return p.discharge * area * math.sqrt(2.0 / p.oil_kg_per_m3) * root + p.valve_leak_m3_per_pa_s * drop_pa


@njit(cache=True)
def _flow_a(p: Any, x: float, p_a: float, p_s: float) -> tuple[float, float]:
    """Flow in from the supply and out to the tank, chamber A."""
    return (
        _edge(p, p.width_pa_m * p.inlet_open, p.overlap_pa_m, x, p_s - p_a),
        _edge(p, p.width_at_m, p.overlap_at_m, -x, p_a),
    )


@njit(cache=True)
def _flow_b(p: Any, x: float, p_b: float, p_s: float) -> tuple[float, float]:
    """Flow in from the supply and out to the tank, chamber B."""
    return (
        _edge(p, p.width_pb_m * p.inlet_open, p.overlap_pb_m, -x, p_s - p_b),
        _edge(p, p.width_bt_m, p.overlap_bt_m, x, p_b),
    )


@njit(cache=True)
def _seal(p: Any, w: float, p_a: float, p_b: float) -> float:
    coulomb = p.seal_n + p.seal_n_per_pa * (p_a + p_b)
    return coulomb * (1.0 + 0.4 * math.exp(-abs(w) / 0.008)) * math.tanh(w / 5.0e-4) + p.seal_ns_per_m * w


@njit(cache=True)
def _chamber(p: Any, x: float, flow: float, is_a: bool) -> float:
    """The pressure at which the edges of a chamber pass this flow into it."""
    low, high = 0.0, 3.0 * p.supply_pa
    for _ in range(60):
        mid = 0.5 * (low + high)
        q_in, q_out = _flow_a(p, x, mid, p.supply_pa) if is_a else _flow_b(p, x, mid, p.supply_pa)
        if q_in - q_out > flow:
            low = mid
        else:
            high = mid
    return 0.5 * (low + high)


@njit(cache=True)
def _steady(p: Any, x: float) -> tuple[float, float, float]:
    """Both pressures and the piston's speed in the steady state of a spool position."""
    low, high = -1.0, 1.0
    p_a, p_b = 0.0, 0.0
    for _ in range(60):
        w = 0.5 * (low + high)
        p_a, p_b = _chamber(p, x, p.bore_m2 * w, True), _chamber(p, x, -p.ring_m2 * w, False)
        if p_a * p.bore_m2 - p_b * p.ring_m2 - p.load_kg * GRAVITY - _seal(p, w, p_a, p_b) > 0.0:
            low = w
        else:
            high = w
    return p_a, p_b, 0.5 * (low + high)


@njit(cache=True)
def _spool(p: Any, s: Array, current: float, dt: float) -> None:
    """The coil's field, then the spool, which really sticks: friction stops it or takes off its full impulse."""
    step = (current - s[0]) * dt / (p.field_lag_s + dt)
    s[0] += step
    side = 1.0 if step > 0.0 else -1.0
    s[1] = side + (s[1] - side) * math.exp(-abs(step) / p.remanence_span_a)
    off = s[2] - p.seat_shift_m
    push = (
        p.coil_n_per_a * (s[0] - p.remanence_a * s[1]) - p.spring_n_per_m * off - p.preload_n * math.tanh(off / SEAT_M)
    )
    mass = p.spool_kg + dt * p.spool_ns_per_m
    free = (p.spool_kg * s[3] + dt * push) / mass
    coulomb = p.spool_coulomb_n + (p.spool_one_side_n if free > 0.0 else 0.0)
    grip = coulomb * (1.0 + (p.spool_breakaway - 1.0) * math.exp(-abs(s[3]) / 0.004)) * dt / mass
    s[3] = 0.0 if abs(free) <= grip else free - math.copysign(grip, free)
    s[2] += dt * s[3]
    if abs(s[2]) > p.spool_stroke_m:
        s[2], s[3] = math.copysign(p.spool_stroke_m, s[2]), 0.0
    s[4] = min(max(s[4], s[2] - p.spool_play_m), s[2] + p.spool_play_m)


@njit(cache=True)
def _piston(p: Any, s: Array, dt: float, moving: bool) -> None:
    """Chambers and supply from the present speed, then the piston, then the position sensor."""
    p_a, p_b, p_s, y, w = s[5], s[6], s[7], s[8], s[9]
    in_a, out_a = _flow_a(p, s[4], p_a, p_s)
    in_b, out_b = _flow_b(p, s[4], p_b, p_s)
    soft_a, soft_b = p_a / (p_a + p.modulus_soft_pa) + 0.02, p_b / (p_b + p.modulus_soft_pa) + 0.02
    p_a += dt * p.modulus_pa * soft_a * (in_a - out_a - p.bore_m2 * w) / (p.dead_m3 + p.bore_m2 * max(y, 0.0))
    p_b += (
        dt * p.modulus_pa * soft_b * (in_b - out_b + p.ring_m2 * w) / (p.dead_m3 + p.ring_m2 * max(p.stroke_m - y, 0.0))
    )
    s[5], s[6] = max(p_a, 0.0), max(p_b, 0.0)
    s[7] += dt * (p.supply_pa - p.supply_pa_s_per_m3 * (in_a + in_b) - p_s) / p.supply_lag_s
    force = s[5] * p.bore_m2 - s[6] * p.ring_m2 - p.load_kg * GRAVITY - _seal(p, w, s[5], s[6])
    if y < 0.0:
        force -= STOP_N_PER_M * y + STOP_NS_PER_M * min(w, 0.0)
    if y > p.stroke_m:
        force -= STOP_N_PER_M * (y - p.stroke_m) + STOP_NS_PER_M * max(w, 0.0)
    s[9] = w + dt * force / p.load_kg
    if moving:
        s[8] = y + dt * s[9]
    s[10] += (s[8] - s[10]) * dt / (p.sensor_lag_s + dt)


@njit(cache=True)
def _run(p: Any, command: Array, step_s: float, substeps: int) -> Array:
    out = np.empty((3, command.size))
    dt = step_s / substeps
    s = np.zeros(11)
    s[0], s[7], s[8], s[10] = command[0], p.supply_pa, 0.5 * p.stroke_m, 0.5 * p.stroke_m
    for _ in range(int(SETTLE_S / dt)):
        _spool(p, s, command[0], dt)
    s[5], s[6], s[9] = _steady(p, s[4])
    for _ in range(int(SETTLE_S / dt)):
        _piston(p, s, dt, False)
    s[10] = s[8] - s[9] * p.sensor_lag_s
    for k in range(command.size):
        out[0, k], out[1, k], out[2, k] = 1.0e3 * (s[10] - 0.5 * p.stroke_m), 1.0e-5 * s[5], 1.0e-5 * s[6]
        for _ in range(substeps):
            _spool(p, s, command[k], dt)
            _piston(p, s, dt, True)
    return out


respond = answering(_run, _Parameters, CHANNELS, STEP_S, SUBSTEPS)
"""Position and both pressures, without noise, at the samples of a current in A, from the middle of the stroke."""


CHANGES = {
    "friction_rise": more(spool_coulomb_n=1.8),
    "breakaway_rise": more(spool_breakaway=10.0),
    "stiction_one_side": more(spool_one_side_n=3.0),
    "play": more(spool_play_m=0.2e-3),
    "magnetic_hysteresis": more(remanence_a=0.1),
    "slower_pilot": scaled(field_lag_s=0.6, spool_ns_per_m=0.6),
    "damping_change": scaled(spool_ns_per_m=6.0),
    "edge_worn": more(edge_radius_m=0.4e-3),
    "leakage": more(valve_leak_m3_per_pa_s=2.0e-12),
    "supply_sag": more(supply_pa_s_per_m3=3.0e10),
    "zero_shift": more(seat_shift_m=0.2e-3),
    "gain_loss": scaled(coil_n_per_a=-0.25),
    "orifice_clogged": scaled(inlet_open=-0.6),
    "stroke_stop": scaled(spool_stroke_m=-0.45),
    "sensor_lag": more(sensor_lag_s=0.05),
}
