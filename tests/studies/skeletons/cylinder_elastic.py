"""cylinder_elastic: the valve and cylinder of Gunay 2017, its load on an elastic mounting, on a small pump.

HydraForce SP08-47C. Textbook physics (Merritt; Jelali & Kroll; LuGre friction). **What differs** from a chain
of gain, lag and integrator: a second mass on a spring; chamber pressures and a supply line with its own volume, fed by
a pump with a relief valve; flow forces that close the spool; a coil that saturates; bristle friction on the spool and
LuGre friction on the seal; a piston that leaks; return edges that open later, in series with a return orifice. Outward
motion is positive. Masses, pressures and stiffnesses are assumed: the paper gives none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numba import njit

from tests.studies.skeletons import Array, answering, drawing, fading, more, parameters_of, scaled

PLANT = "hydraforce-open-loop"
CHANNELS = {"current": "A", "position": "mm", "pressure A": "bar", "pressure B": "bar"}
STEP_S = 0.002
NOISE = {"position": 0.05, "pressure A": 2.0, "pressure B": 2.0}
SUBSTEPS = 40  # 20 kHz
SETTLE_S = 2.0
ROUNDS = 4  # of settling, each from the balance at the present spool and supply
HALVINGS = 36
ROOT_PA = 5.0e4  # below this drop an orifice turns laminar
STOP_N_PER_M, STOP_NS_PER_M = 3.0e7, 5.0e4


@dataclass(frozen=True)
class Unit:
    """One valve, cylinder, load and pump."""

    coil_n_per_a: float = 30.0
    coil_knee_a: float = 2.0
    coil_lag_s: float = 0.009
    spool_kg: float = 0.04
    spool_ns_per_m: float = 90.0
    spring_n_per_m: float = 16.0e3
    spring_offset_n: float = 0.15
    spool_coulomb_n: float = 0.35
    spool_breakaway: float = 1.2  # static over Coulomb
    spool_bristle_n_per_m: float = 2.0e5
    spool_play_m: float = 0.0
    spool_stroke_m: float = 1.65e-3
    flow_force: float = 0.15  # N per m² of opening and Pa
    width_in_a_m: float = 2.5e-3
    width_in_b_m: float = 2.3e-3
    width_out_m: float = 3.5e-3
    overlap_in_m: float = 0.72e-3
    overlap_out_a_m: float = 0.78e-3
    overlap_out_b_m: float = 0.84e-3
    edge_radius_m: float = 3.0e-5
    return_m2: float = 6.0e-6
    discharge: float = 0.65
    oil_kg_per_m3: float = 870.0
    valve_leak_m3_per_pa_s: float = 3.0e-14
    piston_leak_m3_per_pa_s: float = 4.0e-14
    pump_m3_per_s: float = 2.7e-4
    pump_leak_m3_per_pa_s: float = 2.0e-12
    relief_pa: float = 1.2e7
    relief_m3_per_pa_s: float = 2.0e-10
    line_m3: float = 6.0e-4
    modulus_pa: float = 0.9e9
    bore_m2: float = 1963.5e-6
    ring_m2: float = 1256.6e-6
    stroke_m: float = 0.25
    dead_m3: float = 1.2e-4
    piston_kg: float = 60.0
    load_kg: float = 180.0
    mounting_n_per_m: float = 2.2e6
    mounting_ns_per_m: float = 2200.0
    weight_n: float = 900.0
    seal_n: float = 260.0
    seal_breakaway: float = 1.35
    seal_outward: float = 1.0  # friction outward over inward
    seal_bristle_n_per_m: float = 4.0e6
    seal_bristle_ns_per_m: float = 8.0e3
    seal_ns_per_m: float = 2000.0
    sensor_lag_s: float = 0.003


_Parameters = parameters_of(Unit)
SPREAD = {
    "bore_m2": 0.0,
    "ring_m2": 0.0,
    "stroke_m": 0.0,
    "spring_offset_n": 2.0,
    "seal_outward": 0.08,
    "oil_kg_per_m3": 0.01,
    "spool_coulomb_n": 0.15,
    "edge_radius_m": 0.2,
    "piston_leak_m3_per_pa_s": 0.25,
    "seal_n": 0.15,
    "coil_n_per_a": 0.03,
    "mounting_ns_per_m": 0.2,
}


draw = drawing(Unit(), SPREAD, 0.05)


@njit(cache=True)
def _area(p: Any, width_m: float, lap_m: float, travel_m: float) -> float:
    past = travel_m - lap_m
    return width_m * 0.5 * (past + math.sqrt(past * past + p.edge_radius_m**2))


@njit(cache=True)
def _orifice(p: Any, area_m2: float, drop_pa: float) -> float:
    root = drop_pa / math.sqrt(math.sqrt(drop_pa * drop_pa + ROOT_PA * ROOT_PA))
    return p.discharge * area_m2 * math.sqrt(2.0 / p.oil_kg_per_m3) * root + p.valve_leak_m3_per_pa_s * drop_pa


@njit(cache=True)
def _out(p: Any, lap_m: float, travel_m: float, chamber_pa: float) -> tuple[float, float]:
    """Flow to the tank through an edge and the return orifice in series, and the drop over the edge times its area."""
    edge = _area(p, p.width_out_m, lap_m, travel_m)
    both = edge * p.return_m2 / math.sqrt(edge * edge + p.return_m2**2)
    return _orifice(p, both, chamber_pa), both * both / edge * chamber_pa


@njit(cache=True)
def _flows(p: Any, x: float, p_a: float, p_b: float, p_s: float) -> tuple[float, float, float, float]:
    """Net flow into A and into B, flow drawn from the line, and the closing flow force on the spool."""
    edge_a, edge_b = _area(p, p.width_in_a_m, p.overlap_in_m, x), _area(p, p.width_in_b_m, p.overlap_in_m, -x)
    in_a, in_b = _orifice(p, edge_a, p_s - p_a), _orifice(p, edge_b, p_s - p_b)
    out_a, thrust_a = _out(p, p.overlap_out_a_m, -x, p_a)
    out_b, thrust_b = _out(p, p.overlap_out_b_m, x, p_b)
    thrust = edge_a * abs(p_s - p_a) + thrust_b - edge_b * abs(p_s - p_b) - thrust_a
    return in_a - out_a, in_b - out_b, in_a + in_b, p.flow_force * thrust


@njit(cache=True)
def _grip(p: Any, w: float) -> float:
    """Friction of the sliding seal."""
    side = p.seal_outward if w > 0.0 else 1.0
    return p.seal_n * side * (1.0 + (p.seal_breakaway - 1.0) * math.exp(-((w / 0.006) ** 2)))


@njit(cache=True)
def _chamber_b(p: Any, x: float, w: float, p_a: float, p_s: float) -> float:
    """The pressure in B at which its edges and the piston's leakage pass what a piston at this speed takes."""
    low, high = 0.0, 3.0 * p_s
    for _ in range(HALVINGS):
        mid = 0.5 * (low + high)
        inward = _flows(p, x, p_a, mid, p_s)[1] + p.piston_leak_m3_per_pa_s * (p_a - mid)
        low, high = (mid, high) if inward > -p.ring_m2 * w else (low, mid)
    return 0.5 * (low + high)


@njit(cache=True)
def _chambers(p: Any, x: float, w: float, p_s: float) -> tuple[float, float]:
    """Both pressures at which edges and leakage pass what a piston at this speed takes."""
    low, high = 0.0, 3.0 * p_s
    for _ in range(HALVINGS):
        mid = 0.5 * (low + high)
        p_b = _chamber_b(p, x, w, mid, p_s)
        inward = _flows(p, x, mid, p_b, p_s)[0] - p.piston_leak_m3_per_pa_s * (mid - p_b)
        low, high = (mid, high) if inward > p.bore_m2 * w else (low, mid)
    return 0.5 * (low + high), p_b


@njit(cache=True)
def _steady(p: Any, x: float, p_s: float) -> tuple[float, float, float]:
    """Both pressures and the piston's speed in the steady state of a spool position."""
    low, high = -1.0, 1.0
    p_a, p_b = 0.0, 0.0
    for _ in range(HALVINGS):
        w = 0.5 * (low + high)
        p_a, p_b = _chambers(p, x, w, p_s)
        force = p_a * p.bore_m2 - p_b * p.ring_m2 - p.weight_n - p.seal_ns_per_m * w
        if force - math.copysign(_grip(p, w), w) > 0.0:
            low = w
        else:
            high = w
    return p_a, p_b, 0.5 * (low + high)


@njit(cache=True)
def _spool(p: Any, s: Array, current: float, thrust_n: float, dt: float) -> None:
    """The coil's saturating force, then the spool against spring, flow force and bristle friction."""
    s[0] += (current - s[0]) * dt / (p.coil_lag_s + dt)
    push = p.coil_n_per_a * s[0] / math.sqrt(1.0 + (s[0] / p.coil_knee_a) ** 2)
    grip = p.spool_coulomb_n * (1.0 + (p.spool_breakaway - 1.0) * math.exp(-abs(s[2]) / 0.004))
    s[3] = (s[3] + dt * s[2]) / (1.0 + dt * abs(s[2]) * p.spool_bristle_n_per_m / grip)
    force = push - thrust_n - p.spring_n_per_m * s[1] - p.spring_offset_n - p.spool_bristle_n_per_m * s[3]
    s[2] = (p.spool_kg * s[2] + dt * force) / (p.spool_kg + dt * p.spool_ns_per_m)
    s[1] += dt * s[2]
    if abs(s[1]) > p.spool_stroke_m:
        s[1], s[2] = math.copysign(p.spool_stroke_m, s[1]), 0.0
    s[4] = min(max(s[4], s[1] - p.spool_play_m), s[1] + p.spool_play_m)


@njit(cache=True)
def _pressures(p: Any, s: Array, dt: float) -> float:
    """Chambers and supply line over one step; the flow force on the spool."""
    p_a, p_b, p_s, y, w = s[5], s[6], s[7], s[8], s[9]
    q_a, q_b, drawn, thrust = _flows(p, s[4], p_a, p_b, p_s)
    leak = p.piston_leak_m3_per_pa_s * (p_a - p_b)
    over = p_s - p.relief_pa
    spill = p.relief_m3_per_pa_s * 0.5 * (over + math.sqrt(over * over + 2.0e5**2))
    s[5] = max(p_a + dt * p.modulus_pa * (q_a - leak - p.bore_m2 * w) / (p.dead_m3 + p.bore_m2 * max(y, 0.0)), 0.0)
    s[6] = max(
        p_b + dt * p.modulus_pa * (q_b + leak + p.ring_m2 * w) / (p.dead_m3 + p.ring_m2 * max(p.stroke_m - y, 0.0)), 0.0
    )
    s[7] = max(
        p_s + dt * p.modulus_pa / p.line_m3 * (p.pump_m3_per_s - p.pump_leak_m3_per_pa_s * p_s - drawn - spill), 0.0
    )
    return thrust


@njit(cache=True)
def _masses(p: Any, s: Array, dt: float, moving: bool) -> None:
    """Piston with its seal, and the load on its mounting; while settling the piston keeps its place."""
    y, w = s[8], s[9]
    rate = p.seal_bristle_n_per_m * abs(w) / _grip(p, w)
    before = s[12]
    s[12] = (before + dt * w) / (1.0 + dt * rate)
    bend = p.seal_bristle_ns_per_m * math.exp(-((w / 0.006) ** 2)) * (s[12] - before) / dt
    mount = p.mounting_n_per_m * s[10] + p.mounting_ns_per_m * (w - s[11])
    force = (
        s[5] * p.bore_m2
        - s[6] * p.ring_m2
        - p.weight_n
        - p.seal_bristle_n_per_m * s[12]
        - bend
        - p.seal_ns_per_m * w
        - mount
    )
    if y < 0.0:
        force -= STOP_N_PER_M * y + STOP_NS_PER_M * min(w, 0.0)
    if y > p.stroke_m:
        force -= STOP_N_PER_M * (y - p.stroke_m) + STOP_NS_PER_M * max(w, 0.0)
    s[9] = w + dt * force / p.piston_kg
    s[11] += dt * mount / p.load_kg
    s[10] += dt * (s[9] - s[11])
    if moving:
        s[8] = y + dt * s[9]
    s[13] += (s[8] - s[13]) * dt / (p.sensor_lag_s + dt)


@njit(cache=True)
def _run(p: Any, command: Array, step_s: float, substeps: int) -> Array:
    out = np.empty((3, command.size))
    dt = step_s / substeps
    #  coil current, spool, speed, bristle, edge, p A, p B, p line, piston, speed, mounting, load speed, seal, sensor
    s = np.zeros(14)
    s[0], s[7], s[8], s[13] = command[0], p.relief_pa, 0.5 * p.stroke_m, 0.5 * p.stroke_m
    thrust = 0.0
    settling = int(SETTLE_S / dt)
    for k in range(settling):
        if k % (settling // ROUNDS) == 0:
            s[5], s[6], s[9] = _steady(p, s[4], s[7])
            s[11] = s[9]
        _spool(p, s, command[0], thrust, dt)
        thrust = _pressures(p, s, dt)
        _masses(p, s, dt, False)
    s[13] = s[8] - s[9] * p.sensor_lag_s
    for k in range(command.size):
        out[0, k], out[1, k], out[2, k] = 1.0e3 * (s[13] - 0.5 * p.stroke_m), 1.0e-5 * s[5], 1.0e-5 * s[6]
        for _ in range(substeps):
            _spool(p, s, command[k], thrust, dt)
            thrust = _pressures(p, s, dt)
            _masses(p, s, dt, True)
    return out


respond = answering(_run, _Parameters, CHANNELS, STEP_S, SUBSTEPS)
"""Position and both pressures, without noise, at the samples of a current in A, from the middle of the stroke."""


def _soft_relief(unit: Unit, amount: float) -> Unit:
    """A tired relief valve: it opens earlier and less steeply, the pressure without flow stays."""
    over = (unit.pump_m3_per_s - unit.pump_leak_m3_per_pa_s * unit.relief_pa) / unit.relief_m3_per_pa_s
    return replace(
        unit,
        relief_pa=unit.relief_pa - 6.0 * amount * over,
        relief_m3_per_pa_s=unit.relief_m3_per_pa_s / (1.0 + 6.0 * amount),
    )


CHANGES = {
    "friction_rise": more(spool_coulomb_n=3.0),
    "breakaway_rise": more(spool_breakaway=9.0),
    "play": more(spool_play_m=0.2e-3),
    "slower_pilot": scaled(coil_lag_s=0.6, spool_ns_per_m=0.6),
    "damping_change": scaled(spool_ns_per_m=6.0),
    "edge_worn": more(edge_radius_m=0.5e-3),
    "leakage": more(piston_leak_m3_per_pa_s=6.0e-12),
    "supply_sag": _soft_relief,
    "zero_shift": more(spring_offset_n=4.0),
    "gain_loss": scaled(coil_n_per_a=-0.25),
    "orifice_clogged": fading(return_m2=0.12),
    "stroke_stop": scaled(spool_stroke_m=-0.45),
    "asymmetry": more(seal_outward=12.0),
    "sensor_lag": more(sensor_lag_s=0.05),
}
