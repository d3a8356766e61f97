"""Pump with a pressure regulator, gas-charged accumulator and a line loss.

Gas: p = (1 + w·v)^−κ with the oil v that is missing; v̇ = demand − (1 − p)/droop; line: −¼·droop·demand².
"""

from __future__ import annotations

from typing import Any

from .. import slots
from ..law import EFC, HPV41, SP08, Law


def equation(x: float, a: float, b: float, r: Any) -> float:
    droop, time_s, gas = 0.8 * r.p[0], r.p[1], r.p[2]
    if droop < 1e-9:
        return x
    stiffness = droop / (gas * time_s)
    missing = r.z[0]
    pressure = (1.0 + stiffness * missing) ** -gas
    r.dz[0] = a - (1.0 - pressure) / droop
    return x * max(0.05, pressure - 0.25 * droop * a * a)


LAW = Law(
    effect="supply_droop",
    strength="droop_at_full_flow",
    others={"time_s": (0.15, 1.0), "polytropic_exponent": (1.1, 1.4)},
    largest={HPV41: 0.7, EFC: 0.5, SP08: 0.7},
    equation=equation,
    at=slots.SUPPLY,
)
