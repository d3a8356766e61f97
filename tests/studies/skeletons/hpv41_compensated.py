"""hpv41_compensated: a lever feeds the spool's place back to its pilot; a compensator holds the drop over its edges.

Brevini HPV41 as Tørdal, Klausen and Bak drive it, taken as a **load-sensing valve with an inlet compensator**;
textbook physics (Merritt; Jelali and Kroll). **What differs** from a chain: the pilot closes a loop over a lever that
has a little play; the spool's speed has a ceiling and the spool sticks; a second spool throttles the supply until the
drop over the metering edge is that of its spring; pressures before the edges, in both ports and in the line that
senses the load; edges of unequal overlap and width. 100 % is about 70 l/min, the dead band about ±27 %.
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
SETTLE_S = 1.0
ROOT_PA = 1.0e5  # below this drop an orifice turns laminar


@dataclass(frozen=True)
class Unit:
    """One valve with its pilot, spool, compensator and the two ports that it feeds."""

    wanted_m: float = 7.0e-3  # of the spool at 100 %
    coil_lag_s: float = 0.008
    remanence: float = 0.006  # share of full current
    offset: float = 0.0  # likewise
    lever_play_m: float = 3.0e-5
    pilot_n_per_m: float = 6.0e4
    spool_ns_per_m: float = 1600.0
    pilot_m_per_s: float = 0.16  # the pilot's ceiling
    coulomb_n: float = 2.0
    breakaway: float = 1.3  # static over Coulomb
    stop_m: float = 7.6e-3
    overlap_a_m: float = 1.8e-3
    overlap_b_m: float = 2.0e-3
    width_a_m: float = 9.0e-3
    width_b_m: float = 8.2e-3
    edge_m: float = 1.2e-4
    discharge: float = 0.65
    oil_kg_per_m3: float = 862.0
    leak_m2: float = 0.0  # past the edge towards A
    supply_pa: float = 1.45e7
    sag_pa_s_per_m3: float = 1.5e9
    sag_lag_s: float = 0.03
    compensator_m: float = 2.0e-3  # its stroke; fully open at rest
    compensator_width_m: float = 1.5e-2
    compensator_m2: float = 2.0e-4
    compensator_pa: float = 7.0e5  # of its spring
    compensator_n_per_m: float = 2.0e4
    compensator_ns_per_m: float = 6000.0
    bleed_m2: float = 6.0e-7
    sensing_lag_s: float = 0.004
    load_a: float = 4.1e-7  # m³/s per √Pa
    load_b: float = 3.8e-7
    inlet_pa_per_m3: float = 3.0e12
    port_pa_per_m3: float = 1.6e12
    sensor_lag_s: float = 0.012


_Parameters = parameters_of(Unit)
SPREAD = {
    "overlap_a_m": 0.03,
    "overlap_b_m": 0.03,
    "coulomb_n": 0.2,
    "remanence": 0.2,
    "edge_m": 0.2,
    "lever_play_m": 0.3,
}


draw = drawing(Unit(), SPREAD, 0.05)


@njit(cache=True)
def _opening(p: Any, past_m: float, width_m: float) -> float:
    """Area of a straight edge, rounded over its radius."""
    return width_m * 0.5 * (past_m + math.sqrt(past_m * past_m + p.edge_m * p.edge_m))


_root = orifice_root(ROOT_PA)


@njit(cache=True)
def _spool(p: Any, s: Array, command: float, dt: float) -> None:
    """Coil and iron, lever with play, pilot, and a spool that sticks."""
    s[0] += (0.01 * command - s[0]) * dt / p.coil_lag_s
    s[1] = max(s[0] - p.remanence, min(s[0] + p.remanence, s[1]))
    s[4] = max(s[2] - p.lever_play_m, min(s[2] + p.lever_play_m, s[4]))
    push = p.pilot_n_per_m * (p.wanted_m * (s[1] + p.offset) - s[4])
    holds = p.coulomb_n * (p.breakaway if s[3] == 0.0 else 1.0)
    s[3] = 0.0 if abs(push) <= holds else (push - math.copysign(p.coulomb_n, push)) / p.spool_ns_per_m
    s[3] = max(-p.pilot_m_per_s, min(p.pilot_m_per_s, s[3]))
    s[2] = max(-p.stop_m, min(p.stop_m, s[2] + dt * s[3]))


@njit(cache=True)
def _step(p: Any, s: Array, command: float, dt: float) -> None:
    """Spool, compensator, pressures and sensor over one step."""
    _spool(p, s, command, dt)
    supply = p.supply_pa - p.sag_pa_s_per_m3 * s[10]
    speed = p.discharge * math.sqrt(2.0 / p.oil_kg_per_m3)
    drop = s[6] - s[9] - p.compensator_pa
    s[5] += dt * (p.compensator_m2 * drop - p.compensator_n_per_m * s[5]) / p.compensator_ns_per_m
    s[5] = max(0.0, min(p.compensator_m, s[5]))
    drawn = speed * p.compensator_width_m * (p.compensator_m - s[5]) * _root(supply - s[6])
    in_a = speed * (_opening(p, s[2] - p.overlap_a_m, p.width_a_m) + p.leak_m2) * _root(s[6] - s[7])
    in_b = speed * _opening(p, -s[2] - p.overlap_b_m, p.width_b_m) * _root(s[6] - s[8])
    out_a, out_b = p.load_a * _root(s[7]), p.load_b * _root(s[8])
    s[6] += dt * p.inlet_pa_per_m3 * (drawn - in_a - in_b - speed * p.bleed_m2 * _root(s[6]))
    s[7] += dt * p.port_pa_per_m3 * (in_a - out_a)
    s[8] += dt * p.port_pa_per_m3 * (in_b - out_b)
    s[9] += (max(s[7], s[8]) - s[9]) * dt / p.sensing_lag_s
    s[10] += (drawn - s[10]) * dt / p.sag_lag_s
    s[11] += (6.0e4 * (out_a - out_b) - s[11]) * dt / (p.sensor_lag_s + dt)


@njit(cache=True)
def _run(p: Any, command: Array, step_s: float, substeps: int) -> Array:
    out = np.empty(command.size)
    dt = step_s / substeps
    s = np.zeros(12)  # current, iron, spool, its speed, lever, compensator, inlet, ports, sensed, drawn, sensor
    for _ in range(int(SETTLE_S / dt)):
        _step(p, s, command[0], dt)
    for k in range(command.size):
        out[k] = s[11]
        for _ in range(substeps):
            _step(p, s, command[k], dt)
    return out


respond = answering(_run, _Parameters, CHANNELS, STEP_S, SUBSTEPS)
"""Flow, without noise, at the samples of a command in %."""


CHANGES = {
    "friction_rise": more(coulomb_n=60.0),
    "breakaway_rise": more(breakaway=25.0),
    "play": more(lever_play_m=0.6e-3),
    "magnetic_hysteresis": more(remanence=0.1),
    "slower_pilot": scaled(spool_ns_per_m=6.0),
    "edge_worn": more(edge_m=1.8e-3),
    "leakage": more(leak_m2=6.0e-6),
    "supply_sag": more(sag_pa_s_per_m3=4.0e10),
    "zero_shift": more(offset=0.12),
    "gain_loss": scaled(wanted_m=-0.25),
    "spring_weak": scaled(compensator_pa=-0.6),
    "asymmetry": scaled(width_a_m=-0.4),
    "stroke_stop": more(stop_m=-3.6e-3),
    "sensor_lag": more(sensor_lag_s=0.08),
}
