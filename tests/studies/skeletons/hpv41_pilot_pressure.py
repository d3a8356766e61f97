"""hpv41_pilot_pressure: pilot pressures on both ends of the spool, and a compensator with a life of its own.

Brevini HPV41 (Tørdal, Klausen, Bak); textbook physics (Merritt; LuGre friction after Canudas de Wit et al.). **What
differs** from a chain of filters and a curve: two pressure reducing valves fill two end chambers through turbulent
orifices, and the chambers' pressures move a spool with mass against a spring and bristle friction, without a loop
around the position; the compensator is a second orifice in series with the metering edge whose opening follows the
drop across it with a delay; the two edges and springs are unequal; supply and return lines cost pressure. 100 % is
about 70 l/min, the dead band about ±28 %. The paper states no masses, springs or pilot pressures: these are
assumed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from tests.studies.skeletons import Array, answering, divided, drawing, more, parameters_of, scaled

PLANT = "brevini-hpv41"
CHANNELS = {"command": "%", "flow": "l/min"}
STEP_S = 0.004
NOISE = {"flow": 0.25}
SUBSTEPS = 100  # 25 kHz
SETTLE_S = 3.0
LPM = 6.0e4  # l/min in m³/s
SOFT_PA = 8.0e4  # below this drop a pilot orifice turns laminar


@dataclass(frozen=True)
class Unit:
    """One valve with its pilot stage, spool and compensator."""

    pilot_pa: float = 1.75e6  # reduced pressure at 100 %
    bias_pa: float = 1.5e5  # in both chambers at rest
    reducer_rad_per_s: float = 38.0
    reducer_damping: float = 0.6
    orifice_a: float = 9.0e-9  # m³/s per √Pa
    orifice_b: float = 9.0e-9
    chamber_m3: float = 8.0e-6
    pilot_bulk_pa: float = 6.0e7  # oil with some air
    end_m2: float = 4.9e-4
    spool_kg: float = 0.4
    spool_ns_per_m: float = 500.0
    spring_a_n_per_m: float = 1.18e5
    spring_b_n_per_m: float = 1.23e5
    neutral_m: float = 0.0
    coulomb_n: float = 9.0
    breakaway: float = 1.4  # static over Coulomb
    one_side_n: float = 0.0  # more friction while it moves towards A
    stribeck_m_per_s: float = 0.004
    bristle_n_per_m: float = 1.0e6
    bristle_ns_per_m: float = 300.0
    play_m: float = 0.0  # half width, between the driven and the metering part of the spool
    stop_m: float = 7.0e-3
    overlap_a_m: float = 1.9e-3
    overlap_b_m: float = 2.05e-3
    width_a: float = 2.6e-4  # m³/s per (m √Pa)
    width_b: float = 2.75e-4
    edge_m: float = 7.0e-5
    leak: float = 0.0  # m³/s per √Pa, past the edge towards A
    compensator: float = 3.0e-6  # m³/s per √Pa, wide open
    compensator_pa: float = 7.5e5  # drop that closes it
    compensator_span_pa: float = 1.5e5  # more of a drop than when wide open
    compensator_lag_s: float = 0.022
    supply_pa: float = 1.0e7
    sag_pa_per_lpm: float = 1.0e4
    sag_lag_s: float = 0.02
    line_pa_per_lpm2: float = 300.0
    sensor_lag_s: float = 0.008


_Parameters = parameters_of(Unit)
SPREAD = {"overlap_a_m": 0.03, "overlap_b_m": 0.03, "coulomb_n": 0.2, "edge_m": 0.2, "pilot_pa": 0.03, "stop_m": 0.01}


draw = drawing(Unit(), SPREAD, 0.04)


@njit(cache=True)
def _orifice(gain: float, drop_pa: float) -> float:
    """Turbulent flow, laminar near nothing."""
    return float(gain * drop_pa / (drop_pa * drop_pa + SOFT_PA * SOFT_PA) ** 0.25)


@njit(cache=True)
def _edge(past_m: float, radius_m: float) -> float:
    """Opening of a rounded straight edge."""
    return 0.5 * (past_m + math.sqrt(past_m * past_m + radius_m * radius_m))


@njit(cache=True)
def _pilot(p: Any, s: Array, command: float, dt: float) -> None:
    """Reducing valves and both chambers."""
    w = p.reducer_rad_per_s
    for i in range(2):
        wanted = p.bias_pa + p.pilot_pa * max(0.0, command if i == 0 else -command) * 0.01
        s[2 + i] += dt * w * (w * (wanted - s[i]) - 2.0 * p.reducer_damping * s[2 + i])
        s[i] += dt * s[2 + i]
        inflow = _orifice(p.orifice_a if i == 0 else p.orifice_b, s[i] - s[4 + i])
        swept = p.end_m2 * s[7] * (1.0 if i == 0 else -1.0)
        s[4 + i] = max(0.0, s[4 + i] + dt * p.pilot_bulk_pa / p.chamber_m3 * (inflow - swept))


@njit(cache=True)
def _spool(p: Any, s: Array, dt: float) -> None:
    """Spool with spring, bristles and stops, and the metering part it carries along."""
    v = s[7]
    grip = p.coulomb_n * (1.0 + (p.breakaway - 1.0) * math.exp(-((v / p.stribeck_m_per_s) ** 2)))
    grip += p.one_side_n if v > 0.0 else 0.0
    before = s[8]
    s[8] = (before + dt * v) / (1.0 + dt * p.bristle_n_per_m * abs(v) / grip)
    friction = p.bristle_n_per_m * s[8] + p.bristle_ns_per_m * (s[8] - before) / dt
    away = s[6] - p.neutral_m
    spring = (p.spring_a_n_per_m if away > 0.0 else p.spring_b_n_per_m) * away
    force = p.end_m2 * (s[4] - s[5]) - spring - friction
    s[7] = (v + dt * force / p.spool_kg) / (1.0 + dt * p.spool_ns_per_m / p.spool_kg)
    s[6] += dt * s[7]
    if abs(s[6]) > p.stop_m:
        s[6] = math.copysign(p.stop_m, s[6])
        s[7] = 0.0
    s[9] = max(s[6] - p.play_m, min(s[6] + p.play_m, s[9]))


@njit(cache=True)
def _step(p: Any, s: Array, command: float, dt: float) -> None:
    """Pilot, spool, compensator, flow and sensor over one step."""
    _pilot(p, s, command, dt)
    _spool(p, s, dt)
    a = p.width_a * _edge(s[9] - p.overlap_a_m, p.edge_m) + p.leak
    b = p.width_b * _edge(-s[9] - p.overlap_b_m, p.edge_m)
    meter = max(a, b)  # the edge that the load line sees
    second = p.compensator * s[10] * s[10]
    resist = 1.0 / meter**2 + 1.0 / second**2 + p.line_pa_per_lpm2 * LPM**2
    through = math.sqrt(max(p.supply_pa - p.sag_pa_per_lpm * s[11], 1.0e5) / resist)
    drop = (through / meter) ** 2
    target = (p.compensator_pa - drop) / p.compensator_span_pa + 1.0
    s[10] = max(0.02, min(1.0, s[10] + dt / p.compensator_lag_s * (max(-20.0, min(20.0, target)) - s[10])))
    flow = LPM * (a - b) * math.sqrt(drop)
    s[11] += (LPM * through - s[11]) * dt / p.sag_lag_s
    s[12] += (flow - s[12]) * dt / (p.sensor_lag_s + dt)


@njit(cache=True)
def _run(p: Any, command: Array, step_s: float, substeps: int) -> Array:
    out = np.empty(command.size)
    dt = step_s / substeps
    s = np.zeros(13)  # reduced a, b, rates, chambers a, b, spool, speed, bristle, metering, compensator, drawn, sensor
    s[0] = s[1] = s[4] = s[5] = p.bias_pa
    s[10] = 0.1
    for _ in range(int(SETTLE_S / dt)):
        _step(p, s, command[0], dt)
    for k in range(command.size):
        out[k] = s[12]
        for _ in range(substeps):
            _step(p, s, command[k], dt)
    return out


respond = answering(_run, _Parameters, CHANNELS, STEP_S, SUBSTEPS)
"""Flow, without noise, at the samples of a command in %."""


CHANGES = {
    "friction_rise": more(coulomb_n=110.0),
    "breakaway_rise": more(breakaway=9.0),
    "stiction_one_side": more(one_side_n=150.0),
    "play": more(play_m=0.7e-3),
    "slower_pilot": divided(reducer_rad_per_s=0.6),
    "damping_change": scaled(reducer_damping=-0.6),
    "orifice_clogged": scaled(orifice_a=-0.6),
    "edge_worn": more(edge_m=1.8e-3),
    "leakage": more(leak=1.6e-7),
    "supply_sag": more(sag_pa_per_lpm=1.6e5),
    "zero_shift": more(neutral_m=0.8e-3),
    "gain_loss": scaled(pilot_pa=-0.25),
    "asymmetry": scaled(spring_b_n_per_m=0.4),
    "stroke_stop": more(stop_m=-2.8e-3),
    "sensor_lag": more(sensor_lag_s=0.08),
}
