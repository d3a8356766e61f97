"""hpv41_pulsed: electronics look at the spool every few milliseconds and pulse four seat valves at its ends.

Dead band ±27 %, 70 l/min and the pump of 100 bar and 100 l/min after Tørdal, Klausen, Bak; textbook physics (Merritt:
sharp orifice, flow force; Jelali and Kroll: line with inertia, pressure-controlled pump). **What differs** from a chain
of gain, lag and static curve: a **sampled loop** over the spool's place, whose pulses open seat valves for a share of
each period, but not the shortest; **locked oil** holds a spool of unequal ends against one spring that is captured
both ways; the flow runs **through two metering edges in series**, out by one port, through a hose with inertia and
the meter, back by the other: four edges of unequal width and overlap, a notch before each; a pump whose flow follows
its pressure late; a turbine that follows small flows late. Masses, areas and volumes are assumed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from tests.studies.skeletons import Array, answering, drawing, fading, more, orifice_root, parameters_of, scaled

PLANT = "brevini-hpv41"
CHANNELS = {"command": "%", "flow": "l/min"}
STEP_S = 0.004
NOISE = {"flow": 0.25}
SUBSTEPS = 100  # 25 kHz
SETTLE_S = 2.0
SOFT_BAR = 0.5  # below this drop an orifice turns laminar
DISCHARGE = 9.7  # cm³/s per mm² and √bar: 0.64·√(2/ρ) at 870 kg/m³
JET_N = 0.042  # per mm² and bar: 2·0.64·0.92·cos 69° of Merritt, in those units
LPM = 0.06  # l/min per cm³/s


@dataclass(frozen=True)
class Unit:
    """One valve with its electronics, seat valves, spool, edges, pump, hose and meter."""

    stroke_mm: float = 5.5  # asked for at 100 %
    lvdt_gain: float = 1.0
    lvdt_zero_mm: float = 0.0
    period_s: float = 0.008
    share_per_mm: float = 0.9  # of a period, per mm that is missing
    dead_share: float = 0.012  # pulses below it lift no seat
    seat_mm2: float = 0.19
    seat_lag_s: float = 0.003
    pilot_bar: float = 21.0
    end_a_mm2: float = 254.0
    end_b_mm2: float = 230.0
    end_cm3_per_bar: float = 0.003
    end_leak: float = 0.002  # cm³/s per bar, each
    spool_kg: float = 0.28
    viscous_ns_per_mm: float = 0.25
    spring_n_per_mm: float = 13.0
    preload_n: float = 55.0
    seat_mm: float = 0.04  # way over which the captured spring takes up its preload
    coulomb_n: float = 4.0
    breakaway: float = 1.4  # static over Coulomb
    stribeck_mm_per_s: float = 2.0
    presliding_mm_per_s: float = 0.05  # speed at which friction is all there
    stop_mm: float = 5.9
    overlap_pa_mm: float = 1.46
    overlap_bt_mm: float = 1.40
    overlap_pb_mm: float = 1.50
    overlap_at_mm: float = 1.38
    width_pa_mm: float = 6.6
    width_bt_mm: float = 7.4
    width_pb_mm: float = 6.2
    width_at_mm: float = 7.0
    notch_mm: float = 1.3  # within which an edge opens by its notch
    round_mm: float = 0.05
    score_mm2: float = 0.01  # of the lands that open towards A
    port_leak: float = 0.05  # cm³/s per bar
    port_cm3_per_bar: float = 0.12
    hose_bar_s2_per_cm3: float = 2.4e-4
    hose_bar_s_per_cm3: float = 0.008
    meter_bar_s2_per_cm6: float = 6.0e-6
    pump_bar: float = 100.0
    pump_cm3_s_per_bar: float = 60.0
    pump_most_cm3_s: float = 1667.0
    pump_lag_s: float = 0.02
    supply_cm3_per_bar: float = 3.0
    turbine_cm3: float = 11.0  # it follows within this over the flow
    turbine_least_cm3_s: float = 220.0


_Parameters = parameters_of(Unit)
SPREAD = {
    "stroke_mm": 0.01, "lvdt_gain": 0.01, "stop_mm": 0.01, "period_s": 0.0, "overlap_pa_mm": 0.02,
    "overlap_bt_mm": 0.02, "overlap_pb_mm": 0.02, "overlap_at_mm": 0.02, "coulomb_n": 0.2, "dead_share": 0.2,
    "round_mm": 0.2, "pump_bar": 0.02,
}  # fmt: skip


draw = drawing(Unit(), SPREAD, 0.05)


_root = orifice_root(SOFT_BAR)


@njit(cache=True)
def _area(p: Any, past_mm: float, width_mm: float) -> float:
    """Area of an edge that is uncovered so far: its notch first, then its width; worn round."""
    open_mm = 0.5 * (past_mm + math.sqrt(past_mm * past_mm + p.round_mm * p.round_mm))
    return float(width_mm * open_mm * open_mm / (open_mm + p.notch_mm))


@njit(cache=True)
def _electronics(p: Any, s: Array, command: float, dt: float) -> None:
    """Share of the period for which seats open, from one look at the spool a period; then the seats."""
    s[0] -= dt
    if s[0] <= 0.0:
        s[0] += p.period_s
        share = p.share_per_mm * (0.01 * command * p.stroke_mm - p.lvdt_gain * s[5] - p.lvdt_zero_mm)
        s[1] = math.copysign(min(max(abs(share) - p.dead_share, 0.0), 1.0), share)
    s[2] += (s[1] - s[2]) * dt / p.seat_lag_s


@njit(cache=True)
def _spool(p: Any, s: Array, jet_n: float, dt: float) -> None:
    """Spool between the oil of its ends, then that oil, over one step."""
    x, v = s[5], s[6]
    spring = p.spring_n_per_mm * x + p.preload_n * x / math.sqrt(x * x + p.seat_mm * p.seat_mm)
    net = 0.1 * (p.end_a_mm2 * s[3] - p.end_b_mm2 * s[4]) - spring - jet_n
    level = p.coulomb_n * (1.0 + (p.breakaway - 1.0) * math.exp(-abs(v) / p.stribeck_mm_per_s))
    drag = p.viscous_ns_per_mm + level / math.sqrt(v * v + p.presliding_mm_per_s**2)
    rate = 1000.0 * dt / p.spool_kg
    s[6] = (v + rate * net) / (1.0 + rate * drag)
    s[5] = x + dt * s[6]
    if abs(s[5]) > p.stop_mm:
        s[5], s[6] = math.copysign(p.stop_mm, s[5]), 0.0
    ahead, back = DISCHARGE * p.seat_mm2 * max(s[2], 0.0), DISCHARGE * p.seat_mm2 * max(-s[2], 0.0)
    a = ahead * _root(p.pilot_bar - s[3]) - (back * _root(s[3]) + p.end_leak * s[3]) - 0.001 * p.end_a_mm2 * s[6]
    b = back * _root(p.pilot_bar - s[4]) - (ahead * _root(s[4]) + p.end_leak * s[4]) + 0.001 * p.end_b_mm2 * s[6]
    s[3] = max(s[3] + dt * a / p.end_cm3_per_bar, 0.0)
    s[4] = max(s[4] + dt * b / p.end_cm3_per_bar, 0.0)


@njit(cache=True)
def _step(p: Any, s: Array, command: float, dt: float) -> None:
    """Electronics, spool, ports, hose, pump and meter over one step."""
    _electronics(p, s, command, dt)
    pa = _area(p, s[5] - p.overlap_pa_mm, p.width_pa_mm) + p.score_mm2
    bt = _area(p, s[5] - p.overlap_bt_mm, p.width_bt_mm) + p.score_mm2
    pb = _area(p, -s[5] - p.overlap_pb_mm, p.width_pb_mm)
    at = _area(p, -s[5] - p.overlap_at_mm, p.width_at_mm)
    p_a, p_b, supply = s[7], s[8], s[10]
    _spool(p, s, JET_N * (pa * (supply - p_a) + bt * p_b - pb * (supply - p_b) - at * p_a), dt)
    into_a, into_b = DISCHARGE * pa * _root(supply - p_a), DISCHARGE * pb * _root(supply - p_b)
    s[7] += dt * (into_a - DISCHARGE * at * _root(p_a) - p.port_leak * p_a - s[9]) / p.port_cm3_per_bar
    s[8] += dt * (into_b - DISCHARGE * bt * _root(p_b) - p.port_leak * p_b + s[9]) / p.port_cm3_per_bar
    loss = p.hose_bar_s_per_cm3 + p.meter_bar_s2_per_cm6 * abs(s[9])
    s[9] = (s[9] + dt * (s[7] - s[8]) / p.hose_bar_s2_per_cm3) / (1.0 + dt * loss / p.hose_bar_s2_per_cm3)
    given = min(max(p.pump_cm3_s_per_bar * (p.pump_bar - supply), 0.0), p.pump_most_cm3_s)
    s[11] += (given - s[11]) * dt / p.pump_lag_s
    s[10] += dt * (s[11] - into_a - into_b) / p.supply_cm3_per_bar
    s[12] += (s[9] - s[12]) * dt * (abs(s[9]) + p.turbine_least_cm3_s) / p.turbine_cm3


@njit(cache=True)
def _run(p: Any, command: Array, step_s: float, substeps: int) -> Array:
    out = np.empty(command.size)
    dt = step_s / substeps
    s = np.zeros(13)  # clock, share, seats, both ends, spool, its speed, both ports, hose, supply, pump, turbine
    s[3], s[4], s[10] = 2.0, 2.0, p.pump_bar
    for _ in range(int(SETTLE_S / dt)):
        _step(p, s, command[0], dt)
    for k in range(command.size):
        out[k] = LPM * s[12]
        for _ in range(substeps):
            _step(p, s, command[k], dt)
    return out


respond = answering(_run, _Parameters, CHANNELS, STEP_S, SUBSTEPS)
"""Flow, without noise, at the samples of a command in %."""


CHANGES = {
    "friction_rise": more(coulomb_n=400.0),
    "breakaway_rise": more(breakaway=120.0),
    "slower_pilot": more(seat_lag_s=0.12),
    "orifice_clogged": fading(seat_mm2=0.2),
    "damping_change": more(viscous_ns_per_mm=60.0),
    "loop_weak": fading(share_per_mm=0.25),
    "pulse_dead": more(dead_share=0.3),
    "edge_worn": more(round_mm=1.5),
    "leakage": more(score_mm2=2.0),
    "asymmetry": scaled(width_pb_mm=-0.5, width_at_mm=-0.5),
    "supply_sag": fading(pump_cm3_s_per_bar=0.15, pump_most_cm3_s=0.4),
    "zero_shift": more(lvdt_zero_mm=0.6),
    "gain_loss": more(lvdt_gain=0.3),
    "stroke_stop": more(stop_mm=-3.0),
    "line_longer": scaled(hose_bar_s2_per_cm3=40.0),
    "sensor_lag": scaled(turbine_cm3=8.0),
}
