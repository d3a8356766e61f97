"""Brevini HPV41: dead time, pilot, closed spool loop, overlapped flow curve, flow meter.

command [%] → delay → pilot (first order) → spool (second order) → flow [l/min] → meter (first order)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..plant import Base, Channel, Plant
from ..slots import through

SUPPLY_BAR = 100.0


def equations(r: Any, laws: Any, records: Any) -> None:
    c, s, ds = r.c, r.s, r.ds
    pilot, spool, speed, shown = s[0], s[1], s[2], s[3]

    drive = through(slots.DRIVE, r.u, 0.0, 0.0, laws, records)
    viscosity = through(slots.VISCOSITY, 1.0, r.t, 0.0, laws, records)
    ds[0] = through(slots.RATE, c[1] / viscosity * (drive - pilot), pilot, 0.0, laws, records)

    force = through(slots.FORCE, pilot - spool, spool, speed, laws, records)
    ds[1] = speed
    ds[2] = c[2] * c[2] * force - 2.0 * c[3] * c[2] * viscosity * speed

    edge = through(slots.LINK, spool, speed, 0.0, laws, records)
    edge = through(slots.METER, edge, speed, 0.0, laws, records)
    opening = (abs(edge) - c[4]) / (100.0 - c[4])
    flow = c[5] * opening ** c[6] if opening > 0.0 else 0.0
    flow = through(slots.FLOW, -flow if edge < 0.0 else flow, edge, 0.0, laws, records)

    supply = through(slots.SUPPLY, 1.0, abs(flow) / c[5], 0.0, laws, records)
    flow = through(slots.OUTPUT, flow * np.sqrt(supply), edge, 0.0, laws, records)

    met = through(slots.SENSOR, flow, 0.0, 0.0, laws, records)
    ds[3] = (met - shown) / c[7]
    r.out[0] = through(slots.READING, shown, edge, r.u, laws, records)
    r.out[1] = edge
    r.out[2] = SUPPLY_BAR * supply


def _start(c: np.ndarray[Any, Any], command: float) -> tuple[float, ...]:
    opening = max(0.0, (abs(command) - c[4]) / (100.0 - c[4]))
    return command, command, 0.0, float(np.sign(command) * c[5] * opening ** c[6])


PLANT = Plant(
    name="brevini-hpv41",
    equations=equations,
    base=(
        Base("dead_time", 0.020, 0.2, "s", changes=False),
        Base("pilot", 8.0, 0.15, "rad/s"),
        Base("spool_frequency", 33.0, 0.15, "rad/s"),
        Base("spool_damping", 0.5, 0.2),
        Base("overlap", 20.0, 0.15, "%", changes=False),
        Base("full_flow", 70.0, 0.1, "l/min"),
        Base("curve_exponent", 1.2, 0.08),
        Base("meter_lag", 0.008, 0.2, "s", changes=False),
    ),
    start=_start,
    command=Channel("command [%]", 0.0, 150.0),
    channels=(
        Channel("flow [l/min]", 0.3, 150.0),
        Channel("spool position [%]", 0.2, 150.0),
        Channel("supply pressure [bar]", 0.3, 200.0),
    ),
    drive=100.0,
    centre=0.0,
    output=70.0,
)
