"""Control loop of a process: controller output to process value; the stem of the valve between is not recorded."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hil.physics.linear import held_first_order
from hil.physics.plant import Hook, Parameter, Plant, Signal


def equations(output: Any, x: Any, c: Any, hook: Any) -> Any:
    """One sub-step: controller output → stem of the valve → process.

    What else moves a process (load, inflow) is not recorded, and looks like any error of its transmitter: none is here.
    """
    stem = hook.stem(output)
    x.flow = c.keep * x.flow + (1.0 - c.keep) * c.gain * stem
    reading = hook.process(x.flow + c.zero)
    return reading  # noqa: RET504  (a hook's value needs a name)


def coefficients(p: Mapping[str, float], step_s: float) -> dict[str, float]:
    """Coefficients of one sub-step."""
    return {"gain": p["gain"], "zero": p["zero"], "keep": held_first_order(p["lag"], step_s)}


PLANT = Plant(
    name="flow-loop",
    title="control loop with a valve",
    inputs=(Signal("controller output", "%", 100.0),),
    output=Signal("process value", "1", 100.0),
    parameters=(
        Parameter("gain", "1/%", 1.0, -1e3, 1e3, "process value per controller output", hook="process"),
        Parameter("lag", "s", 10.0, 0.1, 1e4, "time constant of valve, process and transmitter", hook="process"),
        Parameter("zero", "1", 0.0, -1e4, 1e4, "process value with the valve closed", hook="process"),
    ),
    hooks=(
        Hook("stem", "valve", "%", 100.0, slower=100.0),
        Hook("process", "process", "1", 100.0, slower=100.0),
    ),
    states={"flow": 1},
    equations=equations,
    coefficients=coefficients,
    sub_step_s=5.0,
    source="Choudhury, Thornhill, Shah: Modelling valve stiction, Control Eng. Practice 13(5), 2005",
)
