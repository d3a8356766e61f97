"""Laws of play, of the metering edge and of the pressure that supplies it."""

from __future__ import annotations

import numpy as np
from numba import njit

from ..chance import chance
from ..law import EFC, HPV41, SP08, Shared, Times, acts
from ..memory import KEY
from ..slots import FLOW, LINK, METER, SUPPLY


@acts(
    LINK,
    "backlash",
    strength="gap",
    others={"contact_rate_1_s": (5000.0, 8000.0)},
    largest={HPV41: 15.0, EFC: 0.15, SP08: 25.0},
)
def backlash_contact(x, a, b, r):
    """Free play as contact: a massless, damped part between two stiff faces that are a gap apart.

    Inside the gap it stays; a face that touches it takes it along and presses it out again, but never pulls.
    """
    half_gap, contact_rate = 0.5 * r.p[0], r.p[1]
    if half_gap <= 0.0:
        return x
    if r.m[0] == 0.0 and r.first == 1:
        r.m[0], r.m[1] = 1.0, x  # assembled in the middle of its play
    apart = x - (r.m[1] + r.z[0])
    r.dz[0] = 0.0
    if apart >= half_gap:
        r.dz[0] = max(0.0, a + contact_rate * (apart - half_gap))
    elif apart <= -half_gap:
        r.dz[0] = min(0.0, a + contact_rate * (apart + half_gap))
    return r.m[1] + r.z[0]


@njit(inline="always")
def _soft(u, edge):
    if u > 30.0 * edge:
        return u
    return edge * np.log1p(np.exp(u / edge)) if u > -30.0 * edge else 0.0


@acts(
    METER,
    "deadband",
    strength="overlap",
    others={"uneven": (-0.12, 0.12), "rounding": (0.04, 0.12)},
    largest={HPV41: 15.0, SP08: 15.0},
    counterparts=("overlap",),
    shared=(Shared("half width, mean of both sides", "%", lambda p: p[0]),),
)
def deadband_soft(x, a, b, r):
    """Overlap with rounded edges, a little wider on one side: y = soft(x − d₊) − soft(−x − d₋)."""
    overlap, uneven, rounding = r.p[0], r.p[1], r.p[2]
    if overlap <= 0.0:
        return x
    edge = rounding * overlap
    return _soft(x - overlap * (1.0 + uneven), edge) - _soft(-x - overlap * (1.0 - uneven), edge)


@acts(FLOW, "asymmetry", strength="loss_on_negative_side", others={"transition": (2.0, 6.0)}, largest={HPV41: 0.6})
def asymmetry_ports(x, a, b, r):
    """One port of the valve lets through less than the other; the change-over is smooth."""
    return x * (1.0 - r.p[0] * 0.5 * (1.0 - np.tanh(a / r.p[1])))


@acts(
    FLOW,
    "leakage",
    strength="strength_psi",
    others={"edge_a": (1.3, 1.5), "length_a": (1.0, 3.0), "supply_psi": (215.0, 230.0)},
    largest={EFC: 30.0},
)
def leakage_clearance(x, a, b, r):
    """Leakage through the closed clearance, driven by what pressure difference is left, less with more overlap."""
    strength, edge, length, supply = r.p[0], r.p[1], r.p[2], r.p[3]
    return x + strength * (1.0 - x / supply) * length / (length + max(edge - a, 0.0))


@acts(
    FLOW,
    "leakage",
    strength="strength",
    others={"overlap": {HPV41: 20.0, SP08: 2.0}, "entrance": (15.0, 40.0), "wear_of_other_land": (0.0, 0.3)},
    largest={HPV41: 8.0, SP08: 30.0},
)
def leakage_lands(x, a, b, r):
    """Laminar leakage past two spool lands, inversely to the length of overlap that is left; one land more worn.

    f(l) = e/(e + max(l, 0)), net flow s·(f(d − x) − ρ·f(d + x))
    """
    strength, overlap, entrance, wear = r.p[0], r.p[1], r.p[2], r.p[3]
    near = entrance / (entrance + max(overlap - a, 0.0))
    far = entrance / (entrance + max(overlap + a, 0.0))
    return x + strength * (near - wear * far)


@acts(
    FLOW,
    "load_force",
    strength="share_of_supply",
    others={"middle_mm": (110.0, 140.0), "reach_mm": (60.0, 80.0)},
    largest={SP08: 0.8},
)
def load_force_spring(x, a, b, r):
    """A load that grows along the stroke takes pressure from extending and gives it to retracting.

    speed·√(1 − sgn(opening)·p), p = s·(½ + ½·(y − y0)/reach)
    """
    load = r.p[0] * (0.5 + 0.5 * (b - r.p[1]) / r.p[2])
    return x * np.sqrt(max(0.05, 1.0 - load if a > 0.0 else 1.0 + load))


@acts(
    SUPPLY,
    "supply_droop",
    strength="droop_at_full_flow",
    others={"time_s": (0.15, 1.0), "polytropic_exponent": (1.1, 1.4)},
    largest={HPV41: 0.7, EFC: 0.5, SP08: 0.7},
)
def supply_droop_accumulator(x, a, b, r):
    """Pump with a pressure regulator, gas-charged accumulator and a line loss.

    Gas: p = (1 + w·v)^−κ with the oil v that is missing; v̇ = demand − (1 − p)/droop; line: −¼·droop·demand².
    """
    droop, time_s, gas = 0.8 * r.p[0], r.p[1], r.p[2]
    if droop < 1e-9:
        return x
    stiffness = droop / (gas * time_s)
    missing = r.z[0]
    pressure = (1.0 + stiffness * missing) ** -gas
    r.dz[0] = a - (1.0 - pressure) / droop
    return x * max(0.05, pressure - 0.25 * droop * a * a)


@acts(
    FLOW,
    "gain_bump",
    listed=False,
    strength="strength",
    others={
        "place": {HPV41: (35.0, 65.0), EFC: (1.52, 1.64), SP08: (10.0, 35.0)},
        "width": Times({HPV41: 5.0, EFC: 0.02, SP08: 5.0}, 0.8, 1.5),
    },
    largest={HPV41: 1.0, EFC: 1.0, SP08: 2.0},
)
def odd_gain_bump(x, a, b, r):
    """A burr at one opening; gain is higher there and nowhere else."""
    return x * (1.0 + r.p[0] * np.exp(-(((a - r.p[1]) / r.p[2]) ** 2)))


@acts(
    SUPPLY,
    "second_consumer",
    listed=False,
    strength="pressure_taken",
    others={"dwell_s": (0.7, 3.0), "time_s": (0.03, 0.15)},
    largest={HPV41: 0.7, EFC: 0.5, SP08: 0.9},
    predictable=False,
)
def odd_second_consumer(x, a, b, r):
    """Another consumer on the same supply switches on and off at chance times."""
    depth, dwell_s, time_s = r.p[0], r.p[1], r.p[2]
    taking = 0.0
    if r.t >= 0.0:
        taking = 1.0 if chance(r.p[KEY] + 101.0, np.floor(r.t / dwell_s)) > 0.5 else 0.0
    r.dz[0] = (taking - r.z[0]) / time_s
    return x * (1.0 - depth * r.z[0])
