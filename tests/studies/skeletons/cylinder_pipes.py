"""cylinder_pipes: a cartridge valve with dither moves a platform through long pipes, fed by an accumulator.

HydraForce SP08-47C, cylinder, guide spindles and LVDT of Gunay 2017 (bore 50, rod 30, stroke 250 mm, 11.4 l/min);
textbook physics (Merritt; Jelali and Kroll; bristle friction after Canudas de Wit). **What differs** from a chain of
gain, lag and integrator: a **pressure at both ends of each pipe and the inertia of the oil between**; a gas volume that
the pump refills slower than a long stroke empties it; four edges of unequal width and overlap, flow force and unequal
centring springs; a magnet that saturates, whose push falls along its way, shaken by dither; spindles that grip the
more, the further the platform is from its middle; an LVDT with a bent scale. Pressures are those at the block. First
flow at 0.4 A and full at 1.1 A after the maker; masses, pipes and pressures are assumed: the paper gives none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from tests.studies.skeletons import Array, answering, drawing, fading, more, orifice_root, parameters_of, scaled

PLANT = "hydraforce-open-loop"
CHANNELS = {"current": "A", "position": "mm", "pressure A": "bar", "pressure B": "bar"}
STEP_S = 0.002
NOISE = {"position": 0.05, "pressure A": 2.0, "pressure B": 2.0}
SUBSTEPS = 50  # 25 kHz
SETTLE_S = 1.0
SOFT_BAR = 0.5  # below this drop an orifice turns laminar
DISCHARGE = 9.7  # cm³/s per mm² and √bar: 0.64·√(2/ρ) at 870 kg/m³
GAS = 1.3  # exponent of its changes
HALF_MM = 125.0  # of the stroke
HEAD_CM2, ROD_CM2 = 19.635, 12.566  # of bore 50 and rod 30
GRAVITY = 9.81
STOP_N_PER_MM, STOP_NS_PER_MM = 2.0e4, 60.0


@dataclass(frozen=True)
class Unit:
    """One valve, accumulator, pair of pipes, cylinder, platform and LVDT."""

    push_n_per_a: float = 18.5
    saturation_a: float = 1.8
    push_falls: float = 0.12  # over the stroke
    remanence_a: float = 0.006
    remanence_span_a: float = 0.12
    shift_a: float = 0.0
    coil_lag_s: float = 0.009
    dither_a: float = 0.06
    dither_hz: float = 110.0
    spool_kg: float = 0.026
    spool_ns_per_mm: float = 0.022
    spring_a_n_per_mm: float = 6.0  # of the spring that works against A
    spring_b_n_per_mm: float = 6.5
    preload_n: float = 3.0
    seat_mm: float = 0.03  # way over which captured springs take up their preload
    jet_n: float = 0.012  # per mm² and bar, closing
    coulomb_n: float = 0.35
    breakaway: float = 1.3  # static over Coulomb
    stribeck_mm_per_s: float = 4.0
    bristle_n_per_mm: float = 60.0
    stop_mm: float = 2.1
    overlap_pa_mm: float = 0.70
    overlap_at_mm: float = 0.62
    overlap_pb_mm: float = 0.74
    overlap_bt_mm: float = 0.65
    width_pa_mm: float = 1.75
    width_at_mm: float = 2.4
    width_pb_mm: float = 1.85
    width_bt_mm: float = 2.05
    round_mm: float = 0.03
    land_leak: float = 0.002  # cm³/s per bar, of each edge
    gas_cm3: float = 2400.0
    gas_bar: float = 75.0
    supply_bar: float = 135.0
    pump_cm3_s: float = 110.0
    pump_cm3_s_per_bar: float = 20.0
    block_cm3_per_bar: float = 0.005
    pipe_bar_s2_per_cm3: float = 1.0e-3
    pipe_a_bar_s_per_cm3: float = 0.09
    pipe_b_bar_s_per_cm3: float = 0.1
    pipe_bar_s2_per_cm6: float = 1.2e-4
    modulus_bar: float = 9000.0
    dead_cm3: float = 60.0
    piston_leak: float = 0.003
    platform_kg: float = 115.0
    seal_n: float = 110.0
    spindle_n: float = 60.0  # in the middle
    cocking: float = 0.9  # more of it at the ends, by this share
    downwards: float = 1.0  # of spindles, over upwards
    rest: float = 1.4  # static over Coulomb, of seal and spindles
    rest_mm_per_s: float = 7.0
    rest_n_per_mm: float = 4.0e3
    viscous_ns_per_mm: float = 4.0
    lvdt_bend: float = 0.004  # at the ends, by this share
    lvdt_play_mm: float = 0.0  # half width, of its core
    lvdt_rad_per_s: float = 450.0


_Parameters = parameters_of(Unit)
SPREAD = {
    "shift_a": 0.0, "dither_hz": 0.0, "stop_mm": 0.02, "overlap_pa_mm": 0.03, "overlap_at_mm": 0.03,
    "overlap_pb_mm": 0.03, "overlap_bt_mm": 0.03, "push_n_per_a": 0.02, "coulomb_n": 0.2, "remanence_a": 0.2,
    "round_mm": 0.2, "seal_n": 0.15, "spindle_n": 0.15, "land_leak": 0.25, "piston_leak": 0.25, "downwards": 0.08,
    "lvdt_bend": 0.3,
}  # fmt: skip


draw = drawing(Unit(), SPREAD, 0.05)


_root = orifice_root(SOFT_BAR)


@njit(cache=True)
def _area(p: Any, past_mm: float, width_mm: float) -> float:
    return float(width_mm * 0.5 * (past_mm + math.sqrt(past_mm * past_mm + p.round_mm * p.round_mm)))


@njit(cache=True)
def _bristle(s: Array, at: int, v: float, level: float, stiffness: float, dt: float) -> float:
    s[at] = (s[at] + dt * v) / (1.0 + dt * stiffness * abs(v) / level)
    return float(stiffness * s[at])


@njit(cache=True)
def _spool(p: Any, s: Array, current: float, jet_n: float, dt: float) -> None:
    """Current with dither, what the iron remembers, and the spool, over one step."""
    s[18] += dt
    asked = current + p.shift_a + p.dither_a * math.sin(2.0 * math.pi * p.dither_hz * s[18])
    rise = (asked - s[0]) * dt / p.coil_lag_s
    s[0] += rise
    s[1] += (rise - abs(rise) * s[1]) / p.remanence_span_a
    held = s[0] - p.remanence_a * s[1]
    x, v = s[2], s[3]
    push = p.push_n_per_a * held / (1.0 + (held / p.saturation_a) ** 4) ** 0.25
    push *= 1.0 - p.push_falls * abs(x) / p.stop_mm
    spring = (p.spring_a_n_per_mm if x > 0.0 else p.spring_b_n_per_mm) * x
    spring += p.preload_n * x / math.sqrt(x * x + p.seat_mm * p.seat_mm)
    level = p.coulomb_n * (1.0 + (p.breakaway - 1.0) * math.exp(-((v / p.stribeck_mm_per_s) ** 2)))
    net = push - spring - jet_n - _bristle(s, 4, v, level, p.bristle_n_per_mm, dt)
    rate = 1000.0 * dt / p.spool_kg
    s[3] = (v + rate * net) / (1.0 + rate * p.spool_ns_per_mm)
    s[2] = x + dt * s[3]
    if abs(s[2]) > p.stop_mm:
        s[2], s[3] = math.copysign(p.stop_mm, s[2]), 0.0


@njit(cache=True)
def _pipe(p: Any, flow: float, drop: float, laminar: float, dt: float) -> float:
    """Flow of a pipe after one step, from the pressures at its ends."""
    loss = laminar + p.pipe_bar_s2_per_cm6 * abs(flow)
    return float((flow + dt * drop / p.pipe_bar_s2_per_cm3) / (1.0 + dt * loss / p.pipe_bar_s2_per_cm3))


@njit(cache=True)
def _platform(p: Any, s: Array, dt: float) -> None:
    """Piston and platform over one step, then the LVDT."""
    y, v = s[11], s[12]
    grip = p.spindle_n * (1.0 + p.cocking * (y / HALF_MM) ** 2) * (p.downwards if v < 0.0 else 1.0)
    level = (p.seal_n + grip) * (1.0 + (p.rest - 1.0) * math.exp(-((v / p.rest_mm_per_s) ** 2)))
    force = 10.0 * (HEAD_CM2 * s[9] - ROD_CM2 * s[10]) - GRAVITY * p.platform_kg
    force -= _bristle(s, 13, v, level, p.rest_n_per_mm, dt)
    if abs(y) > HALF_MM:
        force -= STOP_N_PER_MM * (y - math.copysign(HALF_MM, y)) + STOP_NS_PER_MM * v
    rate = 1000.0 * dt / p.platform_kg
    s[12] = (v + rate * force) / (1.0 + rate * p.viscous_ns_per_mm)
    s[11] = y + dt * s[12]
    s[14] = max(s[11] - p.lvdt_play_mm, min(s[11] + p.lvdt_play_mm, s[14]))
    read = s[14] * (1.0 + p.lvdt_bend * (s[14] / HALF_MM) ** 2)
    s[16] += dt * p.lvdt_rad_per_s * (p.lvdt_rad_per_s * (read - s[15]) - 1.4 * s[16])
    s[15] += dt * s[16]


@njit(cache=True)
def _step(p: Any, s: Array, current: float, dt: float) -> None:
    """Spool, block, pipes, chambers, accumulator and platform over one step."""
    supply = p.gas_bar * (p.gas_cm3 / s[17]) ** GAS
    pa, at = _area(p, s[2] - p.overlap_pa_mm, p.width_pa_mm), _area(p, -s[2] - p.overlap_at_mm, p.width_at_mm)
    pb, bt = _area(p, -s[2] - p.overlap_pb_mm, p.width_pb_mm), _area(p, s[2] - p.overlap_bt_mm, p.width_bt_mm)
    block_a, block_b = s[5], s[6]
    jet = p.jet_n * (pa * (supply - block_a) + bt * block_b - pb * (supply - block_b) - at * block_a)
    _spool(p, s, current, jet, dt)
    from_a = DISCHARGE * pa * _root(supply - block_a) + p.land_leak * (supply - block_a)
    from_b = DISCHARGE * pb * _root(supply - block_b) + p.land_leak * (supply - block_b)
    out_a = DISCHARGE * at * _root(block_a) + p.land_leak * block_a
    out_b = DISCHARGE * bt * _root(block_b) + p.land_leak * block_b
    s[5] = max(block_a + dt * (from_a - out_a - s[7]) / p.block_cm3_per_bar, 0.0)
    s[6] = max(block_b + dt * (from_b - out_b - s[8]) / p.block_cm3_per_bar, 0.0)
    s[7] = _pipe(p, s[7], s[5] - s[9], p.pipe_a_bar_s_per_cm3, dt)
    s[8] = _pipe(p, s[8], s[6] - s[10], p.pipe_b_bar_s_per_cm3, dt)
    past = p.piston_leak * (s[9] - s[10])
    head = p.dead_cm3 + 0.1 * HEAD_CM2 * max(HALF_MM + s[11], 0.0)
    rod = p.dead_cm3 + 0.1 * ROD_CM2 * max(HALF_MM - s[11], 0.0)
    s[9] = max(s[9] + dt * p.modulus_bar / head * (s[7] - past - 0.1 * HEAD_CM2 * s[12]), 0.0)
    s[10] = max(s[10] + dt * p.modulus_bar / rod * (s[8] + past + 0.1 * ROD_CM2 * s[12]), 0.0)
    pumped = min(max(p.pump_cm3_s_per_bar * (p.supply_bar - supply), 0.0), p.pump_cm3_s)
    s[17] += dt * (from_a + from_b - pumped)
    _platform(p, s, dt)


@njit(cache=True)
def _run(p: Any, command: Array, step_s: float, substeps: int) -> Array:
    out = np.empty((3, command.size))
    dt = step_s / substeps
    # current, remanence, spool, its speed, bristle, block A and B, pipe A and B, head and rod, platform, its speed,
    # its bristle, core, LVDT, its rate, gas, clock of the dither
    s = np.zeros(19)
    s[6] = s[10] = 45.0
    s[5] = s[9] = (10.0 * ROD_CM2 * s[10] + GRAVITY * p.platform_kg) / (10.0 * HEAD_CM2)
    s[17] = p.gas_cm3 * (p.gas_bar / p.supply_bar) ** (1.0 / GAS)
    for _ in range(int(SETTLE_S / dt)):
        _step(p, s, command[0], dt)
    s[14] -= s[11]
    s[15] -= s[11]
    s[11] = 0.0
    for k in range(command.size):
        out[0, k], out[1, k], out[2, k] = s[15], s[5], s[6]
        for _ in range(substeps):
            _step(p, s, command[k], dt)
    return out


respond = answering(_run, _Parameters, CHANNELS, STEP_S, SUBSTEPS)
"""Position and both pressures at the block, without noise, at the samples of a current in A, from the middle."""


CHANGES = {
    "friction_rise": more(coulomb_n=5.0),
    "breakaway_rise": more(breakaway=20.0),
    "dither_lost": lambda unit, amount: more(coulomb_n=0.8)(scaled(dither_a=-1.0)(unit, amount), amount),
    "magnetic_hysteresis": more(remanence_a=0.1),
    "slower_pilot": more(coil_lag_s=0.08),
    "damping_change": more(spool_ns_per_mm=0.6),
    "edge_worn": more(round_mm=0.6),
    "leakage": more(piston_leak=1.0),
    "supply_sag": fading(gas_cm3=0.15, pump_cm3_s=0.3),
    "zero_shift": more(shift_a=0.15),
    "gain_loss": scaled(push_n_per_a=-0.25),
    "orifice_clogged": more(pipe_a_bar_s_per_cm3=1.5),
    "stroke_stop": more(stop_mm=-1.2),
    "asymmetry": more(downwards=25.0),
    "cocking_rise": more(cocking=200.0),
    "play": more(lvdt_play_mm=1.5),
    "sensor_lag": fading(lvdt_rad_per_s=0.03),
}
