"""efc_pilot_bleed: a magnet holds a bleed shut; what that leaves in a chamber pushes a piston against the rail.

Cummins EFC after Tugsal 2009, taken as a **pilot-operated pressure regulator**; textbook physics (Merritt; bristle
friction after Canudas de Wit). **What differs** from a curve followed by lags: two stages, the second closed over the
rail's pressure on a face that is larger than that of the chamber; a chamber that fills through a fixed orifice; a
rail that can only empty through its outlet; a pump whose pressure gives way; bristle friction from the start. 1.4, 1.6
and 2.0 A give about 26, 120 and 210 psi; masses, faces and volumes are assumed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from tests.studies.skeletons import Array, answering, drawing, more, orifice_root, parameters_of, scaled

PLANT = "cummins-efc"
CHANNELS = {"current": "A", "pressure": "psi"}
STEP_S = 0.002
NOISE = {"pressure": 0.4}
SUBSTEPS = 50  # 25 kHz
SETTLE_S = 1.0
SOFT_PSI = 2.0  # below this drop an orifice turns laminar
N_PER_PSI_CM2 = 0.6895


@dataclass(frozen=True)
class Unit:
    """One valve with its magnet, bleed, chamber, piston and rail; orifices in cm³/s per √psi."""

    bleed_psi_per_a: float = 610.0  # what the magnet holds, over its seat
    saturation_a: float = 1.74
    preload_psi: float = 812.0  # of the spring that opens the bleed
    flux_lag_s: float = 0.006
    remanence_a: float = 0.003
    bleed_lag_s: float = 0.001
    bleed_span_psi: float = 20.0
    bleed: float = 0.5
    feed: float = 0.25
    chamber_psi_per_cm3: float = 3.0e3
    face_cm2: float = 0.8
    rail_face_cm2: float = 0.86
    piston_kg: float = 0.02
    viscous_ns_per_m: float = 40.0
    spring_n_per_m: float = 2500.0
    preload_n: float = 2.0
    coulomb_n: float = 0.25
    breakaway: float = 1.3  # static over Coulomb
    stribeck_m_per_s: float = 0.003
    bristle_n_per_m: float = 3.0e4
    opening_n: float = 0.0  # more friction while it opens
    stop_m: float = 1.6e-3
    overlap_m: float = 0.2e-3
    slot_per_m: float = 9.0e3
    round_m: float = 3.0e-5
    leak: float = 0.01
    outlet: float = 1.1
    rail_psi_per_cm3: float = 1.1e3
    pump_psi: float = 285.0
    pump_psi_s_per_cm3: float = 1.5
    pump_lag_s: float = 0.02
    sensor_lag_s: float = 0.003


_Parameters = parameters_of(Unit)
SPREAD = {"bleed_psi_per_a": 0.01, "preload_psi": 0.01, "saturation_a": 0.02, "coulomb_n": 0.2, "remanence_a": 0.2}


draw = drawing(Unit(), SPREAD, 0.05)


_root = orifice_root(SOFT_PSI)


@njit(cache=True)
def _pilot(p: Any, s: Array, current: float, supply: float, dt: float) -> None:
    """Magnet, bleed and the chamber that the piston's way fills and empties."""
    s[0] += (current - s[0]) * dt / p.flux_lag_s
    s[1] = max(s[0] - p.remanence_a, min(s[0] + p.remanence_a, s[1]))
    flux = s[1] / (1.0 + (max(s[1], 0.0) / p.saturation_a) ** 12) ** (1.0 / 12.0)
    held = p.bleed_psi_per_a * flux - p.preload_psi
    s[2] += ((s[3] - held) / p.bleed_span_psi - s[2]) * dt / p.bleed_lag_s
    s[2] = max(0.0, min(4.0, s[2]))
    flow = p.feed * _root(supply - s[3]) - p.bleed * s[2] * _root(s[3]) - 100.0 * p.face_cm2 * s[5]
    s[3] = max(0.0, s[3] + dt * p.chamber_psi_per_cm3 * flow)


@njit(cache=True)
def _step(p: Any, s: Array, current: float, dt: float) -> None:
    """Pilot, piston, rail, pump and sensor over one step."""
    supply = p.pump_psi - p.pump_psi_s_per_cm3 * s[8]
    _pilot(p, s, current, supply, dt)
    v = s[5]
    level = p.coulomb_n * (1.0 + (p.breakaway - 1.0) * math.exp(-((v / p.stribeck_m_per_s) ** 2)))
    level += p.opening_n if v > 0.0 else 0.0
    s[6] = (s[6] + dt * v) / (1.0 + dt * p.bristle_n_per_m * abs(v) / level)
    net = N_PER_PSI_CM2 * (p.face_cm2 * s[3] - p.rail_face_cm2 * s[7]) - p.preload_n
    net -= p.spring_n_per_m * s[4] + p.bristle_n_per_m * s[6]
    s[5] = (v + dt * net / p.piston_kg) / (1.0 + dt * p.viscous_ns_per_m / p.piston_kg)
    s[4] += dt * s[5]
    if s[4] < 0.0 or s[4] > p.stop_m:
        s[4], s[5] = max(0.0, min(p.stop_m, s[4])), 0.0
    past = s[4] - p.overlap_m
    slot = p.slot_per_m * 0.5 * (past + math.sqrt(past * past + p.round_m * p.round_m)) + p.leak
    drawn = slot * _root(supply - s[7])
    s[7] += dt * p.rail_psi_per_cm3 * (drawn - p.outlet * _root(s[7]))
    s[8] += (drawn - s[8]) * dt / p.pump_lag_s
    s[9] += (s[7] - s[9]) * dt / (p.sensor_lag_s + dt)


@njit(cache=True)
def _run(p: Any, command: Array, step_s: float, substeps: int) -> Array:
    out = np.empty(command.size)
    dt = step_s / substeps
    s = np.zeros(10)  # current, iron, bleed, chamber, piston, its speed, bristle, rail, flow drawn, sensor
    for _ in range(int(SETTLE_S / dt)):
        _step(p, s, command[0], dt)
    for k in range(command.size):
        out[k] = s[9]
        for _ in range(substeps):
            _step(p, s, command[k], dt)
    return out


respond = answering(_run, _Parameters, CHANNELS, STEP_S, SUBSTEPS)
"""Pressure, without noise, at the samples of a command in A."""


CHANGES = {
    "friction_rise": more(coulomb_n=12.0),
    "breakaway_rise": more(breakaway=40.0),
    "stiction_one_side": more(opening_n=14.0),
    "magnetic_hysteresis": more(remanence_a=0.08),
    "slower_pilot": scaled(flux_lag_s=5.0),
    "feed_clogged": scaled(feed=-0.8),
    "damping_change": scaled(viscous_ns_per_m=20.0),
    "leakage": more(leak=0.8),
    "supply_sag": scaled(pump_psi=-0.5),
    "zero_shift": more(preload_n=20.0),
    "gain_loss": scaled(bleed_psi_per_a=-0.12),
    "stroke_stop": more(stop_m=-1.3e-3),
    "sensor_lag": more(sensor_lag_s=0.06),
}
