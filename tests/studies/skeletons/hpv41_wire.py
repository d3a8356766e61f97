"""hpv41_wire: a torque motor's flapper between two nozzles, a wire from the spool bends it back; a turbine measures.

Brevini HPV 41 after Tørdal, Klausen and Bak, taken as a **two-stage servo valve**: no electronics close the loop, the
spool pulls a wire until the motor's torque is balanced. Textbook physics (Merritt, chapter 7; Jelali and Kroll;
friction as a spring that slips). **What differs** from a curve behind a lag and a spool of second order: the loop is
mechanical, with a ball that has play in its slot and a magnet whose pull grows with the gap that it closes; both ends
of the spool have a pressure, and jets press on the flapper; no compensator, so the flow is what four unequal edges, a
throttle and an **accumulator that empties** leave; ports with volume; a **turbine whose lag is the longer the less
flows** and which bearings hold back. The dead band is about ±27 % and the full flow 70 l/min; the rest is assumed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from tests.studies.skeletons import (
    Array,
    answering,
    divided,
    drawing,
    fading,
    more,
    orifice_root,
    parameters_of,
    past_edge,
    scaled,
)

PLANT = "brevini-hpv41"
CHANNELS = {"command": "%", "flow": "l/min"}
STEP_S = 0.005
NOISE = {"flow": 0.25}
SUBSTEPS = 250  # 50 kHz
SETTLE_S = 0.5
SOFT_BAR = 1.0  # below this drop an orifice turns laminar
L_MIN = 0.06  # of a cm³/s
BENT_L_MIN = 0.8  # over which the drag of the turbine's bearings turns round


@dataclass(frozen=True)
class Unit:
    """One valve with its motor, flapper, nozzles, wire, spool, edges, accumulator, throttle and turbine."""

    torque_nmm: float = 0.8  # per % of command
    flux_percent: float = 260.0  # where half the flux would be lost
    coil_s: float = 0.004
    play_percent: float = 0.35  # of the magnet
    null_nmm: float = 0.4
    tube_nmm: float = 1600.0  # per rad, of the tube less the magnet's pull at rest
    pull_nmm: float = 2.0e7  # per rad³, by which the magnet's pull grows
    armature_nmm_s2: float = 1.5e-4
    armature_nmm_s: float = 0.25
    flapper_mm: float = 9.0
    wire_mm: float = 22.0
    wire_n: float = 1.2  # per mm
    ball_mm: float = 0.003  # half its play
    gap_mm: float = 0.085
    nozzle: float = 12.4  # cm³/s per √bar and mm
    nozzle_mm2: float = 0.13
    fixed_a: float = 1.0  # orifice, cm³/s per √bar
    fixed_b: float = 1.03
    filter: float = 5.0
    drain: float = 4.0
    pilot_bar: float = 65.0
    pilot_cm3_per_bar: float = 0.01
    end_cm3_per_bar: float = 0.0004
    end_cm2: float = 0.8
    spool_n_s2: float = 1.2e-4  # per mm
    spool_n_s: float = 0.02  # per mm
    coulomb_n: float = 2.5
    slip_n: float = 250.0  # per mm
    stop_mm: float = 3.1
    flow_force_n: float = 0.004  # per cm³/s and √bar
    lap_a_mm: float = 0.83
    lap_b_mm: float = 0.77
    round_mm: float = 0.03
    notch_a: float = 84.0  # cm³/s per √bar at 1 mm
    notch_b: float = 90.0
    power_a: float = 1.25
    power_b: float = 1.12
    back: float = 1.2  # area of the way back over that of the way there
    leak: float = 0.03  # cm³/s per √bar, from the supply to A and from B back
    pump_bar: float = 100.0
    pump_cm3: float = 1667.0
    pump_cm3_per_bar: float = 140.0  # below its pressure
    pump_s: float = 0.05
    gas_bar: float = 60.0
    gas_cm3: float = 900.0
    tank_bar: float = 1.5
    throttle: float = 240.0
    port_cm3_per_bar: float = 0.02
    turbine_s: float = 0.006  # at full flow
    turbine_l_min: float = 3.0  # what keeps it turning at none
    bearing_l_min_s: float = 4.0


_Parameters = parameters_of(Unit)
SPREAD = {
    "torque_nmm": 0.015, "wire_n": 0.015, "end_cm2": 0.005, "notch_a": 0.03, "notch_b": 0.03, "power_a": 0.02,
    "power_b": 0.02, "null_nmm": 0.6, "coulomb_n": 0.25, "play_percent": 0.25, "gap_mm": 0.03, "fixed_a": 0.02,
    "fixed_b": 0.02, "pump_bar": 0.02, "lap_a_mm": 0.03, "lap_b_mm": 0.03,
}  # fmt: skip


draw = drawing(Unit(), SPREAD, 0.05)


_root = orifice_root(SOFT_BAR)


@njit(cache=True)
def _motor(p: Any, s: Array, command: float, wire: float, dt: float) -> None:
    """Coil with lag and hysteresis, flux that saturates, armature on its tube, wire and jets over one step."""
    s[0] += (command - s[0]) * dt / p.coil_s
    s[1] = max(s[0] - p.play_percent, min(s[0] + p.play_percent, s[1]))
    driven = p.torque_nmm * s[1] / math.sqrt(1.0 + (s[1] / p.flux_percent) ** 2) + p.null_nmm
    held = p.tube_nmm * s[2] - p.pull_nmm * s[2] ** 3
    jets = 0.1 * p.nozzle_mm2 * (s[4] - s[5]) * p.flapper_mm
    net = driven - held - jets - wire * p.wire_mm
    s[3] = (s[3] + dt * net / p.armature_nmm_s2) / (1.0 + dt * p.armature_nmm_s / p.armature_nmm_s2)
    s[2] += dt * s[3]
    reach = p.gap_mm / p.flapper_mm
    if abs(s[2]) > reach:  # the flapper lies on a nozzle
        s[2], s[3] = math.copysign(reach, s[2]), 0.0


@njit(cache=True)
def _bridge(p: Any, s: Array, dt: float) -> None:
    """Pilot behind its filter, two fixed orifices, two nozzles and a common drain over one step."""
    gap_a, gap_b = p.gap_mm - p.flapper_mm * s[2], p.gap_mm + p.flapper_mm * s[2]
    # the flapper's way to the right closes the nozzle of the end that pushes the spool to the right
    past = (p.nozzle * gap_a) ** 2 * max(s[4], 0.0) + (p.nozzle * gap_b) ** 2 * max(s[5], 0.0)
    back = past / (p.drain**2 + (p.nozzle * p.gap_mm) ** 2)
    into_a, into_b = p.fixed_a * _root(s[6] - s[4]), p.fixed_b * _root(s[6] - s[5])
    swept = 0.1 * p.end_cm2 * s[8]
    s[4] = max(s[4] + dt * (into_a - p.nozzle * gap_a * _root(s[4] - back) - swept) / p.end_cm3_per_bar, 0.0)
    s[5] = max(s[5] + dt * (into_b - p.nozzle * gap_b * _root(s[5] - back) + swept) / p.end_cm3_per_bar, 0.0)
    s[6] += dt * (p.filter * _root(p.pilot_bar - s[6]) - into_a - into_b) / p.pilot_cm3_per_bar


@njit(cache=True)
def _spool(p: Any, s: Array, wire: float, push: float, dt: float) -> None:
    """Spool between its ends, wire, flow force and friction over one step."""
    reach = p.coulomb_n / p.slip_n
    s[9] = max(-reach, min(s[9] + dt * s[8], reach))
    net = 10.0 * p.end_cm2 * (s[4] - s[5]) - wire - push - p.slip_n * s[9]
    s[8] = (s[8] + dt * net / p.spool_n_s2) / (1.0 + dt * p.spool_n_s / p.spool_n_s2)
    s[7] += dt * s[8]
    if abs(s[7]) > p.stop_mm:
        s[7], s[8] = math.copysign(p.stop_mm, s[7]), 0.0


@njit(cache=True)
def _step(p: Any, s: Array, command: float, dt: float) -> None:
    """Motor, bridge, spool, supply, ports and turbine over one step."""
    bent = s[7] + p.wire_mm * s[2]
    wire = p.wire_n * (bent - max(-p.ball_mm, min(bent, p.ball_mm)))
    notch_a = p.notch_a * past_edge(s[7] - p.lap_a_mm, p.round_mm) ** p.power_a
    notch_b = p.notch_b * past_edge(-s[7] - p.lap_b_mm, p.round_mm) ** p.power_b
    supply = p.gas_bar * (p.gas_cm3 / s[10]) ** 1.3  # of what gas the oil has left room for
    to_a, to_b = (notch_a + p.leak) * _root(supply - s[12]), notch_b * _root(supply - s[13])
    from_a = p.back * notch_b * _root(s[12] - p.tank_bar)
    from_b = (p.back * notch_a + p.leak) * _root(s[13] - p.tank_bar)
    push = to_a * math.sqrt(max(supply - s[12], 0.0)) - to_b * math.sqrt(max(supply - s[13], 0.0))
    _motor(p, s, command, wire, dt)
    _bridge(p, s, dt)
    _spool(p, s, wire, p.flow_force_n * push, dt)
    wanted = min(max(p.pump_cm3_per_bar * (p.pump_bar - supply), 0.0), p.pump_cm3)
    s[11] += (wanted - s[11]) * dt / p.pump_s
    s[10] = min(s[10] + dt * (to_a + to_b - s[11]), p.gas_cm3)
    flow = p.throttle * _root(s[12] - s[13])
    s[12] = max(s[12] + dt * (to_a - from_a - flow) / p.port_cm3_per_bar, 0.0)
    s[13] = max(s[13] + dt * (to_b - from_b + flow) / p.port_cm3_per_bar, 0.0)
    passes = L_MIN * flow
    driven = (passes - s[14]) * (abs(passes) + p.turbine_l_min) / (70.0 * p.turbine_s)
    s[14] += dt * (driven - p.bearing_l_min_s * math.tanh(s[14] / BENT_L_MIN))


@njit(cache=True)
def _run(p: Any, command: Array, step_s: float, substeps: int) -> Array:
    out = np.empty(command.size)
    dt = step_s / substeps
    # coil, its play, flapper, its rate, both ends, pilot, spool, its speed, friction, gas, pump, ports, turbine
    s = np.zeros(15)
    s[4], s[5], s[6] = 0.5 * p.pilot_bar, 0.5 * p.pilot_bar, p.pilot_bar
    s[10] = p.gas_cm3 * (p.gas_bar / p.pump_bar) ** (1.0 / 1.3)
    s[12:14] = p.tank_bar
    for _ in range(int(SETTLE_S / dt)):
        _step(p, s, 0.0, dt)
    for k in range(command.size):
        out[k] = s[14]
        for _ in range(substeps):
            _step(p, s, command[k], dt)
    return out


respond = answering(_run, _Parameters, CHANNELS, STEP_S, SUBSTEPS)
"""Flow through the throttle as the turbine shows it, without noise, at the samples of a command in %."""


CHANGES = {
    "friction_rise": more(coulomb_n=60.0),
    "magnetic_hysteresis": more(play_percent=12.0),
    "slower_pilot": more(coil_s=0.15),
    "ball_worn": more(ball_mm=0.4),
    "filter_clogged": fading(filter=0.1),
    "orifice_clogged": scaled(throttle=-0.6),
    "one_clogged": scaled(fixed_a=-0.5),
    "edge_worn": more(round_mm=0.7),
    "leakage": more(leak=20.0),
    "supply_sag": scaled(pump_cm3=-0.8),
    "zero_shift": more(null_nmm=12.0),
    "gain_loss": scaled(torque_nmm=-0.2),
    "wire_soft": divided(wire_n=0.3),
    "asymmetry": scaled(notch_b=-0.4),
    "stroke_stop": more(stop_mm=-1.6),
    "sensor_lag": more(turbine_s=0.06),
}
