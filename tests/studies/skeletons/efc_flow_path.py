"""efc_flow_path: a rotary fuel valve in a whole flow path from the pump to the injectors.

Cummins EFC (Tugsal 2009); textbook physics (Merritt; Jelali & Kroll; Armstrong). **What differs** from a curve
followed by lags: torque grows with the square of the current and falls with the angle; oil torque closes the shaft
as flow and drop rise; a little friction that really sticks, with viscous drag, from the start; a round port that a
barrel uncovers; a pump's filter, the port, a leak path around it and the injectors each take their share, with a
compressibility that changes with pressure; flow through the port chokes once it cavitates, a check valve stops it
from running back, and a relief valve limits the rail. After the thesis 1.4, 1.6 and 2.0 A give about 26, 120 and
210 psi; the rest is assumed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from tests.studies.skeletons import Array, answering, drawing, fading, more, parameters_of, scaled

PLANT = "cummins-efc"
CHANNELS = {"current": "A", "pressure": "psi"}
STEP_S = 0.002
NOISE = {"pressure": 0.4}
SUBSTEPS = 40  # 20 kHz
SETTLE_S = 1.5
ATMOSPHERE_PSI = 14.7
SOFT_PSI = 0.5  # below this drop an orifice turns laminar


@dataclass(frozen=True)
class Unit:
    """One valve with its shaft, coil, port and the path around it."""

    torque_nm_per_a2: float = 0.03
    torque_fall: float = 0.3  # per radian
    coil_lag_s: float = 0.014
    remanence_a: float = 0.002
    inertia_kgm2: float = 3.5e-6
    viscous_nms: float = 1.1e-3
    spring_nm: float = 0.054  # per radian
    preload_nm: float = 0.0462
    coulomb_nm: float = 2.0e-4
    breakaway: float = 1.25  # static over Coulomb
    opening_nm: float = 0.0  # more friction while it opens
    stribeck_rad_per_s: float = 0.5
    play_rad: float = 0.0  # half width, between shaft and barrel
    stop_rad: float = 0.78
    edge_rad: float = 0.02  # where the port begins to open
    round_rad: float = 0.02
    port_rad: float = 0.95  # diameter of the port as an angle
    port: float = 4.3  # cm³/s per √psi, all of it open
    oil_torque_nm: float = 1.0e-6  # per (cm³/s √psi)
    filter: float = 12.0
    choke: float = 0.9  # of the absolute pressure ahead, beyond which a drop adds no flow
    leak: float = 0.006  # cm³/s per psi, around the barrel
    drain: float = 0.004  # cm³/s per psi, out of the rail
    injectors: float = 1.25
    rail_cm3: float = 95.0
    bulk_psi: float = 3.2e4  # oil and hose
    air: float = 0.0012  # share of free air at atmospheric pressure
    supply_psi: float = 240.0
    sag_psi: float = 0.3  # per cm³/s
    sag_lag_s: float = 0.02
    relief_psi: float = 238.0
    sensor_lag_s: float = 0.004


_Parameters = parameters_of(Unit)
SPREAD = {
    "preload_nm": 0.015,
    "torque_nm_per_a2": 0.015,
    "supply_psi": 0.02,
    "relief_psi": 0.01,
    "coulomb_nm": 0.2,
    "stop_rad": 0.01,
}


draw = drawing(Unit(), SPREAD, 0.04)


@njit(cache=True)
def _orifice(gain: float, drop_psi: float) -> float:
    """Turbulent flow, laminar near nothing; a check valve lets none back."""
    drop = max(0.0, drop_psi)
    return float(gain * drop / (drop * drop + SOFT_PSI * SOFT_PSI) ** 0.25)


@njit(cache=True)
def _port(p: Any, angle: float) -> float:
    """The part of a round port that the barrel's straight edge has uncovered, behind the filter."""
    past = angle - p.edge_rad
    u = 0.5 * (past + math.sqrt(past * past + p.round_rad * p.round_rad)) / p.port_rad
    u = min(u, 0.999999)
    gain = p.port * (math.acos(1.0 - 2.0 * u) - 2.0 * (1.0 - 2.0 * u) * math.sqrt(u - u * u)) / math.pi
    return float(gain / math.sqrt(1.0 + (gain / p.filter) ** 2))


@njit(cache=True)
def _shaft(p: Any, s: Array, push: float, dt: float) -> None:
    """Shaft that sticks or slides, stops at both ends and carries the barrel along."""
    heavy = p.inertia_kgm2 + dt * p.viscous_nms
    free = (p.inertia_kgm2 * s[3] + dt * push) / heavy
    grip = p.coulomb_nm * (1.0 + (p.breakaway - 1.0) * math.exp(-abs(s[3]) / p.stribeck_rad_per_s))
    grip = (grip + (p.opening_nm if free > 0.0 else 0.0)) * dt / heavy
    s[3] = 0.0 if abs(free) <= grip else free - math.copysign(grip, free)
    s[2] += dt * s[3]
    if s[2] < 0.0 or s[2] > p.stop_rad:
        s[2] = max(0.0, min(p.stop_rad, s[2]))
        s[3] = 0.0
    s[4] = max(s[2] - p.play_rad, min(s[2] + p.play_rad, s[4]))


@njit(cache=True)
def _rail(p: Any, s: Array, dt: float) -> float:
    """Rail pressure over one step; hands back the torque with which the oil closes the valve."""
    ahead = p.supply_psi - p.sag_psi * s[5]
    drop = ahead - s[6]
    limit = p.choke * (ahead + ATMOSPHERE_PSI)
    useful = max(drop, 0.0) / (1.0 + (max(drop, 0.0) / limit) ** 12) ** (1.0 / 12.0)
    through = _orifice(_port(p, s[4]), useful)
    inflow = through + p.leak * drop
    over = max(0.0, s[6] - p.relief_psi)
    outflow = _orifice(p.injectors, s[6]) + p.drain * s[6] + 2.0 * over
    absolute = s[6] + ATMOSPHERE_PSI
    soft = 1.0 / p.bulk_psi + p.air * ATMOSPHERE_PSI / (absolute * absolute)
    s[6] = max(0.05 - ATMOSPHERE_PSI, s[6] + dt * (inflow - outflow) / (p.rail_cm3 * soft))
    s[5] += (inflow - s[5]) * dt / p.sag_lag_s
    s[7] += (s[6] - s[7]) * dt / (p.sensor_lag_s + dt)
    return float(p.oil_torque_nm * through * math.sqrt(useful))


@njit(cache=True)
def _step(p: Any, s: Array, current: float, dt: float) -> None:
    """Coil, shaft, rail and sensor over one step."""
    s[0] += (current - s[0]) * dt / (p.coil_lag_s + dt)
    s[1] = max(s[0] - p.remanence_a, min(s[0] + p.remanence_a, s[1]))
    oil = _rail(p, s, dt)
    torque = p.torque_nm_per_a2 * s[1] * s[1] * max(0.1, 1.0 - p.torque_fall * s[2])
    _shaft(p, s, torque - p.preload_nm - p.spring_nm * s[2] - oil, dt)


@njit(cache=True)
def _run(p: Any, current: Array, step_s: float, substeps: int) -> Array:
    out = np.empty(current.size)
    dt = step_s / substeps
    s = np.zeros(8)  # coil, field, shaft, speed, barrel, drawn, rail, sensor
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
    "breakaway_rise": more(breakaway=20.0),
    "stiction_one_side": more(opening_nm=7.0e-3),
    "play": more(play_rad=0.09),
    "magnetic_hysteresis": more(remanence_a=0.08),
    "slower_pilot": scaled(coil_lag_s=0.6),
    "damping_change": scaled(viscous_nms=4.0),
    "edge_worn": more(round_rad=0.35),
    "leakage": more(leak=0.04),
    "supply_sag": more(sag_psi=4.0),
    "zero_shift": more(preload_nm=7.0e-3),
    "gain_loss": scaled(torque_nm_per_a2=-0.25),
    "orifice_clogged": fading(filter=0.12),
    "stroke_stop": more(stop_rad=-0.48),
    "sensor_lag": more(sensor_lag_s=0.06),
}
