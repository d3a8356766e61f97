"""hpv41_curved: a spool with notches, soft stops and flow force, seen by a turbine flow sensor.

Brevini HPV41 (Tørdal, Klausen, Bak); textbook physics (Merritt; Jelali & Kroll). **What differs** from a chain of
filters and a straight curve with corners: the opening is curved throughout, from triangular notches through the
full edge to the channel behind it; a proportional loop on the measured spool drives a pilot pressure that moves a
spool with mass, oil film, spring, sticking friction and steady flow force; the ends are soft pads that push back
before they stop; the flow sensor is a rotor that follows faster at more flow, behind it a converter of its own lag;
both sides differ. 100 % is about 70 l/min, the dead band about ±25 %. Masses, springs and the loop are assumed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numba import njit

from tests.studies.skeletons import Array, answering, divided, drawing, more, parameters_of, scaled

PLANT = "brevini-hpv41"
CHANNELS = {"command": "%", "flow": "l/min"}
STEP_S = 0.004
NOISE = {"flow": 0.25}
SUBSTEPS = 60  # 15 kHz
SETTLE_S = 3.0
LPM = 6.0e4  # l/min in m³/s
DENSITY, DISCHARGE, JET = 870.0, 0.65, 0.36  # kg/m³; coefficient; cosine of the jet's angle


@dataclass(frozen=True)
class Unit:
    """One valve, its loop, spool, notches and sensor."""

    stroke_m: float = 7.0e-3  # at 100 %
    loop_n_per_m: float = 1.9e5  # pilot force per error of position
    forward_n_per_m: float = 9.0e4  # pilot force per commanded position
    pilot_limit_n: float = 900.0
    pilot_rad_per_s: float = 34.0
    pilot_damping: float = 0.6
    spool_kg: float = 0.35
    spool_ns_per_m: float = 3.8e4  # oil film and the pilot's damping orifice
    spring_n_per_m: float = 9.0e4
    neutral_m: float = 0.0
    coulomb_n: float = 9.0
    breakaway: float = 1.35  # static over Coulomb
    one_side_n: float = 0.0  # more friction while it moves towards A
    stribeck_m_per_s: float = 0.003
    play_m: float = 0.0  # half width, between the driven and the metering part
    pad_a_m: float = 6.7e-3
    pad_b_m: float = 6.8e-3
    pad_n_per_m2: float = 6.0e8  # the pad stiffens as it is pressed
    overlap_a_m: float = 1.55e-3
    overlap_b_m: float = 1.7e-3
    notch_m: float = 1.1e-3  # depth over which only the notches open
    notch_width: float = 1.9  # m² of opening per m² of travel
    edge_width_m: float = 10.8e-3
    edge_m: float = 5.0e-5  # rounding
    side_b: float = 1.06  # opening of side B over side A
    channel_m2: float = 5.6e-5  # what the notches lead into
    leak_m2: float = 0.0  # past the edge towards A
    drop_pa: float = 9.0e5  # that the compensator keeps
    drop_rise: float = 0.06  # of it, as its spring is pressed at 70 l/min
    spare_pa: float = 4.0e6  # supply over the load
    sag_pa_per_lpm: float = 1.0e4
    sag_lag_s: float = 0.03
    rotor_l: float = 0.4  # lag in s times flow in l/min
    rotor_lpm: float = 12.0
    converter_lag_s: float = 0.012


_Parameters = parameters_of(Unit)
SPREAD = {"stroke_m": 0.0, "overlap_a_m": 0.03, "overlap_b_m": 0.03, "coulomb_n": 0.2, "side_b": 0.02, "pad_a_m": 0.02}


draw = drawing(Unit(), SPREAD, 0.04)


@njit(cache=True)
def _ramp(past: float, rounding: float) -> float:
    """Nothing before an edge, travel past it, rounded in between."""
    return 0.5 * (past + math.sqrt(past * past + rounding * rounding))


@njit(cache=True)
def _area(p: Any, past_m: float) -> float:
    """Opening of one side: notches, then the edge, then the channel in series."""
    deep = _ramp(past_m, p.edge_m)
    edge = _ramp(deep - p.notch_m, p.edge_m + 0.3 * p.notch_m)
    notch = p.notch_width * deep * deep / (1.0 + deep / p.notch_m)
    opening = notch + p.edge_width_m * edge
    return float(opening / math.sqrt(1.0 + (opening / p.channel_m2) ** 2))


@njit(cache=True)
def _pads(p: Any, x: float) -> float:
    """Force of the soft stops."""
    into_a, into_b = max(0.0, x - p.pad_a_m), max(0.0, -x - p.pad_b_m)
    return float(p.pad_n_per_m2 * (into_b * into_b - into_a * into_a))


@njit(cache=True)
def _spool(p: Any, s: Array, command: float, flow_force: float, dt: float) -> None:
    """Loop, pilot force, spool and the metering part it carries along."""
    wanted = command * 0.01 * p.stroke_m
    force = p.loop_n_per_m * (wanted - s[2]) + p.forward_n_per_m * wanted
    force = max(-p.pilot_limit_n, min(p.pilot_limit_n, force))
    w = p.pilot_rad_per_s
    s[1] += dt * w * (w * (force - s[0]) - 2.0 * p.pilot_damping * s[1])
    s[0] += dt * s[1]
    push = s[0] - p.spring_n_per_m * (s[2] - p.neutral_m) + _pads(p, s[2]) - flow_force
    grip = p.coulomb_n * (1.0 + (p.breakaway - 1.0) * math.exp(-abs(s[3]) / p.stribeck_m_per_s))
    heavy = p.spool_kg + dt * p.spool_ns_per_m
    free = (p.spool_kg * s[3] + dt * push) / heavy
    grip = (grip + (p.one_side_n if free > 0.0 else 0.0)) * dt / heavy
    s[3] = 0.0 if abs(free) <= grip else free - math.copysign(grip, free)
    s[2] += dt * s[3]
    s[4] = max(s[2] - p.play_m, min(s[2] + p.play_m, s[4]))


@njit(cache=True)
def _step(p: Any, s: Array, command: float, dt: float) -> None:
    """Spool, flow and both parts of the sensor over one step."""
    a = _area(p, s[4] - p.overlap_a_m) + p.leak_m2
    b = p.side_b * _area(p, -s[4] - p.overlap_b_m)
    kept = p.drop_pa * (1.0 + p.drop_rise * s[5] / 70.0)
    left = max(p.spare_pa - p.sag_pa_per_lpm * s[5], 1.0e4)
    drop = kept * left / (kept**6 + left**6) ** (1.0 / 6.0)
    flow = LPM * DISCHARGE * (a - b) * math.sqrt(2.0 * drop / DENSITY)
    _spool(p, s, command, 2.0 * DISCHARGE * JET * (a - b) * drop, dt)
    s[5] += (abs(flow) - s[5]) * dt / p.sag_lag_s
    s[6] += (flow - s[6]) * dt / (p.rotor_l / (abs(s[6]) + p.rotor_lpm) + dt)
    s[7] += (s[6] - s[7]) * dt / (p.converter_lag_s + dt)


@njit(cache=True)
def _run(p: Any, command: Array, step_s: float, substeps: int) -> Array:
    out = np.empty(command.size)
    dt = step_s / substeps
    s = np.zeros(8)  # pilot force, its rate, spool, speed, metering part, flow drawn, rotor, converter
    for _ in range(int(SETTLE_S / dt)):
        _step(p, s, command[0], dt)
    for k in range(command.size):
        out[k] = s[7]
        for _ in range(substeps):
            _step(p, s, command[k], dt)
    return out


respond = answering(_run, _Parameters, CHANNELS, STEP_S, SUBSTEPS)
"""Flow, without noise, at the samples of a command in %."""


CHANGES = {
    "friction_rise": more(coulomb_n=180.0),
    "breakaway_rise": more(breakaway=16.0),
    "stiction_one_side": more(one_side_n=250.0),
    "play": more(play_m=0.7e-3),
    "slower_pilot": divided(pilot_rad_per_s=0.6),
    "damping_change": scaled(spool_ns_per_m=1.5),
    "edge_worn": more(edge_m=1.6e-3),
    "leakage": more(leak_m2=4.5e-6),
    "supply_sag": more(sag_pa_per_lpm=7.0e4),
    "zero_shift": more(neutral_m=2.4e-3),
    "gain_loss": lambda u, a: replace(u, drop_pa=u.drop_pa * (1.0 - 0.25 * a) ** 2),
    "asymmetry": scaled(side_b=-0.3),
    "stroke_stop": more(pad_a_m=-2.6e-3, pad_b_m=-2.6e-3),
    "sensor_lag": more(rotor_l=4.0),
}
