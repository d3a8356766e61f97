"""axis_yaw: a motor beside the middle pushes a carriage that yaws on two rails, on a base that recoils on its feet.

A linear axis of 40 kg and some 400 N; textbook physics (generalised Maxwell slip after Al-Bender and Swevers; machine
base on feet; error of Abbe). **What differs** from a mass with drag: the **base recoils**, and the scale reads against
it; the **carriage yaws** between its rails, since motor and grip do not work in its middle, and the scale sits beside;
each rail has friction of its own, by three springs that slip one after the other, unequal by direction; grease that
thins with speed; a motor whose force saturates and cogs. There is no paper: all values are assumed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from tests.studies.skeletons import Array, answering, divided, drawing, fading, more, parameters_of, scaled

PLANT = "linear-axis"
CHANNELS = {"force": "N", "position": "mm"}
STEP_S = 0.002
NOISE = {"position": 0.01}
SUBSTEPS = 50  # 25 kHz
MM = 1000.0
SKEWED_M = 0.3  # half of what skew adds is there so far out
STIFF = (0.5, 0.3, 0.2)  # of a rail's springs that slip: shares of stiffness, then of what they hold
HOLD = (0.25, 0.35, 0.4)


@dataclass(frozen=True)
class Unit:
    """One axis with its motor, carriage, rails, grease, base and scale."""

    force: float = 1.0  # of what is asked for
    force_lag_s: float = 0.0012
    saturation_n: float = 750.0
    cogging_n: float = 1.5
    pole_m: float = 0.03
    motor_beside_m: float = 0.03
    pull_n: float = 0.0  # along the axis, as of one that is not level
    carriage_kg: float = 40.0
    yaw_kg_m2: float = 0.9
    yaw_nm: float = 5.2e4  # per rad, of all bearings
    yaw_nm_s: float = 45.0
    yaw_play: float = 0.0  # rad, half width
    rail_m: float = 0.14  # of each, from the middle
    left_n: float = 7.0  # Coulomb
    right_n: float = 9.5
    forwards: float = 1.08  # over backwards
    skew: float = 0.0  # rails that are not parallel grip more, away from where they were set
    breakaway: float = 1.3  # static over Coulomb
    stribeck_m_per_s: float = 0.012
    presliding_n_per_m: float = 7.0e5  # of each rail
    grease_ns_per_m: float = 260.0  # of each rail, slow
    thin_m_per_s: float = 0.9
    base_kg: float = 270.0
    feet_n_per_m: float = 7.5e5
    feet_ns_per_m: float = 3400.0
    scale_beside_m: float = 0.08
    scale_lag_s: float = 0.0006


_Parameters = parameters_of(Unit)
SPREAD = {"force": 0.02, "left_n": 0.15, "right_n": 0.15, "forwards": 0.06, "motor_beside_m": 0.15, "cogging_n": 0.2}


draw = drawing(Unit(), SPREAD, 0.08)


@njit(cache=True)
def _rail(p: Any, s: Array, at: int, v: float, coulomb: float, dt: float) -> float:
    """Friction of a rail: three springs slip one after the other; then its grease."""
    level = coulomb * (1.0 + (p.breakaway - 1.0) * math.exp(-((v / p.stribeck_m_per_s) ** 2)))
    level *= (p.forwards if v > 0.0 else 1.0) * (1.0 + p.skew * s[1] ** 2 / (s[1] ** 2 + SKEWED_M**2))
    held = 0.0
    for k in range(3):
        most = HOLD[k] * level
        s[at + k] = max(-most, min(most, s[at + k] + STIFF[k] * p.presliding_n_per_m * dt * v))
        held += s[at + k]
    return held + p.grease_ns_per_m * v / math.sqrt(1.0 + abs(v) / p.thin_m_per_s)


@njit(cache=True)
def _step(p: Any, s: Array, command: float, dt: float) -> None:
    """Motor, rails, carriage, base and scale over one step."""
    s[0] += (p.force * command - s[0]) * dt / p.force_lag_s
    push = s[0] / (1.0 + (s[0] / p.saturation_n) ** 4) ** 0.25
    push += p.cogging_n * math.sin(2.0 * math.pi * (s[1] - s[5]) / p.pole_m)
    along = s[2] - s[6]
    left = _rail(p, s, 7, along + p.rail_m * s[4], p.left_n, dt)
    right = _rail(p, s, 10, along - p.rail_m * s[4], p.right_n, dt)
    bent = s[3] - max(-p.yaw_play, min(p.yaw_play, s[3]))
    turn = p.motor_beside_m * push - p.rail_m * (left - right) - p.yaw_nm * bent
    net = push - left - right
    s[2] += dt * (net - p.pull_n) / p.carriage_kg
    s[4] = (s[4] + dt * turn / p.yaw_kg_m2) / (1.0 + dt * p.yaw_nm_s / p.yaw_kg_m2)
    s[6] += dt * (-net - p.feet_n_per_m * s[5] - p.feet_ns_per_m * s[6]) / p.base_kg
    s[1] += dt * s[2]
    s[3] += dt * s[4]
    s[5] += dt * s[6]
    s[13] += (s[1] - s[5] + p.scale_beside_m * s[3] - s[13]) * dt / p.scale_lag_s


@njit(cache=True)
def _run(p: Any, command: Array, step_s: float, substeps: int) -> Array:
    out = np.empty(command.size)
    dt = step_s / substeps
    s = np.zeros(14)  # force, carriage, its speed, yaw, its rate, base, its speed, rails (three each), scale
    for k in range(command.size):
        out[k] = MM * s[13]
        for _ in range(substeps):
            _step(p, s, command[k], dt)
    return out


respond = answering(_run, _Parameters, CHANNELS, STEP_S, SUBSTEPS)
"""Position in mm against the base, without noise, at the samples of a force in N."""


CHANGES = {
    "friction_rise": more(left_n=12.0, right_n=12.0),
    "breakaway_rise": more(breakaway=5.0),
    "asymmetry": more(forwards=1.0),
    "damping_change": scaled(grease_ns_per_m=0.8),
    "gain_loss": scaled(force=-0.4),
    "mass_change": scaled(carriage_kg=1.2, yaw_kg_m2=1.2),
    "feet_soft": divided(feet_n_per_m=15.0, feet_ns_per_m=4.0),
    "rails_loose": more(yaw_play=4.0e-3),
    "rails_skew": more(skew=3.0),
    "cogging_rise": more(cogging_n=40.0),
    "force_ceiling": fading(saturation_n=0.2),
    "slower_drive": more(force_lag_s=0.05),
    "zero_shift": more(pull_n=8.0),
    "sensor_lag": more(scale_lag_s=0.04),
}
