"""hpv41_notched: a bridge of four orifices moves a notched spool; the electronics close the loop with an integral.

Dead band ±27 % and 70 l/min after Tørdal, Klausen, Bak; textbook physics (Merritt:
hydraulic bridge, flow force, round port; bristle friction after Canudas de Wit). **What differs** from a chain of
gain, lag and static curve: the spool's place is led back by an LVDT to electronics with an **integral and a ceiling of
their output**; two fixed orifices and two nozzles that a magnet opens against each other give **each end of the spool
a pressure**, against a spring and the flow force; the notches are round, so that their area is a segment of a circle,
and unequal; the pump sags with what is drawn. Masses, volumes and areas are assumed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from tests.studies.skeletons import Array, answering, drawing, fading, more, orifice_root, parameters_of, scaled

PLANT = "brevini-hpv41"
CHANNELS = {"command": "%", "flow": "l/min"}
STEP_S = 0.004
NOISE = {"flow": 0.25}
SUBSTEPS = 100  # 25 kHz
SETTLE_S = 1.0
SOFT_BAR = 0.3  # below this drop an orifice turns laminar
DISCHARGE = 9.9  # cm³/s per mm² and √bar: 0.65·√(2/ρ)
JET_N = 0.043  # per mm² and bar: 2·0.65·0.98·cos 69° of Merritt
LPM = 0.06  # l/min per cm³/s


@dataclass(frozen=True)
class Unit:
    """One valve with its electronics, bridge, spool, notches, pump, load and meter."""

    stroke_mm: float = 7.0  # asked for at 100 %
    lvdt_gain: float = 1.0
    lvdt_zero_mm: float = 0.0
    lvdt_lag_s: float = 0.0015
    gain_per_mm: float = 0.8
    integral_per_mm_s: float = 5.0
    ceiling: float = 0.95  # of the magnet's way
    armature_lag_s: float = 0.005
    pilot_bar: float = 16.0
    fixed_a_mm2: float = 0.85
    fixed_b_mm2: float = 0.85
    nozzle_mm2: float = 0.85  # with the armature in its middle
    chamber_cm3_per_bar: float = 0.006  # with some air
    end_mm2: float = 314.0
    spool_kg: float = 0.25
    viscous_ns_per_mm: float = 0.3
    spring_n_per_mm: float = 24.0
    coulomb_n: float = 2.5
    breakaway: float = 1.3  # static over Coulomb
    stribeck_mm_per_s: float = 4.0
    bristle_n_per_mm: float = 400.0
    stop_mm: float = 7.6
    overlap_mm: float = 1.89
    round_mm: float = 0.06  # of the edges
    notch_mm: float = 2.75  # radius
    width_a: float = 0.70  # of a notch over that of a circle
    width_b: float = 0.66
    leak_a_mm2: float = 0.01
    leak_b_mm2: float = 0.01
    pump_bar: float = 90.0
    sag_bar_s_per_cm3: float = 0.008
    pump_cm3_per_bar: float = 4.0
    load: float = 250.0  # cm³/s per √bar
    load_cm3_per_bar: float = 0.15
    meter_lag_s: float = 0.01


_Parameters = parameters_of(Unit)
SPREAD = {
    "lvdt_gain": 0.01, "overlap_mm": 0.02, "notch_mm": 0.02, "fixed_a_mm2": 0.03, "fixed_b_mm2": 0.03,
    "coulomb_n": 0.2, "stroke_mm": 0.01, "stop_mm": 0.01, "round_mm": 0.2,
}  # fmt: skip


draw = drawing(Unit(), SPREAD, 0.04)


_root = orifice_root(SOFT_BAR)


@njit(cache=True)
def _notch(p: Any, past_mm: float) -> float:
    """Area of a round notch that is uncovered so far, its edge worn round: the segment of a circle."""
    depth = min(0.5 * (past_mm + math.sqrt(past_mm * past_mm + p.round_mm * p.round_mm)), 2.0 * p.notch_mm)
    angle = math.acos(1.0 - depth / p.notch_mm)
    return float(p.notch_mm**2 * (angle - math.sin(angle) * math.cos(angle)))


@njit(cache=True)
def _open(p: Any, x_mm: float, width: float, leak_mm2: float) -> float:
    """From the pump to one port; a scored land leaks less the further it covers, and into the tank at last."""
    scored = leak_mm2 * min(1.0, max(0.0, 0.5 + 0.5 * x_mm / p.overlap_mm))
    return float(DISCHARGE * (width * _notch(p, x_mm - p.overlap_mm) + scored))


@njit(cache=True)
def _electronics(p: Any, s: Array, command: float, dt: float) -> None:
    """LVDT, controller and armature over one step; the integral waits while the output is at its ceiling."""
    s[0] += (p.lvdt_gain * s[5] + p.lvdt_zero_mm - s[0]) * dt / p.lvdt_lag_s
    gap = 0.01 * command * p.stroke_mm - s[0]
    wanted = p.gain_per_mm * gap + s[1]
    drive = max(-p.ceiling, min(p.ceiling, wanted))
    if drive == wanted or wanted * gap < 0.0:
        s[1] += dt * p.integral_per_mm_s * gap
    s[2] += (drive - s[2]) * dt / p.armature_lag_s


@njit(cache=True)
def _spool(p: Any, s: Array, jet_n: float, dt: float) -> None:
    """Spool between the pressures of its ends, then the bridge that makes them, over one step."""
    v = s[6]
    level = p.coulomb_n * (1.0 + (p.breakaway - 1.0) * math.exp(-((v / p.stribeck_mm_per_s) ** 2)))
    s[7] = (s[7] + dt * v) / (1.0 + dt * p.bristle_n_per_mm * abs(v) / level)
    net = 0.1 * p.end_mm2 * (s[3] - s[4]) - p.spring_n_per_mm * s[5] - p.bristle_n_per_mm * s[7] - jet_n
    rate = 1000.0 * dt / p.spool_kg
    s[6] = (v + rate * net) / (1.0 + rate * p.viscous_ns_per_mm)
    s[5] += dt * s[6]
    if abs(s[5]) > p.stop_mm:
        s[5], s[6] = math.copysign(p.stop_mm, s[5]), 0.0
    swept = 0.001 * p.end_mm2 * s[6]
    a = DISCHARGE * (p.fixed_a_mm2 * _root(p.pilot_bar - s[3]) - p.nozzle_mm2 * max(1.0 - s[2], 0.02) * _root(s[3]))
    b = DISCHARGE * (p.fixed_b_mm2 * _root(p.pilot_bar - s[4]) - p.nozzle_mm2 * max(1.0 + s[2], 0.02) * _root(s[4]))
    s[3] = max(s[3] + dt * (a - swept) / p.chamber_cm3_per_bar, 0.0)
    s[4] = max(s[4] + dt * (b + swept) / p.chamber_cm3_per_bar, 0.0)


@njit(cache=True)
def _step(p: Any, s: Array, command: float, dt: float) -> None:
    """Electronics, spool, pump, load and meter over one step."""
    _electronics(p, s, command, dt)
    to_a = _open(p, s[5], p.width_a, p.leak_a_mm2)
    to_b = _open(p, -s[5], p.width_b, p.leak_b_mm2)
    _spool(p, s, JET_N / DISCHARGE * (to_a * (s[8] - s[9]) - to_b * (s[8] + s[9])), dt)
    ahead, back = to_a * _root(s[8] - s[9]), to_b * _root(s[8] + s[9])
    through = p.load * _root(s[9])
    s[9] += dt * (ahead - back - through) / p.load_cm3_per_bar
    s[8] += dt * ((p.pump_bar - s[8]) / p.sag_bar_s_per_cm3 - ahead - back) / p.pump_cm3_per_bar
    s[10] += (LPM * through - s[10]) * dt / p.meter_lag_s


@njit(cache=True)
def _run(p: Any, command: Array, step_s: float, substeps: int) -> Array:
    out = np.empty(command.size)
    dt = step_s / substeps
    s = np.zeros(11)  # LVDT, integral, armature, both ends, spool, its speed, bristle, pump, load, meter
    s[3], s[4], s[8] = 0.5 * p.pilot_bar, 0.5 * p.pilot_bar, p.pump_bar
    for _ in range(int(SETTLE_S / dt)):
        _step(p, s, command[0], dt)
    for k in range(command.size):
        out[k] = s[10]
        for _ in range(substeps):
            _step(p, s, command[k], dt)
    return out


respond = answering(_run, _Parameters, CHANNELS, STEP_S, SUBSTEPS)
"""Flow, without noise, at the samples of a command in %."""


CHANGES = {
    "friction_rise": more(coulomb_n=60.0),
    "breakaway_rise": more(breakaway=20.0),
    "slower_pilot": more(armature_lag_s=0.05),
    "orifice_clogged": fading(fixed_a_mm2=0.3, fixed_b_mm2=0.3),
    "damping_change": more(viscous_ns_per_mm=8.0),
    "loop_weak": fading(gain_per_mm=0.3, integral_per_mm_s=0.3),
    "rate_ceiling": fading(ceiling=0.45),
    "edge_worn": more(round_mm=2.0),
    "leakage": more(leak_a_mm2=2.0),
    "asymmetry": scaled(width_b=-0.5),
    "supply_sag": scaled(sag_bar_s_per_cm3=6.0),
    "zero_shift": more(lvdt_zero_mm=0.7),
    "gain_loss": more(lvdt_gain=0.3),
    "stroke_stop": more(stop_mm=-4.5),
    "sensor_lag": more(meter_lag_s=0.1),
}
