"""cylinder_hose: a cartridge valve moves a cylinder through soft hoses, one way against a counterbalance.

HydraForce SP08-47C with the cylinder of Gunay 2017, driven open loop; textbook physics (Merritt; Jelali and Kroll;
LuGre friction after Canudas de Wit et al.). **What differs** from a chain of gain, lag and integrator: two chambers
whose hoses are soft at low pressure; a pump whose leak and relief give the supply a pressure of its own; a
counterbalance orifice that chokes what leaves the head side; four edges of unequal width; a current that lags, magnets
that remember and a spool with friction; a seal whose friction falls with speed. Only the place is recorded. Masses,
hoses and pressures are assumed: the paper gives none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numba import njit

from tests.studies.skeletons import Array, answering, drawing, more, parameters_of, scaled

PLANT = "hydraforce-open-loop"
CHANNELS = {"current": "A", "position": "mm"}
STEP_S = 0.002
NOISE = {"position": 0.05}
SUBSTEPS = 50  # 25 kHz
SETTLE_S = 0.5
ROOT_PA = 8.0e4  # below this drop an orifice turns laminar


@dataclass(frozen=True)
class Unit:
    """One valve, pump, pair of hoses and cylinder."""

    spool_m_per_a: float = 1.6e-3
    coil_lag_s: float = 0.012
    spool_rad_per_s: float = 80.0
    spool_damping: float = 0.8
    spool_friction_a: float = 0.01  # as the current that it withstands
    remanence_a: float = 0.012
    shift_a: float = 0.0
    stroke_m: float = 1.6e-3
    overlap_m: float = 0.55e-3
    edge_m: float = 3.0e-5
    width_head_in_m: float = 1.2e-3
    width_head_out_m: float = 1.5e-3
    width_rod_in_m: float = 1.05e-3
    width_rod_out_m: float = 1.3e-3
    discharge: float = 0.63
    oil_kg_per_m3: float = 868.0
    counterbalance_m2: float = 1.8e-6  # in what leaves the head side
    pump_m3_per_s: float = 2.6e-4
    pump_leak_m3_per_pa_s: float = 1.2e-12
    relief_pa: float = 1.1e7
    relief_m3_per_pa_s: float = 4.0e-10
    line_m3: float = 6.0e-4
    modulus_pa: float = 8.0e8
    soft_pa: float = 1.5e6  # pressure at which half of it is left
    head_m2: float = 1963.5e-6
    rod_m2: float = 1256.6e-6
    half_m: float = 0.125
    hose_m3: float = 2.5e-4
    piston_leak_m3_per_pa_s: float = 2.0e-13
    load_kg: float = 180.0
    weight_n: float = 700.0
    seal_n: float = 180.0
    seal_breakaway: float = 1.5
    seal_out_n: float = 0.0  # more friction outwards
    stribeck_m_per_s: float = 0.008
    bristle_n_per_m: float = 4.0e6
    bristle_ns_per_m: float = 6.0e3
    viscous_ns_per_m: float = 900.0
    sensor_lag_s: float = 0.002


_Parameters = parameters_of(Unit)
SPREAD = {"half_m": 0.0, "head_m2": 0.0, "rod_m2": 0.0, "overlap_m": 0.03, "seal_n": 0.2, "remanence_a": 0.2}


draw = drawing(Unit(), SPREAD, 0.04)


@njit(cache=True)
def _edge(p: Any, past_m: float, width_m: float, drop_pa: float) -> float:
    """Flow over an edge, rounded over its radius."""
    area = width_m * 0.5 * (past_m + math.sqrt(past_m * past_m + p.edge_m * p.edge_m))
    root = drop_pa / math.sqrt(abs(drop_pa) + ROOT_PA)
    return float(p.discharge * area * math.sqrt(2.0 / p.oil_kg_per_m3) * root)


@njit(cache=True)
def _spool(p: Any, s: Array, current: float, dt: float) -> None:
    """Current, what the iron remembers, and a spool that sticks a little."""
    s[0] += (current + p.shift_a - s[0]) * dt / p.coil_lag_s
    s[1] = max(s[0] - p.remanence_a, min(s[0] + p.remanence_a, s[1]))
    w = p.spool_rad_per_s
    push = s[1] - s[2] / p.spool_m_per_a
    grip = (
        p.spool_friction_a * math.tanh(s[3] / 1.0e-3)
        if s[3] != 0.0
        else max(-p.spool_friction_a, min(push, p.spool_friction_a))
    )
    s[3] += dt * w * (w * p.spool_m_per_a * (push - grip) - 2.0 * p.spool_damping * s[3])
    s[2] += dt * s[3]
    if abs(s[2]) > p.stroke_m:
        s[2], s[3] = math.copysign(p.stroke_m, s[2]), 0.0


@njit(cache=True)
def _flows(p: Any, s: Array) -> tuple[float, float, float]:
    """Into the head side, into the rod side, and out of the pump's line."""
    past, back = s[2] - p.overlap_m, -s[2] - p.overlap_m
    head_in = _edge(p, past, p.width_head_in_m, s[6] - s[4])
    rod_out = _edge(p, past, p.width_rod_out_m, s[5])
    rod_in = _edge(p, back, p.width_rod_in_m, s[6] - s[5])
    opening = p.width_head_out_m * 0.5 * (back + math.sqrt(back * back + p.edge_m * p.edge_m))
    choked = opening * p.counterbalance_m2 / math.sqrt(opening * opening + p.counterbalance_m2 * p.counterbalance_m2)
    head_out = p.discharge * choked * math.sqrt(2.0 / p.oil_kg_per_m3) * s[4] / math.sqrt(abs(s[4]) + ROOT_PA)
    return head_in - head_out, rod_in - rod_out, head_in + rod_in


@njit(cache=True)
def _step(p: Any, s: Array, current: float, dt: float, moving: bool) -> None:
    """Spool, both chambers, the pump's line, piston and sensor over one step."""
    _spool(p, s, current, dt)
    to_head, to_rod, drawn = _flows(p, s)
    leak = p.piston_leak_m3_per_pa_s * (s[4] - s[5])
    y, v = s[7], s[8]
    for k, flow in ((4, to_head - leak - p.head_m2 * v), (5, to_rod + leak + p.rod_m2 * v)):
        volume = p.hose_m3 + (p.head_m2 * (p.half_m + y) if k == 4 else p.rod_m2 * (p.half_m - y))
        pressure = max(s[k], 0.0)
        s[k] = max(s[k] + dt * p.modulus_pa * (pressure + 1.0e5) / (pressure + p.soft_pa) * flow / volume, 0.0)
    spill = p.relief_m3_per_pa_s * max(s[6] - p.relief_pa, 0.0)
    s[6] += dt * p.modulus_pa / p.line_m3 * (p.pump_m3_per_s - p.pump_leak_m3_per_pa_s * s[6] - drawn - spill)
    level = p.seal_n * (1.0 + (p.seal_breakaway - 1.0) * math.exp(-((v / p.stribeck_m_per_s) ** 2)))
    level += p.seal_out_n if v > 0.0 else 0.0
    before = s[9]
    s[9] = (before + dt * v) / (1.0 + dt * p.bristle_n_per_m * abs(v) / level)
    seal = p.bristle_n_per_m * s[9] + p.bristle_ns_per_m * (s[9] - before) / dt
    net = s[4] * p.head_m2 - s[5] * p.rod_m2 - p.weight_n - seal - p.viscous_ns_per_m * v
    s[8] = v + dt * net / p.load_kg
    if moving:
        s[7] = y + dt * s[8]
        if abs(s[7]) > p.half_m:
            s[7], s[8] = math.copysign(p.half_m, s[7]), 0.0
    s[10] += (s[7] - s[10]) * dt / (p.sensor_lag_s + dt)


@njit(cache=True)
def _run(p: Any, command: Array, step_s: float, substeps: int) -> Array:
    out = np.empty(command.size)
    dt = step_s / substeps
    s = np.zeros(11)  # current, what is left of it, spool, its speed, head, rod, line, piston, its speed, seal, sensor
    s[6] = p.relief_pa
    s[5] = 3.0e6
    s[4] = (s[5] * p.rod_m2 + p.weight_n) / p.head_m2
    for _ in range(int(SETTLE_S / dt)):
        _step(p, s, command[0], dt, False)
        s[8] = 0.0
    for k in range(command.size):
        out[k] = 1.0e3 * s[10]
        for _ in range(substeps):
            _step(p, s, command[k], dt, True)
    return out


respond = answering(_run, _Parameters, CHANNELS, STEP_S, SUBSTEPS)
"""Place, without noise, at the samples of a current in A, from the middle of the stroke."""


CHANGES = {
    "friction_rise": more(spool_friction_a=0.2),
    "magnetic_hysteresis": more(remanence_a=0.12),
    "slower_pilot": lambda u, a: replace(
        u, coil_lag_s=u.coil_lag_s * (1.0 + 3.0 * a), spool_rad_per_s=u.spool_rad_per_s / (1.0 + 0.6 * a)
    ),
    "damping_change": scaled(spool_damping=4.0),
    "edge_worn": more(edge_m=0.5e-3),
    "leakage": more(piston_leak_m3_per_pa_s=8.0e-12),
    "supply_sag": scaled(pump_m3_per_s=-0.7),
    "zero_shift": more(shift_a=0.15),
    "gain_loss": scaled(spool_m_per_a=-0.25),
    "orifice_clogged": scaled(counterbalance_m2=-0.7),
    "stroke_stop": scaled(stroke_m=-0.5),
    "asymmetry": more(seal_out_n=2500.0),
    "sensor_lag": more(sensor_lag_s=0.05),
}
