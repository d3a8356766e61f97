"""The HPV41 on a lab bench, of another structure than its page: balances at rest by roots, motion by an integrator."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from hil.physics.compose import plant

WIDE = 1e-9  # %, the length of a gap that has opened


class Valve:
    """Parameters of the plant; those given differ from its values. Pressures in bar, flows in l/min, ways in %."""

    def __init__(self, **changed):
        self.p = plant("hpv41-loaded").typical | changed

    def null(self, supply, tank, oil_c):
        p, tenth = self.p, 0.1 * self.p["rated_supply"]
        by_pressure = (p["null_supply"] * (supply - p["rated_supply"]) + p["null_tank"] * tank) / tenth
        return p["null"] + by_pressure + p["null_temperature"] * (oil_c - 40.0) / 40.0

    def demand(self, opening):
        """The flow of an edge that has the compensator's whole drop."""
        p = self.p
        over = max(abs(opening) - p["dead_band"], 0.0) / (100.0 - p["dead_band"])
        return math.copysign(p["full_flow"] * over ** p["curve_exponent"], opening) if over else 0.0

    def throttle(self, load):
        return 0.01 * load * self.p["load_flow"] / math.sqrt(35.0)

    def blocked(self, opening, drop):
        """Load pressure and leakage of four gaps in two rows, each as long as the land covers it."""
        lap = self.p["dead_band"]
        pa = bt = 1.0 / max(lap - opening, WIDE)
        at = pb = 1.0 / max(lap + opening, WIDE)
        leak = 0.01 * self.p["leakage"] * lap * drop * (pa * at / (pa + at) + pb * bt / (pb + bt))
        return drop * (pa / (pa + at) - pb / (pb + bt)), leak

    def flow(self, opening, drop, load):
        """Where edge and load in series take no more than there is; the compensator takes what is left."""
        demand, throttle, margin = self.demand(opening), self.throttle(load), self.p["margin"]

        def too_much(edge):
            return (demand / throttle) ** 2 * edge / margin + edge - drop

        if demand == 0.0:
            return 0.0
        edge = margin if too_much(margin) <= 0.0 else brentq(too_much, 0.0, margin, xtol=1e-12)
        return demand * math.sqrt(edge / margin)

    def at_rest(self, command, supply=100.0, load=100.0, tank=2.0, oil_c=40.0):
        """What is seen when the spool has given way to the load pressure that it makes."""
        drop, null = supply - tank, self.null(supply, tank, oil_c)

        def across(opening):
            if load == 0.0:
                return self.blocked(opening, drop)[0]
            flow = self.flow(opening, drop, load)
            return math.copysign((flow / self.throttle(load)) ** 2, flow)

        spool = brentq(lambda x: x + 0.01 * self.p["give"] * across(x - null) - command, -250.0, 250.0, xtol=1e-12)
        opening = spool - null
        leak = self.blocked(opening, drop)[1] * math.exp(self.p["thinning"] * (oil_c - 40.0))
        return {"spool": spool, "flow": self.flow(opening, drop, load) if load else 0.0,
                "load_pressure": across(opening), "returned": leak}  # fmt: skip

    def load_step(self, command, start, end, time_s, supply=100.0, tank=2.0):
        """What meter and spool show after the throttle steps, shape (n,) each, from rest."""
        p, drop, null = self.p, supply - tank, self.null(supply, tank, 40.0)
        rest = self.at_rest(command, supply, start, tank)

        def seen(spool, taken, load):
            demand, throttle = self.demand(spool - null), self.throttle(load)
            if demand == 0.0 or throttle == 0.0:
                return demand, 0.0, math.copysign(drop, demand) if throttle == 0.0 else 0.0
            flow = math.copysign(math.sqrt(max(drop - taken, 0.0) / (throttle**-2 + p["margin"] / demand**2)), demand)
            return demand, flow, math.copysign((flow / throttle) ** 2, flow)

        def moves(_time_s, y):
            spool, speed, taken, load, meter = y
            demand, flow, across = seen(spool, taken, load)
            throttle = max(self.throttle(load), 1e-12)
            spare = max(drop - p["margin"] - (demand / throttle) ** 2, 0.0)
            w, pull = p["spool_frequency"], command - 0.01 * p["give"] * across - spool
            return [speed, w * w * pull - 2.0 * p["spool_damping"] * w * speed, (spare - taken) / p["compensator_lag"],
                    (end - load) / p["line_lag"], (flow - meter) / p["sensor_lag"]]  # fmt: skip

        demand = self.demand(rest["spool"] - null)
        taken = max(drop - p["margin"] - (demand / self.throttle(start)) ** 2, 0.0) if start else 0.0
        y0 = [rest["spool"], 0.0, taken, start, rest["flow"]]
        found = solve_ivp(moves, (0.0, time_s[-1]), y0, "LSODA", time_s, rtol=1e-8, atol=1e-9, max_step=2e-3).y
        return found[4], found[0]


@lru_cache(maxsize=64)
def curve(name, commands, conditions, changed=()):
    """One output over a tuple of commands; conditions and changed parameters as tuples of pairs. Shape (n,)."""
    valve, given = Valve(**dict(changed)), dict(conditions)
    return np.array([valve.at_rest(command, **given)[name] for command in commands])
