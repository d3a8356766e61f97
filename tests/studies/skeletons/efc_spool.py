"""efc_spool: a rotor closes a spill port behind a fixed orifice; a line with inertia leads to the rail.

Cummins EFC after Tugsal 2009, taken as a **half bridge**: the pump feeds a chamber through a fixed orifice, and a
rotary spool under a torque motor closes a V-shaped port through which the chamber spills; textbook physics (Merritt;
bristle friction after Canudas de Wit). **What differs** from a curve followed by lags: the curve is the ratio of two
orifices; chamber, **inertia of the line** and rail are states that ring; the jet of the spill helps the motor the less
the further it closes, which leads flow and pressure back; a flux that lags, saturates and remembers by three plays;
bristle friction from the start; a pump that sags most where pressure is low. 1.4, 1.6 and 2.0 A give about 26, 120
and 210 psi; the rest is assumed.
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
    """One valve with its motor, rotor, spill port, chamber, line, rail, pump and sensor."""

    torque_mnm_per_a: float = 20.0
    saturation_a: float = 3.2
    flux_lag_s: float = 0.006
    remanence_a: float = 0.004  # half width of the widest of three plays
    rotor_mnm_s2: float = 9.0e-4
    viscous_mnm_s: float = 0.26
    spring_mnm: float = 43.0  # per rad
    preload_mnm: float = 22.0
    jet_mnm: float = 0.009  # per cm³/s and √psi of spill, which closes
    coulomb_mnm: float = 0.06
    breakaway: float = 1.3  # static over Coulomb
    stribeck_per_s: float = 1.0
    bristle_mnm: float = 400.0  # per rad
    stop_rad: float = 0.6
    edge_rad: float = 0.365  # where the port is closed
    round_rad: float = 0.03
    spill: float = 136.0  # cm³/s per √psi at 1 rad of opening
    vee: float = 2.0  # power of the port's area along it
    leak: float = 0.02  # cm³/s per √psi
    feed: float = 2.2
    outlet: float = 0.587
    chamber_cm3_per_psi: float = 0.002
    line_psi_s2_per_cm3: float = 0.04
    line_loss: float = 0.4  # psi per cm³/s
    line_turbulence: float = 0.01  # psi per (cm³/s)²
    rail_cm3_per_psi: float = 0.0022
    pump_psi: float = 233.0
    sag_psi_s_per_cm3: float = 0.25
    pump_lag_s: float = 0.04
    sensor_lag_s: float = 0.003  # of its line


_Parameters = parameters_of(Unit)
SPREAD = {
    "torque_mnm_per_a": 0.012, "preload_mnm": 0.012, "pump_psi": 0.02, "edge_rad": 0.02, "spring_mnm": 0.02,
    "feed": 0.02, "coulomb_mnm": 0.2, "remanence_a": 0.2,
}  # fmt: skip


draw = drawing(Unit(), SPREAD, 0.04)


_root = orifice_root(SOFT_PSI)


@njit(cache=True)
def _port(p: Any, angle: float) -> float:
    """What the V lets through at an angle of the rotor."""
    past = p.edge_rad - angle
    return float(p.spill * (0.5 * (past + math.sqrt(past * past + p.round_rad**2))) ** p.vee + p.leak)


@njit(cache=True)
def _torque(p: Any, s: Array, current: float, dt: float) -> float:
    """Flux behind the current, through three plays of unequal width, saturated."""
    s[0] += (current - s[0]) * dt / p.flux_lag_s
    held = 0.0
    for k in range(3):
        width = p.remanence_a * (k + 1) / 3.0
        s[1 + k] = max(s[0] - width, min(s[0] + width, s[1 + k]))
        held += s[1 + k] / 3.0
    return float(p.torque_mnm_per_a * held / (1.0 + (held / p.saturation_a) ** 6) ** (1.0 / 6.0))


@njit(cache=True)
def _rotor(p: Any, s: Array, torque: float, jet: float, dt: float) -> None:
    """Rotor between motor, spring, jet and friction over one step."""
    v = s[5]
    level = p.coulomb_mnm * (1.0 + (p.breakaway - 1.0) * math.exp(-((v / p.stribeck_per_s) ** 2)))
    s[6] = (s[6] + dt * v) / (1.0 + dt * p.bristle_mnm * abs(v) / level)
    net = torque - p.preload_mnm - p.spring_mnm * s[4] + jet - p.bristle_mnm * s[6]
    s[5] = (v + dt * net / p.rotor_mnm_s2) / (1.0 + dt * p.viscous_mnm_s / p.rotor_mnm_s2)
    s[4] += dt * s[5]
    if s[4] < 0.0 or s[4] > p.stop_rad:
        s[4], s[5] = min(max(s[4], 0.0), p.stop_rad), 0.0


@njit(cache=True)
def _step(p: Any, s: Array, current: float, dt: float) -> None:
    """Motor, rotor, chamber, line, rail, pump and sensor over one step."""
    spilt = _port(p, s[4]) * _root(s[7])
    _rotor(p, s, _torque(p, s, current, dt), p.jet_mnm * spilt * math.sqrt(s[7]), dt)
    fed = p.feed * _root(s[10] - s[7])
    s[7] = max(s[7] + dt * (fed - spilt - s[8]) / p.chamber_cm3_per_psi, 0.0)
    loss = p.line_loss + p.line_turbulence * abs(s[8])
    s[8] = (s[8] + dt * (s[7] - s[9]) / p.line_psi_s2_per_cm3) / (1.0 + dt * loss / p.line_psi_s2_per_cm3)
    s[9] = max(s[9] + dt * (s[8] - p.outlet * _root(s[9])) / p.rail_cm3_per_psi, 0.0)
    s[10] += (p.pump_psi - p.sag_psi_s_per_cm3 * fed - s[10]) * dt / p.pump_lag_s
    s[11] += (s[9] - s[11]) * dt / p.sensor_lag_s


@njit(cache=True)
def _run(p: Any, command: Array, step_s: float, substeps: int) -> Array:
    out = np.empty(command.size)
    dt = step_s / substeps
    s = np.zeros(12)  # flux, its plays (three), rotor, its speed, bristle, chamber, line, rail, pump, sensor
    s[10] = p.pump_psi
    for _ in range(int(SETTLE_S / dt)):
        _step(p, s, command[0], dt)
    for k in range(command.size):
        out[k] = s[11]
        for _ in range(substeps):
            _step(p, s, command[k], dt)
    return out


respond = answering(_run, _Parameters, CHANNELS, STEP_S, SUBSTEPS)
"""Pressure of the rail, without noise, at the samples of a current in A."""


CHANGES = {
    "friction_rise": more(coulomb_mnm=1.5),
    "breakaway_rise": more(breakaway=20.0),
    "magnetic_hysteresis": more(remanence_a=0.1),
    "slower_pilot": more(flux_lag_s=0.05),
    "damping_change": scaled(viscous_mnm_s=8.0),
    "edge_worn": more(round_rad=0.2),
    "leakage": more(leak=1.5),
    "supply_sag": more(sag_psi_s_per_cm3=3.0),
    "zero_shift": more(preload_mnm=2.5),
    "gain_loss": scaled(torque_mnm_per_a=-0.15),
    "spring_weak": scaled(spring_mnm=-0.35),
    "orifice_clogged": scaled(feed=-0.5),
    "stroke_stop": more(stop_rad=-0.4),
    "line_longer": scaled(line_psi_s2_per_cm3=5.0, line_loss=0.5),
    "sensor_lag": more(sensor_lag_s=0.06),
}
