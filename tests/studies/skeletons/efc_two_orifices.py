"""efc_two_orifices: a rotary fuel valve and the rail's outlet as two orifices in series.

Cummins EFC (Tugsal 2009); textbook physics (Merritt; LuGre friction after Canudas de Wit et al.). **What differs**
from a curve followed by lags: the pressure is the one between two turbulent orifices with a line volume, so its
speed depends on where it is; a shaft with inertia, preloaded spring, stops and a little bristle friction; torque
from a flux that lags, saturates and remembers; a barrel that hangs on the shaft and opens a port of curved edge; a
little leakage from the start. After the thesis 1.4, 1.6 and 2.0 A give about 26, 120 and 210 psi; inertia, spring,
port and line are assumed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from tests.studies.skeletons import Array, answering, drawing, more, parameters_of, scaled

PLANT = "cummins-efc"
CHANNELS = {"current": "A", "pressure": "psi"}
STEP_S = 0.002
NOISE = {"pressure": 0.4}
SUBSTEPS = 50  # 25 kHz
SETTLE_S = 1.5
SOFT_PSI = 0.5  # below this drop an orifice turns laminar


@dataclass(frozen=True)
class Unit:
    """One valve with its shaft, coil, port, line and outlet."""

    torque_nm_per_a: float = 0.05
    saturation_a: float = 2.6
    flux_lag_s: float = 0.011
    remanence_a: float = 0.0025
    remanence_span_a: float = 0.12
    inertia_kgm2: float = 2.5e-6
    viscous_nms: float = 6.0e-4
    spring_nm: float = 0.068  # per radian
    preload_nm: float = 0.0515
    coulomb_nm: float = 2.0e-4
    breakaway: float = 1.3  # static over Coulomb
    opening_nm: float = 0.0  # more friction while it opens
    stribeck_rad_per_s: float = 0.3
    bristle_nm: float = 0.25  # per radian
    bristle_nms: float = 3.0e-4
    play_rad: float = 0.0  # half width, between shaft and barrel
    stop_rad: float = 0.60
    edge_rad: float = 0.075  # where the port begins to open
    round_rad: float = 0.012
    full_rad: float = 0.60
    port: float = 5.0  # cm³/s per √psi at that angle
    port_power: float = 2.0
    outlet: float = 1.17
    leak: float = 0.005  # cm³/s per psi, past the barrel
    line_cm3_per_psi: float = 0.004
    supply_psi: float = 228.0
    sag_psi: float = 0.3  # per cm³/s
    sag_lag_s: float = 0.02
    sensor_lag_s: float = 0.003


_Parameters = parameters_of(Unit)
SPREAD = {"preload_nm": 0.015, "torque_nm_per_a": 0.015, "supply_psi": 0.02, "coulomb_nm": 0.2, "stop_rad": 0.01}


draw = drawing(Unit(), SPREAD, 0.04)


@njit(cache=True)
def _orifice(gain: float, drop_psi: float) -> float:
    """Turbulent flow, laminar near nothing."""
    return float(gain * drop_psi / (drop_psi * drop_psi + SOFT_PSI * SOFT_PSI) ** 0.25)


@njit(cache=True)
def _torque(p: Any, s: Array, current: float, dt: float) -> float:
    """Torque of a flux that lags behind the current, saturates and remembers."""
    moved = (current - s[0]) * dt / (p.flux_lag_s + dt)
    s[0] += moved
    pull = p.remanence_a if moved > 0.0 else -p.remanence_a
    s[1] += (1.0 - math.exp(-abs(moved) / p.remanence_span_a)) * (pull - s[1])
    field = max(0.0, s[0] - s[1])
    return float(p.torque_nm_per_a * field / (1.0 + (field / p.saturation_a) ** 4) ** 0.25)


@njit(cache=True)
def _shaft(p: Any, s: Array, torque: float, dt: float) -> None:
    """Shaft against spring, oil, bristles and stops, and the barrel it carries along."""
    v = s[3]
    grip = p.coulomb_nm * (1.0 + (p.breakaway - 1.0) * math.exp(-((v / p.stribeck_rad_per_s) ** 2)))
    grip += p.opening_nm if v > 0.0 else 0.0
    before = s[4]
    s[4] = (before + dt * v) / (1.0 + dt * p.bristle_nm * abs(v) / grip)
    friction = p.bristle_nm * s[4] + p.bristle_nms * (s[4] - before) / dt
    push = torque - p.preload_nm - p.spring_nm * s[2] - friction
    s[3] = (v + dt * push / p.inertia_kgm2) / (1.0 + dt * p.viscous_nms / p.inertia_kgm2)
    s[2] += dt * s[3]
    if s[2] < 0.0 or s[2] > p.stop_rad:
        s[2] = max(0.0, min(p.stop_rad, s[2]))
        s[3] = 0.0
    s[5] = max(s[2] - p.play_rad, min(s[2] + p.play_rad, s[5]))


@njit(cache=True)
def _step(p: Any, s: Array, current: float, dt: float) -> None:
    """Coil, shaft, both orifices with the line between them, and sensor over one step."""
    _shaft(p, s, _torque(p, s, current, dt), dt)
    past = s[5] - p.edge_rad
    open_rad = 0.5 * (past + math.sqrt(past * past + p.round_rad * p.round_rad))
    port = p.port * (open_rad / p.full_rad) ** p.port_power
    drop = p.supply_psi - p.sag_psi * s[6] - s[7]
    inflow = _orifice(port, drop) + p.leak * drop
    s[6] += (inflow - s[6]) * dt / p.sag_lag_s
    s[7] += dt * (inflow - _orifice(p.outlet, s[7])) / p.line_cm3_per_psi
    s[8] += (s[7] - s[8]) * dt / (p.sensor_lag_s + dt)


@njit(cache=True)
def _run(p: Any, current: Array, step_s: float, substeps: int) -> Array:
    out = np.empty(current.size)
    dt = step_s / substeps
    s = np.zeros(9)  # lagged current, remanence, shaft, speed, bristle, barrel, drawn, line, sensor
    for _ in range(int(SETTLE_S / dt)):
        _step(p, s, current[0], dt)
    for k in range(current.size):
        out[k] = s[-1]
        for _ in range(substeps):
            _step(p, s, current[k], dt)
    return out


respond = answering(_run, _Parameters, CHANNELS, STEP_S, SUBSTEPS)
"""Rail pressure, without noise, at the samples of a coil current in A."""


CHANGES = {
    "friction_rise": more(coulomb_nm=5.0e-3),
    "breakaway_rise": more(breakaway=18.0),
    "stiction_one_side": more(opening_nm=7.0e-3),
    "play": more(play_rad=0.07),
    "magnetic_hysteresis": more(remanence_a=0.09),
    "slower_pilot": scaled(flux_lag_s=0.6),
    "damping_change": scaled(viscous_nms=4.0),
    "edge_worn": more(round_rad=0.25),
    "leakage": more(leak=0.04),
    "supply_sag": more(sag_psi=4.0),
    "zero_shift": more(preload_nm=6.0e-3),
    "gain_loss": scaled(torque_nm_per_a=-0.25),
    "orifice_clogged": scaled(outlet=-0.5),
    "stroke_stop": more(stop_rad=-0.35),
    "sensor_lag": more(sensor_lag_s=0.06),
}
