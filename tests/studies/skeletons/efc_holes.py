"""efc_holes: a rotor's round hole passes a round hole, in series from a pump's plunger to injectors that beat.

Cummins EFC after Tugsal 2009, taken as a **throttle between two pressures**: a torque motor turns a shutter whose hole
uncovers one of the same size, a lens that grows; pump pressure is held by a plunger that lets the surplus go, and the
rail empties by **injectors that open in turn**, so the pressure beats with the engine. Textbook physics (Merritt;
Jelali and Kroll). **What differs** from a curve followed by lags: the curve is the lens against the injectors; eddy
currents give the torque a fast and a slow part; **torque grows with angle**, which is a spring of the wrong sign;
hysteresis follows the way the current has gone, without corners; a seal that creeps; a rail whose air makes it slower
the lower its pressure. 1.4, 1.6 and 2.0 A give about 26, 120 and 210 psi; the rest is assumed.
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
SOFT_PSI = 1.0  # below this drop an orifice turns laminar
ATMOSPHERE_PSI = 14.7


@dataclass(frozen=True)
class Unit:
    """One valve with its motor, shutter, holes, seal, pump, plunger, rail, injectors and sensor."""

    torque_mnm_per_a: float = 30.0
    torque_rise: float = 0.25  # per rad
    fast_s: float = 0.004
    slow_s: float = 0.03
    slow_share: float = 0.2  # of the torque, held back by eddy currents
    hysteresis_a: float = 0.004  # half width, once the current has gone far one way
    hysteresis_way_a: float = 0.05
    shutter_mnm_s2: float = 6.0e-4
    viscous_mnm_s: float = 0.25
    spring_mnm: float = 72.3  # per rad
    preload_mnm: float = 33.1
    jet_mnm: float = 0.008  # per cm³/s and √psi of flow, which closes
    coulomb_mnm: float = 0.08
    slip_mnm: float = 120.0  # per rad
    creep_mnm: float = 2.5  # of the seal, per rad
    creep_s: float = 0.12
    stop_rad: float = 0.7
    arm_mm: float = 5.0
    hole_mm: float = 1.0  # radius of both
    closed_mm: float = 0.3  # way until they meet
    round_mm: float = 0.05
    hole: float = 0.573  # cm³/s per √psi and mm²
    leak: float = 0.04  # cm³/s per √psi
    injectors: float = 0.6
    beat: float = 0.06
    beat_hz: float = 70.0
    rail_cm3_per_psi: float = 5.0e-4
    air_cm3_per_psi: float = 0.008  # at atmospheric pressure
    pump_cm3: float = 30.0
    pump_cm3_per_psi: float = 0.02
    plunger_psi: float = 223.0  # where it lifts
    plunger_cm3: float = 2.0  # per psi past it
    plunger_s: float = 0.01
    sensor_lag_s: float = 0.004


_Parameters = parameters_of(Unit)
SPREAD = {
    "torque_mnm_per_a": 0.01, "preload_mnm": 0.012, "plunger_psi": 0.02, "spring_mnm": 0.02, "hole_mm": 0.02,
    "arm_mm": 0.01, "injectors": 0.03, "coulomb_mnm": 0.25, "hysteresis_a": 0.25, "beat": 0.25, "leak": 0.2,
}  # fmt: skip


draw = drawing(Unit(), SPREAD, 0.04)


_root = orifice_root(SOFT_PSI)


@njit(cache=True)
def _hole(p: Any, angle: float) -> float:
    """What the lens of two round holes lets through at an angle of the shutter."""
    past = p.arm_mm * angle - p.closed_mm
    past = min(0.5 * (past + math.sqrt(past * past + p.round_mm**2)), 2.0 * p.hole_mm)
    half = 1.0 - 0.5 * past / p.hole_mm  # half the way between the centres over the radius
    lens = 2.0 * p.hole_mm**2 * (math.acos(half) - half * math.sqrt(max(1.0 - half * half, 0.0)))
    return float(p.hole * lens + p.leak)


@njit(cache=True)
def _torque(p: Any, s: Array, current: float, dt: float) -> float:
    """A fast and a slow part of the current, less what the iron keeps of the way it went."""
    before = s[0]
    s[0] += (current - s[0]) * dt / p.fast_s
    s[1] += (current - s[1]) * dt / p.slow_s
    way = s[0] - before
    s[2] += (math.copysign(p.hysteresis_a, way) - s[2]) * min(abs(way) / p.hysteresis_way_a, 1.0)
    held = (1.0 - p.slow_share) * s[0] + p.slow_share * s[1] - s[2]
    return float(p.torque_mnm_per_a * held * (1.0 + p.torque_rise * s[3]))


@njit(cache=True)
def _shutter(p: Any, s: Array, torque: float, jet: float, dt: float) -> None:
    """Shutter between motor, spring, jet, friction and a seal that creeps over one step."""
    reach = p.coulomb_mnm / p.slip_mnm
    s[5] = max(-reach, min(s[5] + dt * s[4], reach))
    s[6] += (s[3] - s[6]) * dt / p.creep_s
    held = p.spring_mnm * s[3] + p.slip_mnm * s[5] + p.creep_mnm * (s[3] - s[6])
    net = torque - p.preload_mnm - held - jet
    s[4] = (s[4] + dt * net / p.shutter_mnm_s2) / (1.0 + dt * p.viscous_mnm_s / p.shutter_mnm_s2)
    s[3] += dt * s[4]
    if s[3] < 0.0 or s[3] > p.stop_rad:
        s[3], s[4] = min(max(s[3], 0.0), p.stop_rad), 0.0


@njit(cache=True)
def _step(p: Any, s: Array, current: float, dt: float) -> None:
    """Motor, shutter, pump, plunger, rail, injectors and sensor over one step."""
    drop = s[7] - s[9]
    fed = _hole(p, s[3]) * _root(drop)
    _shutter(p, s, _torque(p, s, current, dt), p.jet_mnm * fed * math.sqrt(abs(drop)), dt)
    s[8] += (p.plunger_cm3 * max(s[7] - p.plunger_psi, 0.0) - s[8]) * dt / p.plunger_s
    s[7] = max(s[7] + dt * (p.pump_cm3 - fed - s[8]) / p.pump_cm3_per_psi, 0.0)
    s[11] += dt * p.beat_hz
    s[11] -= math.floor(s[11])
    turn = math.sin(2.0 * math.pi * s[11])
    used = p.injectors * (1.0 + p.beat * turn * (1.0 + 0.4 * turn)) * _root(s[9])
    air = p.air_cm3_per_psi * (ATMOSPHERE_PSI / (ATMOSPHERE_PSI + s[9])) ** 2
    s[9] = max(s[9] + dt * (fed - used) / (p.rail_cm3_per_psi + air), 0.0)
    s[10] += (s[9] - s[10]) * dt / p.sensor_lag_s


@njit(cache=True)
def _run(p: Any, command: Array, step_s: float, substeps: int) -> Array:
    out = np.empty(command.size)
    dt = step_s / substeps
    # current's fast and slow part, hysteresis, shutter, its speed, friction, seal, pump, plunger, rail, sensor, beat
    s = np.zeros(12)
    s[7] = p.plunger_psi
    for _ in range(int(SETTLE_S / dt)):
        _step(p, s, command[0], dt)
    for k in range(command.size):
        out[k] = s[10]
        for _ in range(substeps):
            _step(p, s, command[k], dt)
    return out


respond = answering(_run, _Parameters, CHANNELS, STEP_S, SUBSTEPS)
"""Pressure of the rail, without noise, at the samples of a current in A."""


CHANGES = {
    "friction_rise": more(coulomb_mnm=2.0),
    "magnetic_hysteresis": more(hysteresis_a=0.08),
    "slower_pilot": more(fast_s=0.05, slow_s=0.05),
    "damping_change": scaled(viscous_mnm_s=12.0),
    "edge_worn": more(round_mm=0.5),
    "leakage": more(leak=0.5),
    "supply_sag": scaled(plunger_psi=-0.3),
    "zero_shift": more(preload_mnm=2.5),
    "gain_loss": scaled(torque_mnm_per_a=-0.12),
    "spring_weak": scaled(spring_mnm=-0.35),
    "orifice_clogged": scaled(hole=-0.5),
    "nozzles_worn": scaled(injectors=0.6),
    "stroke_stop": more(stop_rad=-0.5),
    "air_in_rail": more(rail_cm3_per_psi=0.01),
    "beat_rise": scaled(beat=8.0),
    "sensor_lag": more(sensor_lag_s=0.06),
}
