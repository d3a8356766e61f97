"""Coupled drives: two motors turn a belt over a pulley on a spring; a counter of pulses measures the pulley's speed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hil.physics.linear import delay_steps, delayed, held_first_order
from hil.physics.plant import Hook, Parameter, Plant, Signal
from hil.physics.steps import spring_step


def equations(voltage: Any, x: Any, c: Any, hook: Any) -> Any:
    """One sub-step: drive voltage → belt speed → pulley on its spring → counter.

    What is counted over a while is the mean of that while: it stands for the speed half of it ago.
    """
    voltage = hook.command(voltage)
    voltage = c.at_rest * x.earlier + (1.0 - c.at_rest) * voltage
    before = x.belt
    x.belt = c.keep * x.belt + (1.0 - c.keep) * c.gain * voltage
    place = c.xx * x.pulley + c.xv * x.rate + c.x0 * before + c.x1 * x.belt
    x.rate = c.vx * x.pulley + c.vv * x.rate + c.v0 * before + c.v1 * x.belt
    x.pulley = place
    turned = hook.pickup(x.pulley)
    counted = delayed(x.counter, turned, c.count_steps)
    reading = hook.sensor(counted)
    return reading  # noqa: RET504  (a hook's value needs a name)


def coefficients(p: Mapping[str, float], step_s: float) -> dict[str, float]:
    """Coefficients of one sub-step; before the first sample the drives turn as they did then."""
    return spring_step(p["spring_frequency"], p["spring_damping"], step_s) | {
        "at_rest": 1.0 if math.isinf(step_s) else 0.0,
        "gain": p["gain"],
        "keep": held_first_order(p["motor_lag"], step_s),
        "count_steps": delay_steps(p["count_time"], step_s),
    }


def initial(p: Mapping[str, float], inputs: tuple[float, ...], output: float) -> dict[str, float]:
    """The voltage that made the speed of the first reading, of which a counter does not tell the direction.

    Drives are often recorded from the moment in which they are switched on.
    """
    return {"earlier": inputs[0] if math.isnan(output) else math.copysign(output / p["gain"], inputs[0])}


PLANT = Plant(
    name="coupled-drives",
    title="coupled drives with a pulley on a spring",
    inputs=(Signal("drive voltage", "V", 1.5),),
    output=Signal("pulley speed", "V", 6.0),
    parameters=(
        Parameter("gain", "1", 4.0, 0.05, 100.0, "speed per voltage", hook="command"),
        Parameter("motor_lag", "s", 0.4, 0.01, 10.0, "time constant of motors and belt", hook="command"),
        Parameter("spring_frequency", "rad/s", 10.0, 0.5, 100.0, "natural frequency of the pulley", hook="pickup"),
        Parameter("spring_damping", "1", 0.1, 0.005, 5.0, "damping ratio of the pulley", hook="pickup"),
        Parameter(
            "count_time",
            "s",
            0.02,
            0.0,
            0.2,
            "half the counting time of the pulses, and the delay of their reading",
            growth="dead_time",
            hook="sensor",
        ),
    ),
    hooks=(
        Hook("command", "motors", "V", 1.5, slower=4.0),
        Hook("pickup", "pulse counter", "V", 6.0, slower=4.0),
        Hook("sensor", "sensor", "V", 6.0, slower=4.0),
    ),
    states={"earlier": 1, "belt": 1, "pulley": 1, "rate": 1},
    lines_s={"counter": 0.2},
    equations=equations,
    coefficients=coefficients,
    sub_step_s=0.005,
    initial=initial,
    source="Wigren, Schoukens: Coupled Electric Drives Data Set and Reference Models, Uppsala University, 2017",
)
