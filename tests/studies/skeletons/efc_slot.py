"""efc_slot: a magnet moves a sleeve along a slot; the pressure that it throttles pushes the sleeve back.

Cummins EFC after Tugsal 2009, taken as a **sliding throttle between pump and outlet**; textbook physics (Merritt;
bristle friction after Canudas de Wit). **What differs** from a curve followed by lags: the outlet's pressure acts on
a small face of the sleeve, which closes a loop; a slot whose width grows along it; a pump with a relief that gives the
pressure of the supply a speed of its own; a flux that lags and saturates; bristle friction from the start. 1.4, 1.6
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
SOFT_PSI = 0.6  # below this drop an orifice turns laminar


@dataclass(frozen=True)
class Unit:
    """One valve with its magnet, sleeve, slot, pump and outlet."""

    force_n_per_a: float = 7.5
    saturation_a: float = 2.9
    flux_lag_s: float = 0.01
    remanence_a: float = 0.002
    sleeve_kg: float = 0.012
    viscous_ns_per_m: float = 9.0
    spring_n_per_m: float = 3000.0
    preload_n: float = 9.6
    face_n_per_psi: float = 0.0035  # the outlet's pressure closes
    coulomb_n: float = 0.03
    breakaway: float = 1.3  # static over Coulomb
    stribeck_m_per_s: float = 0.005
    bristle_n_per_m: float = 2.5e4
    opening_n: float = 0.0  # more friction while it opens
    play_m: float = 0.0  # half width, between plunger and sleeve
    stop_m: float = 3.0e-3
    edge_m: float = 1.2e-4  # where the slot begins
    round_m: float = 4.0e-5
    slot: float = 2.6  # cm³/s per √psi at 1 mm
    taper: float = 1.35  # power of the slot's area along it
    leak: float = 0.03  # cm³/s per √psi
    outlet: float = 1.0
    outlet_cm3_per_psi: float = 0.004
    pump_cm3_per_s: float = 26.0
    relief_psi: float = 232.0
    relief: float = 0.9  # cm³/s per psi beyond it
    pump_cm3_per_psi: float = 0.01
    sensor_lag_s: float = 0.003


_Parameters = parameters_of(Unit)
SPREAD = {"preload_n": 0.012, "force_n_per_a": 0.012, "relief_psi": 0.02, "coulomb_n": 0.2, "saturation_a": 0.02}


draw = drawing(Unit(), SPREAD, 0.04)


_root = orifice_root(SOFT_PSI)


@njit(cache=True)
def _area(p: Any, x_m: float) -> float:
    """What the slot lets through at a place of the sleeve."""
    past = x_m - p.edge_m
    open_mm = 500.0 * (past + math.sqrt(past * past + p.round_m * p.round_m))
    return float(p.slot * open_mm**p.taper)


@njit(cache=True)
def _sleeve(p: Any, s: Array, current: float, dt: float) -> None:
    """Flux, plunger and sleeve over one step."""
    s[0] += (current - s[0]) * dt / p.flux_lag_s
    s[1] = max(s[0] - p.remanence_a, min(s[0] + p.remanence_a, s[1]))
    force = p.force_n_per_a * s[1] / (1.0 + (s[1] / p.saturation_a) ** 6) ** (1.0 / 6.0)
    v = s[3]
    level = p.coulomb_n * (1.0 + (p.breakaway - 1.0) * math.exp(-((v / p.stribeck_m_per_s) ** 2)))
    level += p.opening_n if v > 0.0 else 0.0
    s[4] = (s[4] + dt * v) / (1.0 + dt * p.bristle_n_per_m * abs(v) / level)
    net = force - p.preload_n - p.spring_n_per_m * s[2] - p.face_n_per_psi * s[6] - p.bristle_n_per_m * s[4]
    s[3] = (v + dt * net / p.sleeve_kg) / (1.0 + dt * p.viscous_ns_per_m / p.sleeve_kg)
    s[2] += dt * s[3]
    if s[2] < 0.0 or s[2] > p.stop_m:
        s[2], s[3] = min(max(s[2], 0.0), p.stop_m), 0.0
    s[5] = max(s[2] - p.play_m, min(s[2] + p.play_m, s[5]))


@njit(cache=True)
def _step(p: Any, s: Array, current: float, dt: float) -> None:
    """Sleeve, both pressures and the sensor over one step."""
    _sleeve(p, s, current, dt)
    through = (_area(p, s[5]) + p.leak) * _root(s[7] - s[6])
    s[6] += dt * (through - p.outlet * _root(s[6])) / p.outlet_cm3_per_psi
    spill = p.relief * max(s[7] - p.relief_psi, 0.0)
    s[7] += dt * (p.pump_cm3_per_s - spill - through) / p.pump_cm3_per_psi
    s[8] += (s[6] - s[8]) * dt / (p.sensor_lag_s + dt)


@njit(cache=True)
def _run(p: Any, command: Array, step_s: float, substeps: int) -> Array:
    out = np.empty(command.size)
    dt = step_s / substeps
    s = np.zeros(9)  # flux, what is left of it, plunger, its speed, bristle, sleeve, outlet, pump, sensor
    s[7] = p.relief_psi
    for _ in range(int(SETTLE_S / dt)):
        _step(p, s, command[0], dt)
    for k in range(command.size):
        out[k] = s[8]
        for _ in range(substeps):
            _step(p, s, command[k], dt)
    return out


respond = answering(_run, _Parameters, CHANNELS, STEP_S, SUBSTEPS)
"""Pressure, without noise, at the samples of a current in A."""


CHANGES = {
    "friction_rise": more(coulomb_n=0.7),
    "breakaway_rise": more(breakaway=14.0),
    "stiction_one_side": more(opening_n=0.9),
    "play": more(play_m=3.0e-4),
    "magnetic_hysteresis": more(remanence_a=0.08),
    "slower_pilot": scaled(flux_lag_s=1.5),
    "damping_change": scaled(viscous_ns_per_m=6.0),
    "edge_worn": more(round_m=1.0e-3),
    "leakage": more(leak=0.8),
    "supply_sag": scaled(pump_cm3_per_s=-0.7),
    "zero_shift": more(preload_n=1.0),
    "gain_loss": scaled(force_n_per_a=-0.2),
    "orifice_clogged": scaled(outlet=-0.5),
    "stroke_stop": more(stop_m=-2.4e-3),
    "sensor_lag": more(sensor_lag_s=0.06),
}
