"""Linear axis: a carriage pushed by a force against viscous damping, m·ẍ + b·ẋ = F.

force [N] → speed → position [m]. Recorded inside a sampled position loop, so that the stroke stays bounded.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..plant import Base, Channel, Plant
from ..slots import through


def equations(r: Any, laws: Any, records: Any) -> None:
    c, s, ds = r.c, r.s, r.ds
    position, speed = s[0], s[1]
    drive = through(slots.DRIVE, r.u, 0.0, 0.0, laws, records)
    viscosity = through(slots.VISCOSITY, 1.0, r.t, speed, laws, records)
    net = drive - c[2] * viscosity * speed
    ds[0] = speed
    ds[1] = through(slots.FORCE, net, position, speed, laws, records) / c[1]
    seen = through(slots.OUTPUT, position, position, 0.0, laws, records)
    seen = through(slots.SENSOR, seen, 0.0, 0.0, laws, records)
    r.out[0] = through(slots.READING, seen, position, r.u, laws, records)


def _start(c: np.ndarray[Any, Any], force: float) -> tuple[float, ...]:
    return 0.0, 0.0


PLANT = Plant(
    name="linear-axis",
    equations=equations,
    base=(
        Base("dead_time", 0.001, 0.0, "s", changes=False),  # of the drive's own computer
        Base("mass", 95.0, 0.15, "kg"),
        Base("damping", 200.0, 0.2, "N·s/m"),
    ),
    start=_start,
    command=Channel("force [N]", 0.0, 1000.0),
    channels=(Channel("position [m]", 2e-5, 0.4),),
    drive=200.0,
    centre=0.0,
    output=0.2,
    settle_s=0.0,
    full_sigma=(10.0, 60.0),
    tracked=True,
)
