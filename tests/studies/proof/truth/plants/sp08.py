"""HydraForce SP08-47C with cylinder in a closed position loop.

request [mm] → proportional controller → valve command (±100 %) → spool (second order) → cylinder speed, by
direction → position [mm], fed back
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..plant import Base, Channel, Plant
from ..slots import through


def equations(r: Any, laws: Any, records: Any) -> None:
    c, s, ds = r.c, r.s, r.ds
    position, spool, speed = s[0], s[1], s[2]

    sensed = through(slots.SENSOR, position, 0.0, 0.0, laws, records)
    command = min(max(c[0] * (r.u - sensed), -100.0), 100.0)
    drive = through(slots.DRIVE, command, 0.0, 0.0, laws, records)
    viscosity = through(slots.VISCOSITY, 1.0, r.t, 0.0, laws, records)

    force = through(slots.FORCE, drive - spool, spool, speed, laws, records)
    ds[1] = through(slots.RATE, speed, spool, 0.0, laws, records)
    ds[2] = c[1] * c[1] * force - 2.0 * c[2] * c[1] * viscosity * speed

    edge = through(slots.LINK, spool, speed, 0.0, laws, records)
    edge = through(slots.METER, edge, speed, 0.0, laws, records)
    flow = (c[3] if edge > 0.0 else c[4]) * edge / 100.0
    flow = through(slots.FLOW, flow, edge, position, laws, records)

    supply = through(slots.SUPPLY, 1.0, abs(flow) / c[4], 0.0, laws, records)
    flow = through(slots.OUTPUT, flow * np.sqrt(supply), edge, 0.0, laws, records)
    ds[0] = through(slots.TRAVEL, flow, position, 0.0, laws, records)
    r.out[0] = through(slots.READING, sensed, edge, r.u, laws, records)


def _start(c: np.ndarray[Any, Any], request: float) -> tuple[float, ...]:
    return request, 0.0, 0.0


PLANT = Plant(
    name="hydraforce-sp08-47c",
    equations=equations,
    base=(
        Base("loop_gain", 1.4, 0.15, "%/mm"),
        Base("spool_frequency", 75.0, 0.15, "rad/s"),
        Base("spool_damping", 0.7, 0.15),
        Base("speed_out", 180.0, 0.12, "mm/s", together=("speed_in",)),
        Base("speed_in", 264.0, 0.12, "mm/s", changes=False),  # alone it is an asymmetry
    ),
    start=_start,
    command=Channel("request [mm]", 0.0, 300.0),
    channels=(Channel("position [mm]", 0.05, 300.0),),
    drive=100.0,
    centre=0.0,
    output=200.0,
)
