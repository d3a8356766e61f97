"""cylinder_open_centre: a spool shuts the pump's way to the tank as it opens the cylinder's, behind piloted checks.

HydraForce block and cylinder after Gunay 2017 (bore 50, rod 30, stroke 250 mm, 11.4 l/min), taken as an **open
centre**: the pump gives a flow and no pressure, the spool's bypass throttles it until it rather lifts the check of the
cylinder, and the **check of the other side opens by the pressure of this one**. Textbook physics (Merritt; Jelali and
Kroll; bristle friction after Canudas de Wit). **What differs** from a curve that is integrated: the flow is a share of
the pump's, by three edges in a loop and the load; pressures of the pump and both chambers, whose volume goes with the
place; two poppets as states; the bypass shuts less on the side of the rod; flow force on the spool; a Stribeck dip in
the seals; ends that cushion. There is no inner signal. What is not of the paper is assumed.
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
STEP_S = 0.002
NOISE = {"position": 0.05}
SUBSTEPS = 100  # 50 kHz
SETTLE_S = 0.5
SOFT_BAR = 0.5  # below this drop an orifice turns laminar
VAPOUR_BAR = -0.9
STOP_N = 2.0e4  # of an end, per mm
STOP_N_S = 20.0


@dataclass(frozen=True)
class Unit:
    """One spool with its magnets, edges and bypass, the checks, pump, cylinder, load and sensor."""

    magnet_n: float = 12.0  # per A
    magnet_lag_s: float = 0.009
    magnet_play_a: float = 0.006
    spool_n_s2: float = 8.0e-5  # per mm
    spool_n_s: float = 0.03  # per mm
    spring_n: float = 5.0  # per mm
    spool_push_n: float = 0.01  # that the springs do not balance
    flow_force_n: float = 6.0e-4  # per cm³/s and √bar
    spool_coulomb_n: float = 0.15
    spool_slip_n: float = 25.0  # per mm
    spool_stop_mm: float = 2.6
    round_mm: float = 0.03
    lap_mm: float = 0.55  # of the edges from the pump
    edge_a: float = 22.0  # cm³/s per √bar and mm
    edge_b: float = 25.0
    back_mm: float = 0.15  # by which the edges to the tank are open at rest
    back_a: float = 30.0
    back_b: float = 26.0
    bypass: float = 82.0  # cm³/s per √bar and mm
    bypass_mm: float = 1.35  # where it is shut
    bypass_a: float = 0.5  # cm³/s per √bar that stay
    bypass_b: float = 10.0
    pump_cm3: float = 190.0
    pump_leak_cm3: float = 0.2  # per bar
    relief_bar: float = 70.0
    supply_cm3_per_bar: float = 0.03
    crack_bar: float = 1.5
    check_a: float = 70.0  # cm³/s per √bar
    check_b: float = 70.0
    check_ratio: float = 3.0
    check_range_bar: float = 6.0
    check_lag_s: float = 0.006
    bulk_bar: float = 9000.0
    dead_cm3: float = 45.0
    bore_cm2: float = 19.635
    ring_cm2: float = 12.566
    stroke_mm: float = 250.0
    piston_leak: float = 0.05  # cm³/s per √bar
    cushion_mm: float = 18.0
    cushion: float = 2.0  # what is left of the way out
    mass_n_s2: float = 0.09  # per mm
    seal_n: float = 140.0
    seal_break: float = 1.35  # static over Coulomb
    seal_stribeck: float = 4.0  # mm/s
    seal_bristle_n: float = 4000.0  # per mm
    seal_n_s: float = 1.2  # per mm
    rod_n: float = 40.0  # that pushes it in
    sensor_lag_s: float = 0.003


_Parameters = parameters_of(Unit)
SPREAD = {
    "magnet_n": 0.02, "spring_n": 0.02, "lap_mm": 0.03, "bypass_mm": 0.03, "pump_cm3": 0.03, "bore_cm2": 0.003,
    "ring_cm2": 0.003, "stroke_mm": 0.002, "spool_coulomb_n": 0.25, "magnet_play_a": 0.25, "seal_n": 0.2,
    "spool_push_n": 0.5, "rod_n": 0.5, "bulk_bar": 0.15,
}  # fmt: skip


draw = drawing(Unit(), SPREAD, 0.05)


_root = orifice_root(SOFT_BAR)


@njit(cache=True)
def _both(one: float, other: float) -> float:
    """Two orifices in a row."""
    return one * other / math.sqrt(one * one + other * other + 1e-12)


@njit(cache=True)
def _spool(p: Any, s: Array, current: float, push: float, dt: float) -> None:
    """Magnet with lag and play, spool between springs, flow force and friction over one step."""
    s[0] += (current - s[0]) * dt / p.magnet_lag_s
    s[1] = max(s[0] - p.magnet_play_a, min(s[0] + p.magnet_play_a, s[1]))
    reach = p.spool_coulomb_n / p.spool_slip_n
    s[4] = max(-reach, min(s[4] + dt * s[3], reach))
    net = p.magnet_n * s[1] + p.spool_push_n - p.spring_n * s[2] - p.spool_slip_n * s[4] - push
    s[3] = (s[3] + dt * net / p.spool_n_s2) / (1.0 + dt * p.spool_n_s / p.spool_n_s2)
    s[2] += dt * s[3]
    if abs(s[2]) > p.spool_stop_mm:
        s[2], s[3] = math.copysign(p.spool_stop_mm, s[2]), 0.0


@njit(cache=True)
def _way(p: Any, s: Array, k: int, edge: float, back: float, check: float, out_mm: float) -> tuple[float, float, float]:
    """Flow into chamber k (0: A, 1: B), that out of it, and the pressure between its check and the spool."""
    chamber = s[6 + k]
    lifts = chamber + p.crack_bar
    between = s[5] * edge * edge / (edge * edge + back * back + 1e-9)  # while its check is shut
    into = max(_both(edge, check) * _root(max(s[5] - lifts, 0.0)) - back * _root(max(lifts, 0.0)), 0.0)
    if into > 0.0:
        between = lifts + (into / check) ** 2
    cushion = p.cushion + 60.0 * (out_mm / p.cushion_mm) ** 2 if out_mm < p.cushion_mm else 1e6
    out = _both(_both(back, check * s[8 + k]), cushion) * _root(max(chamber, 0.0))
    return into, out, between


@njit(cache=True)
def _piston(p: Any, s: Array, dt: float) -> None:
    """Piston between its chambers, seals, load and ends over one step."""
    v = s[11]
    level = p.seal_n * (1.0 + (p.seal_break - 1.0) * math.exp(-((v / p.seal_stribeck) ** 2)))
    s[12] = (s[12] + dt * v) / (1.0 + dt * p.seal_bristle_n * abs(v) / level)
    net = 10.0 * (p.bore_cm2 * s[6] - p.ring_cm2 * s[7]) - p.rod_n - p.seal_bristle_n * s[12]
    past = min(s[10], 0.0) + max(s[10] - p.stroke_mm, 0.0)
    damping = p.seal_n_s + (STOP_N_S if past != 0.0 else 0.0)
    net -= STOP_N * past
    s[11] = (v + dt * net / p.mass_n_s2) / (1.0 + dt * damping / p.mass_n_s2)
    s[10] += dt * s[11]


@njit(cache=True)
def _step(p: Any, s: Array, current: float, dt: float) -> None:
    """Spool, pump, checks, chambers, piston and sensor over one step."""
    x = s[2]
    edge_a, edge_b = p.edge_a * past_edge(x - p.lap_mm, p.round_mm), p.edge_b * past_edge(-x - p.lap_mm, p.round_mm)
    back_a, back_b = p.back_a * past_edge(p.back_mm - x, p.round_mm), p.back_b * past_edge(x + p.back_mm, p.round_mm)
    bypass = p.bypass * past_edge(p.bypass_mm - abs(x), p.round_mm) + (p.bypass_a if x > 0.0 else p.bypass_b)
    to_a, from_a, between_a = _way(p, s, 0, edge_a, back_a, p.check_a, s[10])
    to_b, from_b, between_b = _way(p, s, 1, edge_b, back_b, p.check_b, p.stroke_mm - s[10])
    push = to_a * math.sqrt(max(s[5] - between_a, 0.0)) - to_b * math.sqrt(max(s[5] - between_b, 0.0))
    _spool(p, s, current, p.flow_force_n * push, dt)
    let = bypass * _root(s[5]) + p.pump_leak_cm3 * s[5] + 40.0 * max(s[5] - p.relief_bar, 0.0)
    s[5] = max(s[5] + dt * (p.pump_cm3 - let - to_a - to_b) / p.supply_cm3_per_bar, 0.0)
    for k, pilot in ((0, between_b), (1, between_a)):
        lift = (p.check_ratio * pilot - s[6 + k] - p.crack_bar) / p.check_range_bar
        s[8 + k] += (min(max(lift, 0.0), 1.0) - s[8 + k]) * dt / p.check_lag_s
    past = p.piston_leak * _root(s[6] - s[7])
    place = min(max(s[10], 0.0), p.stroke_mm)
    volume_a = p.dead_cm3 + 0.1 * p.bore_cm2 * place
    volume_b = p.dead_cm3 + 0.1 * p.ring_cm2 * (p.stroke_mm - place)
    gained_a = to_a - from_a - past - 0.1 * p.bore_cm2 * s[11]
    gained_b = to_b - from_b + past + 0.1 * p.ring_cm2 * s[11]
    s[6] = max(s[6] + dt * gained_a * p.bulk_bar / volume_a, VAPOUR_BAR)
    s[7] = max(s[7] + dt * gained_b * p.bulk_bar / volume_b, VAPOUR_BAR)
    _piston(p, s, dt)
    s[13] += (s[10] - s[13]) * dt / p.sensor_lag_s


@njit(cache=True)
def _run(p: Any, command: Array, step_s: float, substeps: int) -> Array:
    out = np.empty(command.size)
    dt = step_s / substeps
    # current, its play, spool, its speed, friction, pump, chambers, checks, place, its speed, bristle, sensor
    s = np.zeros(14)
    s[5], s[6], s[7] = 4.0, 0.5, 0.5
    s[10] = s[13] = 0.5 * p.stroke_mm
    for _ in range(int(SETTLE_S / dt)):
        _step(p, s, 0.0, dt)
    for k in range(command.size):
        out[k] = s[13]
        for _ in range(substeps):
            _step(p, s, command[k], dt)
    return out


respond = answering(_run, _Parameters, CHANNELS, STEP_S, SUBSTEPS)
"""Place of the piston from the end where it is in, without noise, at the samples of a current in A."""


CHANGES = {
    "friction_rise": more(spool_coulomb_n=1.5),
    "seal_rise": more(seal_n=1500.0),
    "magnetic_hysteresis": more(magnet_play_a=0.08),
    "slower_pilot": more(magnet_lag_s=0.12),
    "damping_change": scaled(spool_n_s=15.0),
    "edge_worn": more(round_mm=0.6),
    "leakage": more(piston_leak=12.0),
    "supply_sag": scaled(pump_cm3=-0.5),
    "bypass_worn": more(bypass_a=15.0, bypass_b=15.0),
    "zero_shift": more(spool_push_n=1.2),
    "rod_load": more(rod_n=2500.0),
    "gain_loss": scaled(magnet_n=-0.2),
    "orifice_clogged": scaled(back_a=-0.7),
    "check_clogged": scaled(check_a=-0.8),
    "stroke_stop": more(spool_stop_mm=-1.5),
    "sensor_lag": more(sensor_lag_s=0.15),
}
