"""Pump ripple or hum with two harmonics; locked to the start of the recording, or at a chance phase in each."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..chance import chance
from ..law import AXIS, EFC, HPV41, SP08, Law, Shared
from ..memory import KEY


def equation(x: float, a: float, b: float, r: Any) -> float:
    size, frequency, second, third, phase, locked = r.p[0], r.p[1], r.p[2], r.p[3], r.p[4], r.p[5]
    angle = 2.0 * np.pi * frequency * r.t + phase
    if locked == 0.0:
        angle += 2.0 * np.pi * chance(frequency, r.p[KEY])
    return x + size * (np.sin(angle) + second * np.sin(2.0 * angle + 0.7) + third * np.sin(3.0 * angle + 2.1))


_HZ = {HPV41: (3.0, 30.0), EFC: (5.0, 40.0), SP08: (0.7, 6.0), AXIS: (0.4, 3.0)}


LAW = Law(
    effect="periodic_disturbance",
    strength="size",
    others={
        "frequency_hz": _HZ,
        "second_harmonic": (0.0, 0.4),
        "third_harmonic": (0.0, 0.2),
        "phase_rad": (0.0, 6.28),
        "locked": 1.0,
    },
    largest={HPV41: 10.0, EFC: 20.0, SP08: 60.0, AXIS: 60.0},
    equation=equation,
    at={HPV41: slots.OUTPUT, EFC: slots.OUTPUT, SP08: slots.OUTPUT, AXIS: slots.DRIVE},
    shared=(
        Shared("frequency", "Hz", lambda p: p[1]),
        Shared("frequency", "rad/s", lambda p: p[1] * 2.0 * np.pi),
    ),
)
