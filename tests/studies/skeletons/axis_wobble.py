"""axis_wobble: a screw whose pitch wobbles drives a carriage; friction warms up, and a cable chain pulls back.

A linear axis of 50 kg and some 400 N; textbook physics (Armstrong-Hélouvry; bristle friction after Canudas de Wit).
**What differs** from a mass with drag: **two masses** on the shaft and nut between them; the pitch has an error by
place, which moves the carriage and loads the screw; friction of screw and guide by bristles with a Stribeck dip, and
**its power warms the grease**, which thins the drag and tightens the nut; a cable chain is a spring that gives way
with distance and loses energy as it rolls; the amplifier's force lags. There is no paper: all values are assumed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from tests.studies.skeletons import Array, answering, divided, drawing, more, parameters_of, scaled

PLANT = "linear-axis"
CHANNELS = {"force": "N", "position": "mm"}
STEP_S = 0.002
NOISE = {"position": 0.01}
SUBSTEPS = 40  # 20 kHz
MM = 1000.0


@dataclass(frozen=True)
class Unit:
    """One axis with its amplifier, screw, nut, carriage, guide, grease, chain and scale."""

    force: float = 1.0  # of what is asked for
    force_lag_s: float = 0.002
    pull_n: float = 0.0  # along the axis, as of one that is not level
    screw_kg: float = 16.0  # motor and screw, as seen along the axis
    carriage_kg: float = 34.0
    nut_n_per_m: float = 3.0e6
    nut_ns_per_m: float = 900.0
    play_m: float = 0.0  # half width, in the nut
    lead_m: float = 0.04
    wobble_m: float = 6.0e-6
    screw_ns_per_m: float = 320.0
    guide_ns_per_m: float = 130.0
    screw_n: float = 9.0  # Coulomb
    guide_n: float = 6.0
    forwards: float = 1.1  # of the guide, over backwards
    breakaway: float = 1.35  # static over Coulomb
    stribeck_m_per_s: float = 0.01
    screw_bristle_n_per_m: float = 6.0e5
    guide_bristle_n_per_m: float = 4.0e5
    warming_s: float = 25.0
    warming_k_per_w: float = 0.25
    thinning_per_k: float = 0.012
    tightening_per_k: float = 0.004
    chain_n_per_m: float = 12.0
    chain_reach_m: float = 0.8  # beyond it, the pull hardly grows
    chain_loss_n: float = 1.5
    scale_lag_s: float = 0.0005


_Parameters = parameters_of(Unit)
SPREAD = {"force": 0.02, "screw_n": 0.15, "guide_n": 0.15, "forwards": 0.06, "wobble_m": 0.3, "chain_n_per_m": 0.2}


draw = drawing(Unit(), SPREAD, 0.08)


@njit(cache=True)
def _bristle(p: Any, s: Array, at: int, v: float, level: float, stiffness: float, dt: float) -> float:
    """Friction of a bristle that is bent so far, with the Stribeck dip of its level."""
    most = level * (1.0 + (p.breakaway - 1.0) * math.exp(-((v / p.stribeck_m_per_s) ** 2)))
    s[at] = (s[at] + dt * v) / (1.0 + dt * stiffness * abs(v) / most)
    return float(stiffness * s[at])


@njit(cache=True)
def _nut(p: Any, s: Array) -> tuple[float, float]:
    """Force of the nut on the carriage, and how far the carriage goes per way of the screw."""
    turn = 2.0 * math.pi / p.lead_m
    per_way = 1.0 + p.wobble_m * turn * math.cos(turn * s[1])
    apart = s[1] + p.wobble_m * math.sin(turn * s[1]) - s[3]
    if abs(apart) <= p.play_m:
        return 0.0, per_way
    stretch = apart - math.copysign(p.play_m, apart)
    return p.nut_n_per_m * stretch + p.nut_ns_per_m * (per_way * s[2] - s[4]), per_way


@njit(cache=True)
def _step(p: Any, s: Array, command: float, dt: float) -> None:
    """Amplifier, screw, carriage, grease and scale over one step."""
    s[0] += (p.force * command - s[0]) * dt / p.force_lag_s
    thin, tight = math.exp(-p.thinning_per_k * s[8]), 1.0 + p.tightening_per_k * s[8]
    nut, per_way = _nut(p, s)
    screw = _bristle(p, s, 5, s[2], p.screw_n * tight, p.screw_bristle_n_per_m, dt) + p.screw_ns_per_m * thin * s[2]
    level = p.guide_n * (p.forwards if s[4] > 0.0 else 1.0)
    guide = _bristle(p, s, 6, s[4], level, p.guide_bristle_n_per_m, dt) + p.guide_ns_per_m * thin * s[4]
    s[7] += dt * (s[4] - abs(s[4]) * s[7] / 0.05)  # the chain's bend, which rolls on within 5 cm
    chain = p.chain_n_per_m * s[3] / math.sqrt(1.0 + (s[3] / p.chain_reach_m) ** 2) + p.chain_loss_n * s[7] / 0.05
    s[8] += dt * (p.warming_k_per_w * (abs(screw * s[2]) + abs(guide * s[4])) - s[8]) / p.warming_s
    s[2] += dt * (s[0] - screw - per_way * nut) / p.screw_kg
    s[4] += dt * (nut - guide - chain - p.pull_n) / p.carriage_kg
    s[1] += dt * s[2]
    s[3] += dt * s[4]
    s[9] += (s[3] - s[9]) * dt / p.scale_lag_s


@njit(cache=True)
def _run(p: Any, command: Array, step_s: float, substeps: int) -> Array:
    out = np.empty(command.size)
    dt = step_s / substeps
    s = np.zeros(10)  # force, screw, its speed, carriage, its speed, both bristles, chain, kelvin, scale
    for k in range(command.size):
        out[k] = MM * s[9]
        for _ in range(substeps):
            _step(p, s, command[k], dt)
    return out


respond = answering(_run, _Parameters, CHANNELS, STEP_S, SUBSTEPS)
"""Position in mm, without noise, at the samples of a force in N."""


CHANGES = {
    "friction_rise": more(screw_n=40.0),
    "breakaway_rise": more(breakaway=8.0),
    "asymmetry": more(forwards=3.0),
    "play": more(play_m=1.0e-3),
    "damping_change": scaled(screw_ns_per_m=1.5, guide_ns_per_m=1.5),
    "gain_loss": scaled(force=-0.4),
    "mass_change": scaled(carriage_kg=1.2),
    "coupling_soft": divided(nut_n_per_m=300.0, nut_ns_per_m=20.0),
    "wobble_rise": more(wobble_m=6.0e-4),
    "zero_shift": more(pull_n=15.0),
    "drag_drift": scaled(warming_k_per_w=6.0),
    "chain_stiff": more(chain_n_per_m=80.0),
    "sensor_lag": more(scale_lag_s=0.04),
}
