"""Cummins EFC: coil, spring-centred rotor, sigmoid pressure curve, pressure sensor.

current [A] → coil (first order) → rotor (second order) → pressure [psi] → sensor (first order)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..plant import Base, Channel, Plant
from ..slots import through


def equations(r: Any, laws: Any, records: Any) -> None:
    c, s, ds = r.c, r.s, r.ds
    coil, rotor, speed, shown = s[0], s[1], s[2], s[3]

    drive = through(slots.DRIVE, r.u, 0.0, 0.0, laws, records)
    viscosity = through(slots.VISCOSITY, 1.0, r.t, 0.0, laws, records)
    ds[0] = through(slots.RATE, (drive - coil) / c[0], coil, 0.0, laws, records)

    force = through(slots.FORCE, coil - rotor, rotor, speed, laws, records)
    ds[1] = speed
    ds[2] = c[1] * c[1] * force - 2.0 * c[2] * c[1] * viscosity * speed

    edge = through(slots.LINK, rotor, speed, 0.0, laws, records)
    edge = through(slots.METER, edge, speed, 0.0, laws, records)
    pressure = c[3] + c[4] / (1.0 + np.exp((c[5] - edge) / c[6]))
    pressure = through(slots.FLOW, pressure, edge, 0.0, laws, records)

    supply = through(slots.SUPPLY, 1.0, abs(pressure) / c[4], 0.0, laws, records)
    pressure = through(slots.OUTPUT, pressure * np.sqrt(supply), edge, 0.0, laws, records)

    met = through(slots.SENSOR, pressure, 0.0, 0.0, laws, records)
    ds[3] = (met - shown) / c[7]
    r.out[0] = through(slots.READING, shown, edge, r.u, laws, records)


def _start(c: np.ndarray[Any, Any], current: float) -> tuple[float, ...]:
    return current, current, 0.0, float(c[3] + c[4] / (1.0 + np.exp((c[5] - current) / c[6])))


PLANT = Plant(
    name="cummins-efc",
    equations=equations,
    base=(
        Base("coil_lag", 0.016, 0.2, "s", changes=False),
        Base("rotor_frequency", 50.0, 0.12, "rad/s"),
        Base("rotor_damping", 0.5, 0.2),
        Base("closed_pressure", 3.0, 0.2, "psi"),
        Base("pressure_span", 207.0, 0.05, "psi", change=(0.02, 0.15)),
        Base("centre", 1.58, 0.03, "A", change=(0.005, 0.05)),
        Base("width", 0.1, 0.15, "A"),
        Base("sensor_lag", 0.004, 0.2, "s", changes=False),
    ),
    start=_start,
    command=Channel("current [A]", 0.0, 5.0),
    channels=(Channel("pressure [psi]", 0.6, 500.0),),
    drive=0.6,
    centre=1.5,
    output=207.0,
)
