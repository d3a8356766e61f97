"""axis_counterweight: a screw lifts a carriage that hangs on a rope with a counterweight; the encoder is on the sheave.

A vertical axis of some 70 kg in all and 400 N; textbook physics (Armstrong-Hélouvry; bristle friction after Canudas de
Wit; rope over a sheave). **What differs** from a mass with drag: **four masses**, since screw, carriage, sheave and
weight move apart; the rope pulls and never pushes, stiffer the shorter it is; bristles with a Stribeck dip, unequal up
and down, and the sheave's bearing by what it carries; weight and carriage do not balance; and the **encoder sits off
its axis** on the sheave, over which the rope creeps, so it reads neither the screw nor the carriage, and it counts
from the floor. There is no paper: all values are assumed.
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
STEP_S = 0.004
NOISE = {"position": 0.02}
SUBSTEPS = 100  # 25 kHz
MM = 1000.0
GRAVITY = 9.81
SHORTEST_M = 0.5  # of a rope


@dataclass(frozen=True)
class Unit:
    """One axis with its amplifier, screw, carriage, guide, rope, sheave, weight and encoder."""

    force: float = 1.0  # of what is asked for
    force_lag_s: float = 0.0015
    ceiling_n: float = 900.0
    screw_kg: float = 9.0  # motor and screw, as seen along the axis
    nut_n_per_m: float = 2.5e6
    nut_ns_per_m: float = 700.0
    play_m: float = 0.0  # half width, in the nut
    screw_ns_per_m: float = 170.0
    screw_n: float = 7.0  # Coulomb
    carriage_kg: float = 30.0
    guide_ns_per_m: float = 260.0
    guide_n: float = 9.0
    upwards: float = 1.12  # of the guide, over downwards
    breakaway: float = 1.3  # static over Coulomb
    stribeck_m_per_s: float = 0.011
    screw_bristle_n_per_m: float = 5.0e5
    guide_bristle_n_per_m: float = 3.5e5
    rope_n: float = 6.0e5  # per strain
    rope_ns_per_m: float = 260.0
    rope_m: float = 3.0  # on either side, where it begins
    sheave_kg: float = 4.0  # as seen along the rope
    sheave_n_per_n: float = 0.006  # friction by what it carries
    weight_kg: float = 30.0
    short_kg: float = 0.6  # by which the weight is lighter than what it was made for
    radius_m: float = 0.06
    off_axis_m: float = 4.0e-5
    creep_m: float = 2.0e-5  # of the rope on the sheave
    floor_m: float = 1.25
    encoder_lag_s: float = 0.0008


_Parameters = parameters_of(Unit)
SPREAD = {
    "force": 0.02, "screw_n": 0.15, "guide_n": 0.15, "upwards": 0.06, "carriage_kg": 0.0, "weight_kg": 0.0,
    "short_kg": 0.8, "off_axis_m": 0.4, "creep_m": 0.4, "radius_m": 0.003,
}  # fmt: skip


draw = drawing(Unit(), SPREAD, 0.08)


@njit(cache=True)
def _bristle(p: Any, s: Array, at: int, v: float, level: float, stiffness: float, dt: float) -> float:
    """Friction of a bristle that is bent so far, with the Stribeck dip of its level."""
    most = level * (1.0 + (p.breakaway - 1.0) * math.exp(-((v / p.stribeck_m_per_s) ** 2)))
    s[at] = (s[at] + dt * v) / (1.0 + dt * stiffness * abs(v) / most)
    return float(stiffness * s[at])


@njit(cache=True)
def _pull(p: Any, stretch: float, speed: float, length: float) -> float:
    """Of a rope, which does not push."""
    return max(p.rope_n / max(length, SHORTEST_M) * stretch + p.rope_ns_per_m * speed, 0.0)


@njit(cache=True)
def _step(p: Any, s: Array, command: float, dt: float) -> None:
    """Amplifier, screw, carriage, sheave, weight and encoder over one step; all ways count as the carriage's up."""
    s[0] += (p.force * command - s[0]) * dt / p.force_lag_s
    push = s[0] / (1.0 + (s[0] / p.ceiling_n) ** 4) ** 0.25
    apart = s[1] - s[3]
    nut = 0.0
    if abs(apart) > p.play_m:
        nut = p.nut_n_per_m * (apart - math.copysign(p.play_m, apart)) + p.nut_ns_per_m * (s[2] - s[4])
    before = _pull(p, s[5] - s[3], s[6] - s[4], p.rope_m - s[3])
    behind = _pull(p, s[7] - s[5], s[8] - s[6], p.rope_m + s[7])
    screw = _bristle(p, s, 9, s[2], p.screw_n, p.screw_bristle_n_per_m, dt) + p.screw_ns_per_m * s[2]
    level = p.guide_n * (p.upwards if s[4] > 0.0 else 1.0)
    guide = _bristle(p, s, 10, s[4], level, p.guide_bristle_n_per_m, dt) + p.guide_ns_per_m * s[4]
    sheave = _bristle(p, s, 11, s[6], p.sheave_n_per_n * (before + behind) + 0.1, p.screw_bristle_n_per_m, dt)
    weight = p.weight_kg - p.short_kg
    s[2] += dt * (push - screw - nut) / p.screw_kg
    s[4] += dt * ((nut + before - guide) / p.carriage_kg - GRAVITY)
    s[6] += dt * (behind - before - sheave) / p.sheave_kg
    s[8] += dt * (GRAVITY - behind / weight)
    for k in range(1, 9, 2):
        s[k] += dt * s[k + 1]
    s[12] = (s[12] + dt * s[6]) / (1.0 + dt * abs(s[6]) / p.creep_m)
    turned = s[5] - s[12]
    read = p.floor_m + turned + p.off_axis_m * math.sin(turned / p.radius_m)
    s[13] += (read - s[13]) * dt / p.encoder_lag_s


@njit(cache=True)
def _run(p: Any, command: Array, step_s: float, substeps: int) -> Array:
    out = np.empty(command.size)
    dt = step_s / substeps
    # force, screw, carriage, sheave, weight (each with its speed), bristles of screw, guide, sheave, creep, encoder
    s = np.zeros(14)
    hangs = GRAVITY * (p.weight_kg - p.short_kg) * p.rope_m / p.rope_n
    s[5], s[7] = hangs, 2.0 * hangs
    s[13] = p.floor_m + hangs
    for k in range(command.size):
        out[k] = MM * s[13]
        for _ in range(substeps):
            _step(p, s, command[k], dt)
    return out


respond = answering(_run, _Parameters, CHANNELS, STEP_S, SUBSTEPS)
"""Position in mm over the floor as the sheave shows it, without noise, at the samples of a force in N."""


CHANGES = {
    "friction_rise": more(guide_n=30.0),
    "breakaway_rise": more(breakaway=8.0),
    "asymmetry": more(upwards=2.0),
    "play": more(play_m=1.0e-3),
    "damping_change": scaled(screw_ns_per_m=1.0, guide_ns_per_m=1.0),
    "gain_loss": scaled(force=-0.4),
    "mass_change": scaled(carriage_kg=0.7, weight_kg=0.7),
    "rope_soft": divided(rope_n=8.0, rope_ns_per_m=2.0),
    "rope_creep": more(creep_m=3.0e-3),
    "encoder_loose": more(off_axis_m=3.0e-3),
    "sheave_dry": more(sheave_n_per_n=0.06),
    "force_ceiling": fading(ceiling_n=0.2),
    "zero_shift": more(short_kg=1.2),
    "sensor_lag": more(encoder_lag_s=0.05),
}
