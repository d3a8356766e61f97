"""Servo valve swept slowly with its control ports blocked: current in, load pressure out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hil.physics.plant import Hook, Parameter, Plant, Signal


def equations(current: Any, x: Any, c: Any, hook: Any) -> Any:  # noqa: ARG001  (no states)
    """One sample of a slow sweep: torque motor → spool → pressure, which cannot exceed the supply's.

    The spool stands where the torque motor wants it, in mA of torque-motor current.
    """
    torque = hook.coil(current)
    opening = hook.opening(torque - c.null)
    pressure = hook.blocked(c.gain * opening, c.supply)
    pressure = min(max(pressure, -c.supply), c.supply)
    reading = hook.sensor(pressure)
    return reading  # noqa: RET504  (a hook's value needs a name)


def coefficients(p: Mapping[str, float], _step_s: float) -> dict[str, float]:
    """Gain, null and supply as they are."""
    return {"gain": p["pressure_gain"], "null": p["null"], "supply": p["supply_pressure"]}


PLANT = Plant(
    name="servo-valve-blocked",
    title="servo valve with blocked ports",
    inputs=(Signal("current", "mA", 25.0),),
    output=Signal("load pressure", "bar", 200.0),
    parameters=(
        Parameter(
            "pressure_gain", "bar/mA", 200.0, -5000.0, 5000.0, "load pressure per current at null", hook="blocked"
        ),
        Parameter("null", "mA", 0.0, -10.0, 10.0, "current at which the load pressure is zero", hook="opening"),
        Parameter("supply_pressure", "bar", 207.0, 1.0, 400.0, "supply pressure less return pressure", hook="blocked"),
    ),
    hooks=(
        Hook("coil", "torque motor", "mA", 25.0),
        Hook("opening", "spool", "mA", 25.0),
        Hook("blocked", "lands", "bar", 200.0, extra="supply"),
        Hook("sensor", "sensor", "bar", 200.0),
    ),
    equations=equations,
    coefficients=coefficients,
    sub_step_s=1.0,
    source="Merritt: Hydraulic Control Systems, 1967, ch. 5 and 7; SAE ARP490",
)
