"""A line with a reflecting end: w(t) = (1 + ρ)·x(t) − ρ·w(t − 2T), each reflection rounded by wall losses."""

from __future__ import annotations

from typing import Any

from .. import slots
from ..delay_line import amend, between, remember
from ..law import EFC, HPV41, Law


def equation(x: float, a: float, b: float, r: Any) -> float:
    reflection, travel_s, loss_s = r.p[0], r.p[1], r.p[2]
    if r.m[0] == 0.0 and r.first == 1:
        r.m[2] = x
    remember(r, x)  # keeps the place of this step's wave, which is overwritten below; what is read is older
    returned = between(r, (travel_s - (r.t - r.m[1])) / r.h, x)
    r.dz[0] = (returned - r.m[2] - r.z[0]) / loss_s
    wave = (1.0 + reflection) * x - reflection * (r.m[2] + r.z[0])
    if r.first == 1:
        amend(r, wave)
    return wave


_TRAVEL_S = {HPV41: (0.03, 0.08), EFC: (0.015, 0.04)}


LAW = Law(
    effect="resonance",
    strength="reflection",
    others={"return_time_s": _TRAVEL_S, "loss_s": (0.003, 0.006)},
    largest={HPV41: 0.9, EFC: 0.9},
    equation=equation,
    at=slots.OUTPUT,
)
