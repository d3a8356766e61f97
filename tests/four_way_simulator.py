"""A four-way valve of another structure than the plant page: SI units, two chambers of oil, gaps solved for their flow.

At rest by integrating oil that is compressed until it has come to rest, or by a general root finder on the balances.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq, root

from hil.physics.compose import plant
from hil.signals.recursion import filtered

BAR, L_MIN = 1e5, 1e-3 / 60.0
DENSITY = 870.0


def edge_flow(drop_pa, past_m, radius_m, clearance_m, width_m, viscosity_pa_s):
    """The flow at which an orifice and a slot behind each other take the whole pressure drop."""
    way = math.hypot(max(past_m, 0.0), clearance_m)
    length = clearance_m + radius_m + max(-past_m, 0.0)

    def excess(flow):
        return DENSITY / 2.0 * (flow / (0.65 * width_m * way)) ** 2 + 12.0 * viscosity_pa_s * length * flow / (
            width_m * way**3
        ) - abs(drop_pa)  # fmt: skip

    return math.copysign(brentq(excess, 0.0, 1e-2, xtol=1e-14), drop_pa) if drop_pa else 0.0


class Valve:
    """Parameters in SI; those given differ from the plant's values. `open_pa`: share of an edge's width left open."""

    def __init__(self, **changed):
        p = self.p = plant("four-way-valve").typical | changed
        area = p["rated_flow"] * L_MIN / (0.65 * math.sqrt(2.0 * 35.0 * BAR / DENSITY))
        self.width_m = area / (p["stroke"] * 1e-3)

    def spool(self, command, supply=70.0, tank=2.0, oil_c=40.0):
        """In %, from a command in %: supply, tank and oil move the null."""
        p = self.p
        moved = p["null"] + p["null_supply"] * (supply - p["rated_supply"]) / (0.1 * p["rated_supply"])
        moved += p["null_tank"] * tank / (0.1 * p["rated_supply"]) + p["null_temperature"] * (oil_c - 40.0) / 40.0
        return command - moved

    def followed(self, command, interval_s, gain=1.0, play=0.0):
        """The spool's way from its null in %, shape (n,): a third-order lag of held commands, then the play."""
        from scipy.signal import cont2discrete

        p = self.p
        w, pilot = p["motor_frequency"], p["pilot_rate"] * math.sqrt(68.0 / p["rated_supply"])
        parts = [w * w * pilot], np.polymul([1.0, 2.0 * p["motor_damping"] * w, w * w], [1.0, pilot])
        above, below, _ = cont2discrete(parts, interval_s)
        spool = filtered(above[0], below, self.spool(gain * command) - self.spool(0.0)) + self.spool(0.0)
        if not play:
            return spool
        held, reached = 0.0, []
        for one in spool.tolist():
            held = min(max(held, one - play), one + play)
            reached.append(held)
        return np.array(reached)

    def flows(self, pressures, spool, supply=70.0, load=100.0, tank=2.0, oil_c=40.0):
        """(P to A, A to T, P to B, B to T, A to B) in m³/s, given the pressures of both chambers in Pa."""
        p, (a, b) = self.p, pressures
        viscosity = DENSITY * p["viscosity"] * 1e-6 * math.exp(-p["thinning"] * (oil_c - 40.0))
        travel = spool / 100.0 * p["stroke"] * 1e-3

        def edge(name, way, drop):
            past = way * travel - 1e-6 * (p[f"lap_{name}"] - p[f"radius_{name}"])
            width_m = self.width_m * p.get(f"open_{name}", 1.0)
            return edge_flow(drop, past, 1e-6 * p[f"radius_{name}"], 1e-6 * p["clearance"], width_m, viscosity)

        drop_bar = (a - b) / BAR  # a throttle is a root of the drop, and straight below a tenth of a bar
        through_load = load / 100.0 * p["load_flow"] * L_MIN * drop_bar / math.sqrt(35.0 * math.hypot(drop_bar, 0.1))
        return (edge("pa", 1, supply * BAR - a), edge("at", -1, a - tank * BAR),
                edge("pb", -1, supply * BAR - b), edge("bt", 1, b - tank * BAR), through_load)  # fmt: skip

    def seen(self, pressures, spool, **conditions):
        """Pressures and flows in bar and l/min."""
        _, at, _, bt, out = self.flows(pressures, spool, **conditions)
        supply, tank = conditions.get("supply", 70.0), conditions.get("tank", 2.0)
        pilot = self.p["pilot_flow"] * math.sqrt((supply - tank) / self.p["rated_supply"])
        a, b = (pressure / BAR for pressure in pressures)
        return {"flow": out / L_MIN, "pressure_a": a, "pressure_b": b, "load_pressure": a - b,
                "returned": (at + bt) / L_MIN + pilot}  # fmt: skip

    def come_to_rest(self, spool, **conditions):
        """What two chambers of compressed oil show when they have come to rest."""

        def rises(_time_s, pressures):
            pa, at, pb, bt, out = self.flows(pressures, spool, **conditions)
            return np.array([pa - at - out, pb - bt + out]) * 1.4e9 / 20e-6

        start = np.full(2, (conditions.get("supply", 70.0) + conditions.get("tank", 2.0)) / 2.0 * BAR)
        end = solve_ivp(rises, (0.0, 30.0), start, method="BDF", rtol=1e-8, atol=1.0).y[:, -1]
        return self.seen(end, spool, **conditions)

    def balanced(self, command, **conditions):
        """The same for a command, by a root of what is left of the flows."""
        stands = {key: conditions[key] for key in ("supply", "tank", "oil_c") if key in conditions}
        return self.balanced_at(self.spool(command, **stands), **conditions)

    def balanced_at(self, spool, **conditions):
        """The same for a place of the spool."""
        supply, tank = conditions.get("supply", 70.0), conditions.get("tank", 2.0)

        def left(pressures_bar):
            pa, at, pb, bt, out = self.flows(np.asarray(pressures_bar) * BAR, spool, **conditions)
            return (pa - at - out) / L_MIN, (pb - bt + out) / L_MIN

        if conditions.get("load", 100.0) == 0.0:  # the chambers know nothing of each other
            found = [brentq(lambda one, k=k: left((one, one))[k], tank, supply, xtol=1e-9) for k in (0, 1)]
        else:
            half = 0.5 * (supply + tank)
            tried = [root(left, half + np.array([1.0, -1.0]) * apart, tol=1e-10) for apart in (0.1, 1.0, -1.0)]
            found = min(tried, key=lambda one: float(np.abs(one.fun).max())).x
        return self.seen(np.asarray(found) * BAR, spool, **conditions)


_NEAR = (*np.linspace(-110.0, -6.0, 40), *np.linspace(-5.0, 5.0, 41), *np.linspace(6.0, 110.0, 40))
_FAR = (-110.0, -105.0, -100.0, -95.0, -90.0, 0.0, 90.0, 95.0, 100.0, 105.0, 110.0)
_SEEN = {"flow": "flow", "load pressure": "load_pressure", "return flow": "returned"}


def recorded(clean, gain=1.0, play=0.0, **changed):
    """The recording of a bench without noise, its readings as this valve would have left them.

    Torque motor and pilot are one lag of the third order, chambers and edges at rest at each moment. Between the
    pressures at which a procedure stands, readings are interpolated: nothing is evaluated there.
    """
    valve = Valve(**changed)
    interval_s = float(np.median(np.diff(clean.time_s)))
    spool = valve.followed(clean.values("command"), interval_s, gain, play)
    supply, opened = clean.values("supply pressure"), clean.values("load orifice") / 100.0
    spool = spool + (valve.spool(0.0, 71.0) - valve.spool(0.0, 70.0)) * (supply - 70.0)
    settings, samples = np.unique(clean.values("supply setting"), return_counts=True)
    stood = [float(one) for one in settings[samples > 2000] if one > 0.0]
    read = {}
    for name, key in _SEEN.items():
        tables = [_table(key, s, 100.0, tuple(changed.items()))(spool) for s in stood]
        over = np.interp(supply, stood, np.arange(len(stood)))
        low = np.minimum(over.astype(int), max(len(stood) - 2, 0))
        every = np.array(tables)
        rows = np.arange(len(spool))
        open_ = every[low, rows] + (over - low) * (every[np.minimum(low + 1, len(stood) - 1), rows] - every[low, rows])
        blocked = _table(key, 70.0, 0.0, tuple(changed.items()))(spool)
        read[name] = opened * open_ + (1.0 - opened) * blocked
    keep = math.exp(-interval_s / valve.p["sensor_lag"])
    late = (1.0 - keep) * valve.p["sensor_lag"] / interval_s  # of a flow that goes straight from sample to sample
    read["flow"] = filtered([1.0 - late, late - keep], [1.0, -keep], read["flow"])
    read["spool position"] = spool
    channels = {name: replace(one, values=read.get(name, one.values)) for name, one in clean.channels.items()}
    return replace(clean, channels=channels)


@lru_cache(maxsize=64)
def _table(key, supply, load, changed):
    """One reading at rest over places of the spool."""
    places = _NEAR if supply == 70.0 else _FAR
    valve = Valve(**dict(changed))
    return PchipInterpolator(places, [valve.balanced_at(one, supply=supply, load=load)[key] for one in places])


@lru_cache(maxsize=64)
def curve(name, commands, conditions, changed=()):
    """One output over a tuple of commands; conditions and changed parameters as tuples of pairs. Shape (n,)."""
    valve, given = Valve(**dict(changed)), dict(conditions)
    return np.array([valve.balanced(command, **given)[name] for command in commands])
