"""A measured flow curve behind a transfer function: dynamics of up to three poles and a zero, then a table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hil.physics.linear import delay_steps, delayed, held_first_order
from hil.physics.measured_curve import NODES, bends, curve_parameters, nodes, tabulated
from hil.physics.plant import Hook, Parameter, Plant, Signal
from hil.physics.steps import spring_step
from hil.record.recording import Array

_ENDS = np.array([-1e3, *[1e3] * (NODES - 1)])  # of the table that a plant starts with, which changes nothing


def equations(value: Any, x: Any, c: Any, hook: Any) -> Any:
    """One sub-step: command → dead time → (1 + s·zero)/((1 + s·lag)·(1 + 2ζ·s·τ + s²·τ²)) → flow curve → sensor.

    The dynamics pass the command as it is at rest; the curve alone says what flows. Between two nodes it is straight,
    beyond the first and the last it stays. `c.bend` is by how much its slope changes at the nodes `c.at`.
    """
    value = hook.command(value)
    value = delayed(x.line, value, c.dead_steps)
    x.lag = c.keep * x.lag + (1.0 - c.keep) * value
    drive = x.lag
    place = c.xx * x.place + c.xv * x.speed + c.x0 * x.drive + c.x1 * drive
    x.speed = c.vx * x.place + c.vv * x.speed + c.v0 * x.drive + c.v1 * drive
    x.place = place
    x.drive = drive
    opening = hook.position(place + c.zero * x.speed)
    flow = c.lowest + tabulated(opening, c.at, c.bend)
    flow = hook.flow(flow, 0.0)
    reading = hook.sensor(flow)
    return reading  # noqa: RET504  (a hook's value needs a name)


def coefficients(p: Mapping[str, float], step_s: float) -> dict[str, float | Array]:
    """Coefficients of one sub-step from times, damping and the nodes of the curve."""
    at, flow = nodes(p)
    return {
        "dead_steps": delay_steps(p["dead_time"], step_s),
        "keep": held_first_order(p["lag_time"], step_s),
        "zero": p["zero"],
        "lowest": float(flow[0]),
        "at": at,
        "bend": bends(at, flow),
        **spring_step(1.0 / p["pair_time"], p["pair_damping"], step_s),
    }


PLANT = Plant(
    name="curve-and-response",
    title="measured flow curve and transfer function",
    inputs=(Signal("input", "any"),),
    output=Signal("output", "any"),
    parameters=(
        Parameter("dead_time", "s", 0.0, 0.0, 1e4, "pure delay", growth="dead_time", hook="command", size=1.0),
        Parameter("lag_time", "s", 0.1, 0.0, 1e6, "time constant of the real pole", hook="position"),
        Parameter("pair_time", "s", 0.03, 1e-5, 1e6, "1/ω of the pair of poles", hook="position"),
        Parameter("pair_damping", "1", 0.5, 0.001, 50.0, "damping ratio of the pair", hook="position"),
        Parameter(
            "zero", "s", 0.0, -1e6, 1e6, "zero: 1 + s·zero; negative: right half plane", hook="position", size=2e3
        ),
        *curve_parameters(_ENDS, _ENDS, "{input}", "{output}"),
    ),
    hooks=(
        Hook("command", "command", "{input}", 1.0),
        Hook("position", "dynamics", "{input}", 1.0),
        Hook("flow", "output", "{output}", 1.0, extra="opening"),
        Hook("sensor", "sensor", "{output}", 1.0),
    ),
    states={"lag": 1, "place": 1, "speed": 1, "drive": 1},
    lines_s={"line": "dead_time"},
    equations=equations,
    coefficients=coefficients,
    sub_step_s=0.001,
    source="Tørdal, Klausen, Bak: figure 17",
)
