"""Two tanks, one above the other: a pump fills the upper one, which drains into the lower one."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hil.physics.plant import Hook, Parameter, Plant, Signal

# Tanks take minutes for what a valve does in a second.
_SLOWER = 30.0


def equations(voltage: Any, x: Any, c: Any, hook: Any) -> Any:
    """One sub-step by the midpoint rule; levels are in volts of the level sensor.

    What an overflowing tank spills into the next one comes back in `x.spill`.
    """
    voltage = hook.opening(voltage)
    inflow = c.pump * max(voltage, 0.0)
    upper = max(x.upper, 0.0)
    lower = max(x.lower, 0.0)
    half_upper = max(upper + c.half_step * (inflow - c.drain_upper * math.sqrt(upper)), 0.0)
    between = c.drain_upper * math.sqrt(upper)
    half_lower = max(lower + c.half_step * (between - c.drain_lower * math.sqrt(lower)), 0.0)
    between = c.drain_upper * math.sqrt(half_upper)
    x.upper = max(upper + c.step * (inflow - between), 0.0)
    x.lower = max(lower + c.step * (between - c.drain_lower * math.sqrt(half_lower)), 0.0)
    x.spill[0] = 0.0
    x.upper = hook.upper(x.upper, x.spill)
    x.lower += x.spill[0]
    x.lower = hook.lower(x.lower, x.spill)
    level = min(x.lower, c.sensor_range)
    reading = hook.sensor(level)
    return reading, x.upper


def coefficients(p: Mapping[str, float], step_s: float) -> dict[str, float]:
    """Coefficients of one sub-step; before the first sample the levels stand where `initial` puts them."""
    step = 0.0 if math.isinf(step_s) else step_s
    return {
        "pump": p["pump"],
        "drain_upper": p["drain_upper"],
        "drain_lower": p["drain_lower"],
        "step": step,
        "half_step": step / 2.0,
        "sensor_range": p["sensor_range"],
    }


def initial(p: Mapping[str, float], inputs: tuple[float, ...], output: float) -> dict[str, float]:
    """The lower level is read; the upper one is a parameter. Without a reading, the lower tank is in balance."""
    balance = (p["pump"] * max(inputs[0], 0.0) / max(p["drain_lower"], 1e-9)) ** 2
    return {"upper": p["upper_start"], "lower": balance if math.isnan(output) else output}


PLANT = Plant(
    name="cascaded-tanks",
    title="two cascaded tanks",
    inputs=(Signal("pump voltage", "V", 10.0),),
    output=Signal("lower tank level", "V", 10.0),
    observed=(Signal("upper tank level", "V", 10.0),),
    parameters=(
        Parameter(
            "pump", "1/s", 0.04, 1e-4, 1.0, "rise of the upper level per second and volt of the pump", hook="opening"
        ),
        Parameter("drain_upper", "V^0.5/s", 0.04, 1e-4, 1.0, "outlet of the upper tank: q = k·√h", hook="upper"),
        Parameter("drain_lower", "V^0.5/s", 0.05, 1e-4, 1.0, "outlet of the lower tank: q = k·√h", hook="lower"),
        Parameter("upper_start", "V", 5.0, 0.0, 15.0, "upper level at the first sample", hook="upper"),
        Parameter(
            "sensor_range", "V", 10.0, 0.1, 100.0, "largest reading of the level sensor", fixed=True, hook="sensor"
        ),
    ),
    hooks=(
        Hook("opening", "pump", "V", 8.0, slower=_SLOWER),
        Hook("upper", "upper tank", "V", 10.0, extra="spill", slower=_SLOWER),
        Hook("lower", "lower tank", "V", 10.0, extra="spill", slower=_SLOWER),
        Hook("sensor", "sensor", "V", 10.0, slower=_SLOWER),
    ),
    states={"upper": 1, "lower": 1, "spill": 2},
    equations=equations,
    coefficients=coefficients,
    sub_step_s=1.0,
    initial=initial,
    source="Schoukens, Mattsson, Wigren, Noël: Cascaded tanks benchmark, nonlinearbenchmark.org 2016",
)
