"""hpv41_spring_pilot: no loop; pressure-reducing pilots push a spool against captive springs, a motor is its load.

Brevini HPV 41 after Tørdal, Klausen and Bak, taken as a valve **without a spool sensor**: a magnet at each end holds a
small reducing spool open until the pressure on its face balances it, and the oil reaches the main spool past a damping
orifice. Textbook physics (Merritt; Jelali and Kroll; friction as a spring that slips). **What differs** from a curve
behind a lag and a spool of second order: the place is where pressure meets spring, so friction and springs are in the
gain; twelve coupled states before the flow; springs with unequal preload and notches of unequal shape; a fixed pump
whose surplus a **three-way compensator** lets go, by a sensed pressure that comes late; a **motor with inertia**, a
shunt past it, both ports with a volume and a check that keeps them from running dry. The dead band is about ±27 % and
the full flow 70 l/min; the rest is assumed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from tests.studies.skeletons import Array, answering, drawing, more, orifice_root, parameters_of, past_edge, scaled

PLANT = "brevini-hpv41"
CHANNELS = {"command": "%", "flow": "l/min"}
STEP_S = 0.004
NOISE = {"flow": 0.25}
SUBSTEPS = 200  # 50 kHz
SETTLE_S = 0.5
SOFT_BAR = 2.0  # below this drop an orifice turns laminar
CAPTIVE_MM = 0.05  # over which a captive spring takes hold
L_MIN = 0.06  # of a cm³/s


@dataclass(frozen=True)
class Unit:
    """One valve with its magnets, pilots, spool, springs, notches, compensator, pump, motor and meter."""

    magnet_n: float = 0.4  # per % of command
    magnet_lag_s: float = 0.007
    magnet_play_n: float = 0.06
    face_cm2: float = 0.2  # of a pilot
    pilot_spring_n: float = 3.0  # per mm
    pilot_n_s: float = 0.05  # per mm
    pilot_edge: float = 40.0  # cm³/s per √bar and mm
    pilot_lap_mm: float = 0.02
    pilot_round_mm: float = 0.015
    pilot_bar: float = 30.0
    drain_b_bar: float = 0.05  # at one pilot's outlet and back
    pilot_cm3_per_bar: float = 0.002
    damping: float = 22.0  # orifice at each end, cm³/s per √bar
    end_cm3_per_bar: float = 0.003
    end_cm2: float = 4.9
    spool_n_s2: float = 3.5e-4  # per mm
    spool_n_s: float = 0.06  # per mm
    spring_n: float = 117.0  # per mm
    preload_a_n: float = 147.0
    preload_b_n: float = 162.0
    flow_force_n: float = 0.003  # per cm³/s and √bar
    coulomb_n: float = 5.0
    slip_n: float = 600.0  # per mm
    stop_mm: float = 7.4
    lap_a_mm: float = 0.8
    lap_b_mm: float = 0.57
    round_mm: float = 0.04
    notch_a: float = 58.2  # cm³/s per √bar at 1 mm
    notch_b: float = 40.7
    power_a: float = 1.12
    power_b: float = 1.3
    back: float = 1.3  # area of the way back over that of the way there
    leak: float = 0.02  # cm³/s per √bar, from the supply to A and from B back
    pump_cm3: float = 1667.0
    relief_bar: float = 100.0
    margin_bar: float = 9.0
    compensator: float = 100.0  # cm³/s per √bar and bar
    compensator_s: float = 0.002
    sense_s: float = 0.004
    supply_cm3_per_bar: float = 0.05
    port_cm3_per_bar: float = 0.015
    tank_bar: float = 2.0
    refill: float = 120.0  # checks against running dry, cm³/s per √bar
    refill_leak: float = 0.05  # that of A, the wrong way
    shunt: float = 14.0
    motor_bar_s2: float = 3.0e-4  # per cm³
    motor_bar_s: float = 0.02  # per cm³
    motor_drag_bar: float = 8.0
    meter_s: float = 0.008


_Parameters = parameters_of(Unit)
SPREAD = {
    "magnet_n": 0.015, "face_cm2": 0.005, "end_cm2": 0.005, "preload_a_n": 0.03, "preload_b_n": 0.03, "spring_n": 0.02,
    "notch_a": 0.03, "notch_b": 0.03, "power_a": 0.02, "power_b": 0.02, "coulomb_n": 0.25, "magnet_play_n": 0.25,
    "drain_b_bar": 0.5,
}  # fmt: skip


draw = drawing(Unit(), SPREAD, 0.05)


_root = orifice_root(SOFT_BAR)


@njit(cache=True)
def _pilot(p: Any, s: Array, push: float, drain: float, swept: float, dt: float) -> None:
    """Magnet, reducing spool, its pressure and that of the spool's end over one step."""
    s[0] += (p.magnet_n * push - s[0]) * dt / p.magnet_lag_s
    s[1] = max(s[0] - p.magnet_play_n, min(s[0] + p.magnet_play_n, s[1]))
    net = s[1] - 10.0 * p.face_cm2 * (s[3] - drain) - p.pilot_spring_n * s[2]
    s[2] = min(max(s[2] + dt * net / p.pilot_n_s, -0.6), 0.6)
    fed = p.pilot_edge * past_edge(s[2] - p.pilot_lap_mm, p.pilot_round_mm) * _root(p.pilot_bar - s[3])
    let = p.pilot_edge * past_edge(-s[2] - p.pilot_lap_mm, p.pilot_round_mm) * _root(s[3] - drain)
    through = p.damping * _root(s[3] - s[4])
    s[3] += dt * (fed - let - through) / p.pilot_cm3_per_bar
    s[4] += dt * (through - swept) / p.end_cm3_per_bar


@njit(cache=True)
def _spool(p: Any, s: Array, push: float, dt: float) -> None:
    """Main spool between its ends, captive springs and friction over one step."""
    x = s[10]
    spring = p.spring_n * x + (p.preload_a_n if x > 0.0 else p.preload_b_n) * max(-1.0, min(x / CAPTIVE_MM, 1.0))
    reach = p.coulomb_n / p.slip_n
    s[12] = max(-reach, min(s[12] + dt * s[11], reach))
    net = 10.0 * p.end_cm2 * (s[4] - s[9]) - spring - push - p.slip_n * s[12]
    s[11] = (s[11] + dt * net / p.spool_n_s2) / (1.0 + dt * p.spool_n_s / p.spool_n_s2)
    s[10] += dt * s[11]
    if abs(s[10]) > p.stop_mm:
        s[10], s[11] = math.copysign(p.stop_mm, s[10]), 0.0


@njit(cache=True)
def _step(p: Any, s: Array, command: float, dt: float) -> None:
    """Pilots, spool, compensator, ports, motor and meter over one step."""
    swept = 0.1 * p.end_cm2 * s[11]
    _pilot(p, s[0:5], max(command, 0.0), 0.0, swept, dt)
    _pilot(p, s[5:10], max(-command, 0.0), p.drain_b_bar, -swept, dt)
    notch_a = p.notch_a * past_edge(s[10] - p.lap_a_mm, p.round_mm) ** p.power_a
    notch_b = p.notch_b * past_edge(-s[10] - p.lap_b_mm, p.round_mm) ** p.power_b
    to_a, to_b = (notch_a + p.leak) * _root(s[13] - s[16]), notch_b * _root(s[13] - s[17])
    from_a = p.back * notch_b * _root(s[16] - p.tank_bar)
    from_b = (p.back * notch_a + p.leak) * _root(s[17] - p.tank_bar)
    push = to_a * math.sqrt(max(s[13] - s[16], 0.0)) - to_b * math.sqrt(max(s[13] - s[17], 0.0))
    _spool(p, s, p.flow_force_n * push, dt)
    wanted = p.compensator * max(s[13] - s[15] - p.margin_bar, 0.0)
    s[14] += (min(wanted, 800.0) - s[14]) * dt / p.compensator_s
    s[15] += (max(s[16], s[17]) - s[15]) * dt / p.sense_s
    let = s[14] * _root(s[13]) + p.pump_cm3 * max(s[13] - p.relief_bar, 0.0) / 10.0
    s[13] = max(s[13] + dt * (p.pump_cm3 - to_a - to_b - let) / p.supply_cm3_per_bar, 0.0)
    past = p.shunt * _root(s[16] - s[17])
    refill_a = p.refill * _root(max(p.tank_bar - s[16], 0.0)) - p.refill_leak * _root(max(s[16] - p.tank_bar, 0.0))
    refill_b = p.refill * _root(max(p.tank_bar - s[17], 0.0))
    drag = p.motor_drag_bar * math.tanh(s[18] / 10.0)
    flow = (s[18] + dt * (s[16] - s[17] - drag) / p.motor_bar_s2) / (1.0 + dt * p.motor_bar_s / p.motor_bar_s2)
    s[18] = flow
    s[16] = max(s[16] + dt * (to_a - from_a - flow - past + refill_a) / p.port_cm3_per_bar, 0.0)
    s[17] = max(s[17] + dt * (to_b - from_b + flow + past + refill_b) / p.port_cm3_per_bar, 0.0)
    s[19] += (L_MIN * flow - s[19]) * dt / p.meter_s


@njit(cache=True)
def _run(p: Any, command: Array, step_s: float, substeps: int) -> Array:
    out = np.empty(command.size)
    dt = step_s / substeps
    # two pilots (magnet, its play, place, pressure, end), spool, its speed, friction, supply, compensator, sensed,
    # port A, port B, motor, meter
    s = np.zeros(20)
    s[13], s[15:18] = p.margin_bar, p.tank_bar
    for _ in range(int(SETTLE_S / dt)):
        _step(p, s, 0.0, dt)
    for k in range(command.size):
        out[k] = s[19]
        for _ in range(substeps):
            _step(p, s, command[k], dt)
    return out


respond = answering(_run, _Parameters, CHANNELS, STEP_S, SUBSTEPS)
"""Flow to the motor, without noise, at the samples of a command in %."""


CHANGES = {
    "friction_rise": more(coulomb_n=80.0),
    "magnetic_hysteresis": more(magnet_play_n=3.0),
    "slower_pilot": more(magnet_lag_s=0.15),
    "damping_change": scaled(damping=-0.94),  # a smaller orifice at both ends
    "edge_worn": more(round_mm=1.6),
    "leakage": more(leak=20.0),
    "supply_sag": scaled(pump_cm3=-0.75),
    "zero_shift": more(drain_b_bar=2.5),
    "gain_loss": scaled(magnet_n=-0.15),
    "spring_weak": scaled(spring_n=-0.25),
    "asymmetry": scaled(notch_b=-0.4),
    "refill_ajar": more(refill_leak=60.0),
    "margin_low": scaled(margin_bar=-0.5),
    "stroke_stop": more(stop_mm=-3.5),
    "load_heavier": scaled(motor_bar_s2=15.0),
    "sensor_lag": more(meter_s=0.12),
}
