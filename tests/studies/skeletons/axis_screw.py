"""axis_screw: a ball screw drives a carriage through an elastic nut; one temperature throughout.

Textbook physics (feed drive of a machine tool; Stribeck friction after Armstrong). **What differs** from one mass with
viscous drag: the screw's inertia and the carriage are two masses; the nut has a little lost motion from the start;
each of the two really sticks, with its own Stribeck curve; the nut drags in proportion to the load it carries; the
screw's drag ripples once a turn. The force in N is the motor's torque over lead/2π, all of the screw's quantities are
referred to the carriage. Full force is about 500 N. Nothing limits the travel.
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
CONTACT_M = 2.0e-6  # over which a ball takes up its load


@dataclass(frozen=True)
class Unit:
    """One screw, nut and carriage; the screw's quantities referred to the carriage."""

    torque_gain: float = 1.0
    torque_lag_s: float = 0.002
    screw_kg: float = 42.0
    screw_ns_per_m: float = 130.0
    screw_coulomb_n: float = 16.0
    screw_breakaway: float = 1.4
    screw_ripple_n: float = 2.0
    lead_m: float = 0.02
    nut_n_per_m: float = 2.4e6
    nut_ns_per_m: float = 1500.0
    nut_play_m: float = 1.2e-5  # half width
    nut_drag: float = 0.04  # of the load it carries
    carriage_kg: float = 58.0
    guide_ns_per_m: float = 70.0
    guide_coulomb_n: float = 14.0
    guide_breakaway: float = 1.3
    forward_n: float = 0.0  # more drag of the wiper while it moves forward
    stribeck_m_per_s: float = 0.012
    slope_n: float = 1.0
    sensor_lag_s: float = 0.001


_Parameters = parameters_of(Unit)
SPREAD = {
    "torque_gain": 0.01,
    "slope_n": 2.0,
    "screw_coulomb_n": 0.15,
    "guide_coulomb_n": 0.15,
    "screw_ripple_n": 0.2,
    "lead_m": 0.0,
    "nut_play_m": 0.25,
    "nut_drag": 0.2,
}


draw = drawing(Unit(), SPREAD, 0.05)


@njit(cache=True)
def _grip(p: Any, coulomb: float, breakaway: float, speed: float) -> float:
    """Stribeck curve: friction against speed, without its viscous part."""
    return coulomb * (1.0 + (breakaway - 1.0) * math.exp(-abs(speed) / p.stribeck_m_per_s))


@njit(cache=True)
def _slide(mass: float, viscous: float, speed: float, push: float, grip: float, dt: float) -> float:
    """The speed after one step: friction holds the part or takes off its full impulse."""
    heavy = mass + dt * viscous
    free = (mass * speed + dt * push) / heavy
    return 0.0 if abs(free) <= dt * grip / heavy else free - math.copysign(dt * grip / heavy, free)


@njit(cache=True)
def _nut(p: Any, lead: float, speed: float) -> float:
    """Force of the nut on the carriage; inside its lost motion it neither pushes nor damps."""
    ahead, behind = lead - p.nut_play_m, -lead - p.nut_play_m
    root_a, root_b = math.sqrt(ahead * ahead + CONTACT_M**2), math.sqrt(behind * behind + CONTACT_M**2)
    touch = min(0.5 * (1.0 + ahead / root_a) + 0.5 * (1.0 + behind / root_b), 1.0)
    return p.nut_n_per_m * 0.5 * (ahead + root_a - behind - root_b) + p.nut_ns_per_m * touch * speed


@njit(cache=True)
def _step(p: Any, s: Array, force: float, dt: float) -> None:
    """Torque, screw, nut, carriage and sensor over one step."""
    s[0] += (p.torque_gain * force - s[0]) * dt / (p.torque_lag_s + dt)
    load = _nut(p, s[1] - s[3], s[2] - s[4])
    ripple = p.screw_ripple_n * math.sin(2.0 * math.pi * s[1] / p.lead_m)
    screw = _grip(p, p.screw_coulomb_n, p.screw_breakaway, s[2]) + p.nut_drag * abs(load)
    guide = _grip(p, p.guide_coulomb_n, p.guide_breakaway, s[4])
    onward = load - p.slope_n
    guide += p.forward_n if p.carriage_kg * s[4] + dt * onward > 0.0 else 0.0
    s[2] = _slide(p.screw_kg, p.screw_ns_per_m, s[2], s[0] - ripple - load, screw, dt)
    s[4] = _slide(p.carriage_kg, p.guide_ns_per_m, s[4], onward, guide, dt)
    s[1] += dt * s[2]
    s[3] += dt * s[4]
    s[5] += (s[3] - s[5]) * dt / (p.sensor_lag_s + dt)


@njit(cache=True)
def _steady(p: Any, force: float) -> float:
    """The speed at which a lasting force is used up by drag."""
    low, high = -20.0, 20.0
    for _ in range(60):
        w = 0.5 * (low + high)
        guide = _grip(p, p.guide_coulomb_n, p.guide_breakaway, w) + (p.forward_n if w > 0.0 else 0.0)
        load = math.copysign(guide, w) + p.guide_ns_per_m * w + p.slope_n
        screw = _grip(p, p.screw_coulomb_n, p.screw_breakaway, w) + p.nut_drag * abs(load)
        if p.torque_gain * force - load - math.copysign(screw, w) - p.screw_ns_per_m * w > 0.0:
            low = w
        else:
            high = w
    return 0.5 * (low + high)


@njit(cache=True)
def _run(p: Any, command: Array, step_s: float, substeps: int) -> Array:
    out = np.empty(command.size)
    dt = step_s / substeps
    s = np.zeros(6)  # force, screw, its speed, carriage, its speed, sensor
    s[0] = p.torque_gain * command[0]
    s[2] = _steady(p, command[0])
    s[4] = s[2]
    for _ in range(int(SETTLE_S / dt)):
        _step(p, s, command[0], dt)
    start = s[5]
    for k in range(command.size):
        out[k] = 1.0e3 * (s[5] - start)
        for _ in range(substeps):
            _step(p, s, command[k], dt)
    return out


respond = answering(_run, _Parameters, CHANNELS, STEP_S, SUBSTEPS)
"""Position, without noise, at the samples of a force in N; it counts from where the carriage starts."""


CHANGES = {
    "friction_rise": more(screw_coulomb_n=70.0),
    "breakaway_rise": more(screw_breakaway=3.0),
    "play": more(nut_play_m=0.6e-3),
    "cogging_rise": more(screw_ripple_n=50.0),
    "damping_change": scaled(screw_ns_per_m=2.5),
    "mass_change": scaled(carriage_kg=1.0),
    "gain_loss": scaled(torque_gain=-0.25),
    "asymmetry": more(forward_n=60.0),
    "zero_shift": more(slope_n=40.0),
    "coupling_soft": fading(nut_n_per_m=0.05),
    "sensor_lag": more(sensor_lag_s=0.04),
}
