"""cylinder_rocker: a weight tilts over its pivot behind one piloted check; an accumulator is charged and let go.

HydraForce valve and cylinder after Gunay 2017 (bore 50, rod 30, stroke 250 mm, 11.4 l/min), taken on a **rocking
load**: way and lever of the cylinder follow from a triangle, the weight pushes on one side of the pivot and pulls on
the other. Textbook physics (Merritt; Jelali and Kroll; bristle friction after Canudas de Wit). **What differs** from a
curve that is integrated: a magnet's force that is quadratic at first against captive springs; a **supply that swings
between two pressures**, since a pump charges an accumulator and is let go; a check of the head side that the other
line opens, late; a pressure each in the hose before it and in both chambers, gas behind an orifice at the rod's;
friction of the pins by what they carry; and a **wire beside the pin** as sensor, whose way is another triangle's and
which counts from its own drum. There is no inner signal. What is not of the paper is assumed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from tests.studies.skeletons import Array, answering, drawing, more, orifice_root, parameters_of, past_edge, scaled

PLANT = "hydraforce-open-loop"
CHANNELS = {"current": "A", "position": "mm"}
STEP_S = 0.0025
NOISE = {"position": 0.08}
SUBSTEPS = 125  # 50 kHz
SETTLE_S = 0.5
SOFT_BAR = 0.5  # below this drop an orifice turns laminar
VAPOUR_BAR = -0.9
STOP_N = 2.0e4  # of an end, per mm
STOP_N_S = 60.0
CAPTIVE_MM = 0.02  # over which a captive spring takes hold
GRAVITY_MM = 9810.0  # per s²


@dataclass(frozen=True)
class Unit:
    """One spool with its magnets and edges, supply, check, cylinder, rocker and wire."""

    magnet_n: float = 30.0  # per A
    magnet_a: float = 0.15  # below it the force is quadratic
    magnet_lag_s: float = 0.008
    magnet_play_a: float = 0.006
    spool_n_s2: float = 6.0e-5  # per mm
    spool_n_s: float = 0.035  # per mm
    spring_n: float = 9.2  # per mm
    captive_n: float = 7.0
    spool_push_n: float = 0.05
    flow_force_n: float = 7.0e-4  # per cm³/s and √bar
    spool_coulomb_n: float = 0.3
    spool_slip_n: float = 30.0  # per mm
    spool_stop_mm: float = 2.5
    round_mm: float = 0.03
    lap_mm: float = 0.16
    edge_a: float = 25.0  # cm³/s per √bar and mm
    edge_b: float = 21.0
    back_a: float = 27.0
    back_b: float = 30.0
    spool_leak: float = 0.01  # cm³/s per √bar, of each edge
    pump_cm3: float = 240.0
    charged_bar: float = 70.0  # where the pump is let go
    charging_bar: float = 60.0  # where it comes back
    gas_bar: float = 45.0
    gas_cm3: float = 600.0
    crack_bar: float = 1.0
    check: float = 75.0  # cm³/s per √bar
    check_ratio: float = 4.0
    check_range_bar: float = 8.0
    check_lag_s: float = 0.012
    hose_cm3_per_bar: float = 0.02
    bulk_bar: float = 9000.0
    dead_cm3: float = 60.0
    soft_bar: float = 12.0  # gas at the side of the rod
    soft_cm3: float = 25.0
    soft: float = 12.0  # its orifice, cm³/s per √bar
    bore_cm2: float = 19.635
    ring_cm2: float = 12.566
    stroke_mm: float = 250.0
    piston_leak: float = 0.04  # cm³/s per √bar
    seal_n: float = 130.0
    seal_break: float = 1.3  # static over Coulomb
    seal_stribeck: float = 5.0  # mm/s
    seal_bristle_n: float = 5000.0  # per mm
    seal_n_s: float = 1.5  # per mm
    pins: float = 0.06  # friction of each
    pin_mm: float = 15.0
    closed_mm: float = 350.0  # between its pins with the rod in
    arm_mm: float = 220.0
    base_mm: float = 460.0
    weight_n: float = 2200.0
    weight_mm: float = 340.0
    upright_rad: float = 1.42  # where it stands over the pivot
    frame_nmm_s2: float = 6.0e3  # of the rocker without the weight
    wire_arm_mm: float = 205.0
    wire_base_mm: float = 480.0
    wire_rad: float = 0.06  # by which its point lies beside the pin
    sensor_lag_s: float = 0.004


_Parameters = parameters_of(Unit)
SPREAD = {
    "magnet_n": 0.02, "spring_n": 0.02, "captive_n": 0.04, "bore_cm2": 0.003, "ring_cm2": 0.003, "stroke_mm": 0.002,
    "closed_mm": 0.002, "arm_mm": 0.004, "base_mm": 0.002, "wire_arm_mm": 0.01, "wire_base_mm": 0.01, "wire_rad": 0.5,
    "charged_bar": 0.015, "charging_bar": 0.015, "spool_coulomb_n": 0.25, "magnet_play_a": 0.25, "seal_n": 0.2,
    "pins": 0.2, "spool_push_n": 0.5, "bulk_bar": 0.15, "upright_rad": 0.02,
}  # fmt: skip


draw = drawing(Unit(), SPREAD, 0.05)


_root = orifice_root(SOFT_BAR)


@njit(cache=True)
def _side(arm: float, base: float, angle: float) -> float:
    """The third side of a triangle."""
    return math.sqrt(arm * arm + base * base - 2.0 * arm * base * math.cos(angle))


@njit(cache=True)
def _angle(p: Any, way: float) -> float:
    """Of the rocker, with the rod out so far."""
    length = p.closed_mm + way
    return math.acos((p.arm_mm**2 + p.base_mm**2 - length**2) / (2.0 * p.arm_mm * p.base_mm))


@njit(cache=True)
def _spool(p: Any, s: Array, current: float, push: float, dt: float) -> None:
    """Magnet with lag and play, spool between captive springs, flow force and friction over one step."""
    s[0] += (current - s[0]) * dt / p.magnet_lag_s
    s[1] = max(s[0] - p.magnet_play_a, min(s[0] + p.magnet_play_a, s[1]))
    driven = p.magnet_n * s[1] * abs(s[1]) / (abs(s[1]) + p.magnet_a)
    reach = p.spool_coulomb_n / p.spool_slip_n
    s[4] = max(-reach, min(s[4] + dt * s[3], reach))
    captive = p.captive_n * max(-1.0, min(s[2] / CAPTIVE_MM, 1.0))
    net = driven + p.spool_push_n - captive - p.spring_n * s[2] - p.spool_slip_n * s[4] - push
    s[3] = (s[3] + dt * net / p.spool_n_s2) / (1.0 + dt * p.spool_n_s / p.spool_n_s2)
    s[2] += dt * s[3]
    if abs(s[2]) > p.spool_stop_mm:
        s[2], s[3] = math.copysign(p.spool_stop_mm, s[2]), 0.0


@njit(cache=True)
def _rocker(p: Any, s: Array, dt: float) -> None:
    """Piston, seals, ends, rocker, pins and weight over one step."""
    length = _side(p.arm_mm, p.base_mm, s[12])
    lever = p.arm_mm * p.base_mm * math.sin(s[12]) / length
    way, speed = length - p.closed_mm, lever * s[13]
    level = p.seal_n * (1.0 + (p.seal_break - 1.0) * math.exp(-((speed / p.seal_stribeck) ** 2)))
    s[14] = (s[14] + dt * speed) / (1.0 + dt * p.seal_bristle_n * abs(speed) / level)
    push = 10.0 * (p.bore_cm2 * s[8] - p.ring_cm2 * s[9]) - p.seal_bristle_n * s[14]
    past = min(way, 0.0) + max(way - p.stroke_mm, 0.0)
    damping = p.seal_n_s + (STOP_N_S if past != 0.0 else 0.0)
    carried = abs(push) + p.weight_n
    turn = lever * (push - STOP_N * past) + p.weight_n * p.weight_mm * math.sin(s[12] - p.upright_rad)
    turn -= p.pins * p.pin_mm * carried * math.tanh(s[13] / 0.002)
    inertia = p.frame_nmm_s2 + p.weight_n / GRAVITY_MM * p.weight_mm**2
    s[13] = (s[13] + dt * turn / inertia) / (1.0 + dt * damping * lever * lever / inertia)
    s[12] += dt * s[13]


@njit(cache=True)
def _step(p: Any, s: Array, current: float, dt: float) -> None:
    """Spool, supply, check, chambers, rocker and wire over one step."""
    x = s[2]
    supply = p.gas_bar * (p.gas_cm3 / s[5]) ** 1.2
    edge_a = p.edge_a * past_edge(x - p.lap_mm, p.round_mm) + p.spool_leak
    edge_b = p.edge_b * past_edge(-x - p.lap_mm, p.round_mm) + p.spool_leak
    back_a = p.back_a * past_edge(-x - p.lap_mm, p.round_mm) + p.spool_leak
    back_b = p.back_b * past_edge(x - p.lap_mm, p.round_mm) + p.spool_leak
    to_a, to_b = edge_a * _root(supply - s[7]), edge_b * _root(supply - s[9])
    from_a, from_b = back_a * _root(s[7]), back_b * _root(s[9])
    push = (to_a - from_a) * math.sqrt(abs(supply - s[7])) - (to_b - from_b) * math.sqrt(abs(supply - s[9]))
    _spool(p, s, current, p.flow_force_n * push, dt)
    if supply > p.charged_bar:
        s[6] = 0.0
    elif supply < p.charging_bar:
        s[6] = 1.0
    s[5] = min(s[5] + dt * (to_a + to_b - s[6] * p.pump_cm3), p.gas_cm3)
    lift = (p.check_ratio * s[9] - s[8] - p.crack_bar) / p.check_range_bar
    s[10] += (min(max(lift, 0.0), 1.0) - s[10]) * dt / p.check_lag_s
    through = p.check * _root(max(s[7] - s[8] - p.crack_bar, 0.0)) - p.check * s[10] * _root(max(s[8] - s[7], 0.0))
    s[7] = max(s[7] + dt * (to_a - from_a - through) / p.hose_cm3_per_bar, VAPOUR_BAR)
    gas = p.soft_bar * (p.soft_cm3 / s[11]) ** 1.3
    stored = p.soft * _root(s[9] - gas)
    s[11] = min(s[11] - dt * stored, p.soft_cm3)
    if s[11] == p.soft_cm3:
        stored = max(stored, 0.0)  # it is empty of oil
    length = _side(p.arm_mm, p.base_mm, s[12])
    swept = 0.1 * p.arm_mm * p.base_mm * math.sin(s[12]) / length * s[13]
    place = min(max(length - p.closed_mm, 0.0), p.stroke_mm)
    past = p.piston_leak * _root(s[8] - s[9])
    volume_a = p.dead_cm3 + 0.1 * p.bore_cm2 * place
    volume_b = p.dead_cm3 + 0.1 * p.ring_cm2 * (p.stroke_mm - place)
    s[8] = max(s[8] + dt * (through - past - p.bore_cm2 * swept) * p.bulk_bar / volume_a, VAPOUR_BAR)
    gained = to_b - from_b + past - stored + p.ring_cm2 * swept
    s[9] = max(s[9] + dt * gained * p.bulk_bar / volume_b, VAPOUR_BAR)
    _rocker(p, s, dt)
    wire = _side(p.wire_arm_mm, p.wire_base_mm, s[12] + p.wire_rad)
    s[15] += (wire - s[15]) * dt / p.sensor_lag_s


@njit(cache=True)
def _run(p: Any, command: Array, step_s: float, substeps: int) -> Array:
    out = np.empty(command.size)
    dt = step_s / substeps
    # current, its play, spool, its speed, friction, gas of the supply, charging, hose A, chambers, check, gas at the
    # rod, angle, its rate, bristle, wire
    s = np.zeros(16)
    s[5] = p.gas_cm3 * (p.gas_bar / (0.5 * (p.charged_bar + p.charging_bar))) ** (1.0 / 1.2)
    s[7], s[8], s[9] = 1.0, 1.0, 1.0
    s[11] = p.soft_cm3
    s[12] = _angle(p, 0.5 * p.stroke_mm)
    s[15] = _side(p.wire_arm_mm, p.wire_base_mm, s[12] + p.wire_rad)
    for _ in range(int(SETTLE_S / dt)):
        _step(p, s, 0.0, dt)
    for k in range(command.size):
        out[k] = s[15]
        for _ in range(substeps):
            _step(p, s, command[k], dt)
    return out


respond = answering(_run, _Parameters, CHANNELS, STEP_S, SUBSTEPS)
"""Length of the wire off its drum, without noise, at the samples of a current in A."""


CHANGES = {
    "friction_rise": more(spool_coulomb_n=4.0),
    "seal_rise": more(seal_n=2000.0),
    "pins_dry": more(pins=1.5),
    "magnetic_hysteresis": more(magnet_play_a=0.08),
    "slower_pilot": more(magnet_lag_s=0.12),
    "damping_change": scaled(spool_n_s=15.0),
    "edge_worn": more(round_mm=0.6),
    "leakage": more(piston_leak=12.0),
    "supply_sag": scaled(charged_bar=-0.5, charging_bar=-0.5, gas_bar=-0.5),
    "zero_shift": more(spool_push_n=4.0),
    "weight_shifted": more(upright_rad=-0.5),
    "gain_loss": scaled(magnet_n=-0.2),
    "springs_tired": scaled(captive_n=-0.6),
    "orifice_clogged": scaled(back_a=-0.7),
    "check_clogged": scaled(check=-0.85),
    "stroke_stop": more(spool_stop_mm=-2.0),
    "sensor_lag": more(sensor_lag_s=0.15),
}
