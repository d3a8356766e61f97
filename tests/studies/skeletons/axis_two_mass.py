"""axis_two_mass: a linear motor pushes its carriage through a springy coupling along a guide.

Textbook physics (two-mass drive; LuGre friction after Canudas de Wit; cogging of an iron-core linear motor). **What
differs** from one mass with viscous drag: a second mass on a spring and damper; a bristle state with presliding in
place of a sign function; cogging that depends on the motor's place; a force loop with its own lag; a sensor on the
carriage, not on the motor. Full force is about 500 N. Nothing limits the travel.
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
SETTLE_S = 1.0
CONTACT_M = 2.0e-6  # over which a flank of the backlash takes hold


@dataclass(frozen=True)
class Unit:
    """One motor, coupling and carriage."""

    force_gain: float = 1.0
    force_lag_s: float = 0.0015
    motor_kg: float = 28.0
    motor_ns_per_m: float = 40.0
    cogging_n: float = 2.0
    cogging_pitch_m: float = 0.024
    coupling_n_per_m: float = 1.3e6
    coupling_ns_per_m: float = 500.0
    coupling_play_m: float = 0.0  # half width
    carriage_kg: float = 72.0
    guide_ns_per_m: float = 160.0
    guide_coulomb_n: float = 28.0
    guide_breakaway: float = 1.35  # static over Coulomb
    guide_forward: float = 1.0  # friction forward over backward
    stribeck_m_per_s: float = 0.02
    bristle_n_per_m: float = 1.2e6
    bristle_ns_per_m: float = 3.0e3
    tilt_n: float = 1.0
    sensor_lag_s: float = 0.0005


_Parameters = parameters_of(Unit)
SPREAD = {
    "force_gain": 0.01,
    "tilt_n": 2.0,
    "guide_coulomb_n": 0.15,
    "guide_forward": 0.05,
    "cogging_n": 0.2,
    "cogging_pitch_m": 0.0,
    "coupling_ns_per_m": 0.2,
}


draw = drawing(Unit(), SPREAD, 0.05)


@njit(cache=True)
def _grip(p: Any, w: float) -> float:
    """Friction of the sliding guide, without its viscous part."""
    side = p.guide_forward if w > 0.0 else 1.0
    return p.guide_coulomb_n * side * (1.0 + (p.guide_breakaway - 1.0) * math.exp(-((w / p.stribeck_m_per_s) ** 2)))


@njit(cache=True)
def _coupling(p: Any, twist: float, speed: float) -> float:
    """Force of the coupling; between the flanks of a backlash it neither pushes nor damps."""
    ahead, behind = twist - p.coupling_play_m, -twist - p.coupling_play_m
    root_a, root_b = math.sqrt(ahead * ahead + CONTACT_M**2), math.sqrt(behind * behind + CONTACT_M**2)
    if p.coupling_play_m == 0.0:
        return p.coupling_n_per_m * twist + p.coupling_ns_per_m * speed
    touch = 0.5 * (1.0 + ahead / root_a) + 0.5 * (1.0 + behind / root_b)
    return p.coupling_n_per_m * 0.5 * (ahead + root_a - behind - root_b) + p.coupling_ns_per_m * touch * speed


@njit(cache=True)
def _step(p: Any, s: Array, force: float, dt: float) -> None:
    """Force loop, motor, bristle, carriage and sensor over one step."""
    s[0] += (p.force_gain * force - s[0]) * dt / (p.force_lag_s + dt)
    hold = _coupling(p, s[1] - s[3], s[2] - s[4])
    cogging = p.cogging_n * math.sin(2.0 * math.pi * s[1] / p.cogging_pitch_m)
    w = s[4]
    before = s[5]
    s[5] = (before + dt * w) / (1.0 + dt * p.bristle_n_per_m * abs(w) / _grip(p, w))
    fade = math.exp(-((w / p.stribeck_m_per_s) ** 2))
    drag = p.bristle_n_per_m * s[5] + p.bristle_ns_per_m * fade * (s[5] - before) / dt + p.guide_ns_per_m * w
    s[2] += dt * (s[0] - cogging - p.motor_ns_per_m * s[2] - hold) / p.motor_kg
    s[4] = w + dt * (hold - drag - p.tilt_n) / p.carriage_kg
    s[1] += dt * s[2]
    s[3] += dt * s[4]
    s[6] += (s[3] - s[6]) * dt / (p.sensor_lag_s + dt)


@njit(cache=True)
def _steady(p: Any, force: float) -> float:
    """The speed at which a lasting force is used up by drag."""
    low, high = -20.0, 20.0
    for _ in range(60):
        w = 0.5 * (low + high)
        drag = (p.motor_ns_per_m + p.guide_ns_per_m) * w + math.copysign(_grip(p, w), w)
        if p.force_gain * force - p.tilt_n - drag > 0.0:
            low = w
        else:
            high = w
    return 0.5 * (low + high)


@njit(cache=True)
def _run(p: Any, command: Array, step_s: float, substeps: int) -> Array:
    out = np.empty(command.size)
    dt = step_s / substeps
    s = np.zeros(7)  # force, motor, its speed, carriage, its speed, bristle, sensor
    s[0] = p.force_gain * command[0]
    s[2] = _steady(p, command[0])
    s[4] = s[2]
    for _ in range(int(SETTLE_S / dt)):
        _step(p, s, command[0], dt)
    start = s[6]
    for k in range(command.size):
        out[k] = 1.0e3 * (s[6] - start)
        for _ in range(substeps):
            _step(p, s, command[k], dt)
    return out


respond = answering(_run, _Parameters, CHANNELS, STEP_S, SUBSTEPS)
"""Position, without noise, at the samples of a force in N; it counts from where the carriage starts."""


CHANGES = {
    "friction_rise": more(guide_coulomb_n=70.0),
    "breakaway_rise": more(guide_breakaway=1.8),
    "play": more(coupling_play_m=0.6e-3),
    "cogging_rise": more(cogging_n=50.0),
    "damping_change": scaled(guide_ns_per_m=2.0),
    "mass_change": scaled(carriage_kg=0.8),
    "gain_loss": scaled(force_gain=-0.25),
    "asymmetry": more(guide_forward=2.0),
    "zero_shift": more(tilt_n=40.0),
    "coupling_soft": fading(coupling_n_per_m=0.08),
    "sensor_lag": more(sensor_lag_s=0.04),
}
