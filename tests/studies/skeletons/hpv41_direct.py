"""hpv41_direct: two proportional magnets push a spool against its springs; it meters into two loaded ports.

Brevini HPV41 as Tørdal, Klausen and Bak drive it, but **without a pilot stage**; textbook physics (Merritt; Jelali and
Kroll; bristle friction after Canudas de Wit). **What differs**: a mass between springs that a dashpot slows; currents
that lag; a flow force that closes; bristle friction from the start; edges of unequal overlap and width; a pressure in
each port between the metering edge and the orifice of the load. 100 % is about 70 l/min, the dead band about ±27 %.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from tests.studies.skeletons import Array, answering, drawing, more, orifice_root, parameters_of, scaled

PLANT = "brevini-hpv41"
CHANNELS = {"command": "%", "flow": "l/min"}
STEP_S = 0.004
NOISE = {"flow": 0.25}
SUBSTEPS = 80  # 20 kHz
SETTLE_S = 2.0
ROOT_PA = 3.0e4  # below this drop an orifice turns laminar


@dataclass(frozen=True)
class Unit:
    """One valve, its magnets and the two ports that it feeds."""

    force_n: float = 92.0  # of a magnet at 100 %
    knee: float = 2.2  # share of full current at which it saturates
    coil_lag_s: float = 0.02
    remanence_n: float = 0.8
    spool_kg: float = 0.16
    dashpot_ns_per_m: float = 950.0
    spring_n_per_m: float = 12.5e3
    offset_n: float = 0.0
    coulomb_n: float = 2.2
    breakaway: float = 1.25  # static over Coulomb
    stribeck_m_per_s: float = 0.004
    bristle_n_per_m: float = 2.0e5
    one_side_n: float = 0.0  # more friction while it moves towards A
    stop_m: float = 7.4e-3
    overlap_a_m: float = 1.85e-3
    overlap_b_m: float = 2.05e-3
    width_a_m: float = 9.6e-3
    width_b_m: float = 9.0e-3
    edge_m: float = 1.5e-4
    discharge: float = 0.65
    oil_kg_per_m3: float = 862.0
    flow_force: float = 0.3  # N per m² of opening and Pa
    leak_m2: float = 0.0  # past the edge towards A
    supply_pa: float = 1.55e6
    sag_pa_s_per_m3: float = 5.0e7
    sag_lag_s: float = 0.03
    load_a: float = 1.5e-6  # m³/s per √Pa
    load_b: float = 1.4e-6
    stiffness_pa_per_m3: float = 8.0e11
    sensor_lag_s: float = 0.012


_Parameters = parameters_of(Unit)
SPREAD = {"overlap_a_m": 0.03, "overlap_b_m": 0.03, "coulomb_n": 0.2, "remanence_n": 0.2, "edge_m": 0.2}


draw = drawing(Unit(), SPREAD, 0.05)


@njit(cache=True)
def _opening(p: Any, past_m: float, width_m: float) -> float:
    """Area of a straight edge, rounded over its radius."""
    return width_m * 0.5 * (past_m + math.sqrt(past_m * past_m + p.edge_m * p.edge_m))


_root = orifice_root(ROOT_PA)


@njit(cache=True)
def _magnets(p: Any, s: Array, command: float, dt: float) -> float:
    """Force of both magnets; what the iron remembers lags behind by the remanence."""
    for k in range(2):
        wanted = max(command, 0.0) if k == 0 else max(-command, 0.0)
        s[k] += (0.01 * wanted - s[k]) * dt / p.coil_lag_s
    force = p.force_n * (s[0] / (1.0 + (s[0] / p.knee) ** 4) ** 0.25 - s[1] / (1.0 + (s[1] / p.knee) ** 4) ** 0.25)
    s[2] = max(force - p.remanence_n, min(force + p.remanence_n, s[2]))
    return float(s[2])


@njit(cache=True)
def _spool(p: Any, s: Array, force: float, closing: float, dt: float) -> None:
    """Spool between its springs, with a dashpot, bristles and hard stops."""
    v = s[4]
    level = p.coulomb_n * (1.0 + (p.breakaway - 1.0) * math.exp(-((v / p.stribeck_m_per_s) ** 2)))
    level += p.one_side_n if v > 0.0 else 0.0
    s[5] = (s[5] + dt * v) / (1.0 + dt * p.bristle_n_per_m * abs(v) / level)
    net = force + p.offset_n - p.spring_n_per_m * s[3] - closing - p.bristle_n_per_m * s[5]
    s[4] = (v + dt * net / p.spool_kg) / (1.0 + dt * p.dashpot_ns_per_m / p.spool_kg)
    s[3] += dt * s[4]
    if abs(s[3]) > p.stop_m:
        s[3], s[4] = math.copysign(p.stop_m, s[3]), 0.0


@njit(cache=True)
def _step(p: Any, s: Array, command: float, dt: float) -> None:
    """Magnets, spool, ports and sensor over one step."""
    supply = p.supply_pa - p.sag_pa_s_per_m3 * s[8]
    speed = p.discharge * math.sqrt(2.0 / p.oil_kg_per_m3)
    area_a = _opening(p, s[3] - p.overlap_a_m, p.width_a_m)
    area_b = _opening(p, -s[3] - p.overlap_b_m, p.width_b_m)
    closing = p.flow_force * (area_a * (supply - s[6]) - area_b * (supply - s[7]))
    _spool(p, s, _magnets(p, s, command, dt), closing, dt)
    in_a = speed * (area_a + p.leak_m2) * _root(supply - s[6])
    in_b = speed * area_b * _root(supply - s[7])
    out_a, out_b = p.load_a * _root(s[6]), p.load_b * _root(s[7])
    s[6] += dt * p.stiffness_pa_per_m3 * (in_a - out_a)
    s[7] += dt * p.stiffness_pa_per_m3 * (in_b - out_b)
    s[8] += (in_a + in_b - s[8]) * dt / p.sag_lag_s
    s[9] += (6.0e4 * (out_a - out_b) - s[9]) * dt / (p.sensor_lag_s + dt)


@njit(cache=True)
def _run(p: Any, command: Array, step_s: float, substeps: int) -> Array:
    out = np.empty(command.size)
    dt = step_s / substeps
    s = np.zeros(10)  # currents, force, spool, its speed, bristle, port A, port B, flow drawn, sensor
    for _ in range(int(SETTLE_S / dt)):
        _step(p, s, command[0], dt)
    for k in range(command.size):
        out[k] = s[9]
        for _ in range(substeps):
            _step(p, s, command[k], dt)
    return out


respond = answering(_run, _Parameters, CHANNELS, STEP_S, SUBSTEPS)
"""Flow, without noise, at the samples of a command in %."""


CHANGES = {
    "friction_rise": more(coulomb_n=25.0),
    "breakaway_rise": more(breakaway=9.0),
    "stiction_one_side": more(one_side_n=30.0),
    "magnetic_hysteresis": more(remanence_n=12.0),
    "slower_pilot": scaled(coil_lag_s=5.0),
    "damping_change": scaled(dashpot_ns_per_m=1.5),
    "edge_worn": more(edge_m=1.8e-3),
    "leakage": more(leak_m2=6.0e-6),
    "supply_sag": more(sag_pa_s_per_m3=7.0e8),
    "zero_shift": more(offset_n=14.0),
    "gain_loss": scaled(force_n=-0.25),
    "orifice_clogged": scaled(load_a=-0.5, load_b=-0.5),
    "stroke_stop": more(stop_m=-3.6e-3),
    "sensor_lag": more(sensor_lag_s=0.08),
}
