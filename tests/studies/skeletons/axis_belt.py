"""axis_belt: a motor with a current loop drives a carriage through a toothed belt.

Textbook physics (belt drive; Dahl and LuGre friction after Canudas de Wit; voltage and back-EMF of a servo motor).
**What differs** from one mass with viscous drag: a force that a loop with a ceiling of voltage makes against the
motor's back-EMF; two masses on a belt that is stiffer towards the ends of its way; a pulley that runs out of true;
presliding friction on both masses, unequal by direction on the carriage; the sensor on the carriage. The motor's
quantities are referred to the belt. Full force is about 500 N. Nothing limits the travel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from tests.studies.skeletons import Array, answering, drawing, fading, more, parameters_of, scaled

PLANT = "linear-axis"
CHANNELS = {"force": "N", "position": "mm"}
STEP_S = 0.002
NOISE = {"position": 0.01}
SUBSTEPS = 40  # 20 kHz
SETTLE_S = 0.5


@dataclass(frozen=True)
class Unit:
    """One motor, belt and carriage."""

    force_gain: float = 1.0
    loop_per_s: float = 700.0
    force_n_per_s: float = 1.2e5  # the loop's ceiling
    back_emf_n_per_m: float = 4.0e4
    motor_kg: float = 16.0
    motor_ns_per_m: float = 120.0
    motor_coulomb_n: float = 7.0
    cogging_n: float = 2.0
    pole_m: float = 0.022
    runout_m: float = 1.0e-5
    pulley_m: float = 0.025
    belt_n_per_m: float = 6.0e5
    belt_rise: float = 0.3  # stiffer towards the ends, by this share
    belt_way_m: float = 0.4
    belt_ns_per_m: float = 500.0
    belt_play_m: float = 0.0
    carriage_kg: float = 34.0
    carriage_ns_per_m: float = 240.0
    carriage_coulomb_n: float = 11.0
    forward: float = 0.08  # more of it forwards, by this share
    breakaway: float = 1.3  # static over Coulomb
    stribeck_m_per_s: float = 0.01
    bristle_n_per_m: float = 4.0e5
    tilt_n: float = 0.0
    sensor_lag_s: float = 0.001


_Parameters = parameters_of(Unit)
SPREAD = {"carriage_coulomb_n": 0.2, "motor_coulomb_n": 0.2, "forward": 0.3, "runout_m": 0.3}


draw = drawing(Unit(), SPREAD, 0.05)


@njit(cache=True)
def _bristle(s: Array, at: int, level: float, stiffness: float, v: float, dt: float) -> float:
    """Force of bristles that bend and slip."""
    s[at] = (s[at] + dt * v) / (1.0 + dt * stiffness * abs(v) / level)
    return float(stiffness * s[at])


@njit(cache=True)
def _step(p: Any, s: Array, command: float, dt: float) -> None:
    """Current loop, motor, belt, carriage and sensor over one step."""
    voltage = p.loop_per_s * (p.force_gain * command - s[0])
    voltage = max(-p.force_n_per_s, min(p.force_n_per_s, voltage))
    s[0] += dt * (voltage - p.back_emf_n_per_m * s[2])
    stretch = s[1] + p.runout_m * math.sin(s[1] / p.pulley_m) - s[3]
    stretch -= max(-p.belt_play_m, min(p.belt_play_m, stretch))
    stiffer = math.tanh(s[3] / p.belt_way_m)
    belt = p.belt_n_per_m * (1.0 + p.belt_rise * stiffer * stiffer) * stretch + p.belt_ns_per_m * (s[2] - s[4])
    ripple = p.cogging_n * math.sin(2.0 * math.pi * s[1] / p.pole_m)
    drag = _bristle(s, 5, p.motor_coulomb_n, p.bristle_n_per_m, s[2], dt) + p.motor_ns_per_m * s[2]
    v = s[4]
    level = p.carriage_coulomb_n * (1.0 + (p.breakaway - 1.0) * math.exp(-((v / p.stribeck_m_per_s) ** 2)))
    level *= 1.0 + p.forward if v > 0.0 else 1.0
    guide = _bristle(s, 6, level, p.bristle_n_per_m, v, dt) + p.carriage_ns_per_m * v
    s[2] += dt * (s[0] - ripple - drag - belt) / p.motor_kg
    s[4] += dt * (belt - guide - p.tilt_n) / p.carriage_kg
    s[1] += dt * s[2]
    s[3] += dt * s[4]
    s[7] += (1.0e3 * s[3] - s[7]) * dt / (p.sensor_lag_s + dt)


@njit(cache=True)
def _run(p: Any, command: Array, step_s: float, substeps: int) -> Array:
    out = np.empty(command.size)
    dt = step_s / substeps
    s = np.zeros(8)  # force, motor, its speed, carriage, its speed, bristles of both, sensor
    for _ in range(int(SETTLE_S / dt)):
        _step(p, s, command[0], dt)
    for k in range(command.size):
        out[k] = s[7]
        for _ in range(substeps):
            _step(p, s, command[k], dt)
    return out


respond = answering(_run, _Parameters, CHANNELS, STEP_S, SUBSTEPS)
"""Position, without noise, at the samples of a command in N."""


CHANGES = {
    "friction_rise": more(carriage_coulomb_n=70.0),
    "breakaway_rise": more(breakaway=5.0),
    "play": more(belt_play_m=0.5e-3),
    "cogging_rise": more(cogging_n=50.0),
    "damping_change": scaled(carriage_ns_per_m=1.8),
    "mass_change": scaled(carriage_kg=1.0),
    "gain_loss": scaled(force_gain=-0.25),
    "asymmetry": more(forward=4.0),
    "zero_shift": more(tilt_n=40.0),
    "coupling_soft": fading(belt_n_per_m=0.05),
    "sensor_lag": more(sensor_lag_s=0.04),
}
