"""Pneumatic cylinder moved by a test machine: displacement and pressure are imposed, the rod's force is measured."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hil.physics.plant import Hook, Parameter, Plant, Signal


def equations(displacement: Any, pressure: Any, x: Any, c: Any, hook: Any) -> Any:  # noqa: ARG001  (no states)
    """One sub-step: pressure on the piston, what the seal adds, and what the load cell reads beside it."""
    force = c.area * pressure
    force = hook.seal(force, displacement)
    reading = hook.sensor(force + c.preload)
    return reading  # noqa: RET504  (a hook's value needs a name)


def coefficients(p: Mapping[str, float], _step_s: float) -> dict[str, float]:
    """Newton per bar, and the force without pressure."""
    return {"area": 0.1 * p["piston_area"], "preload": p["preload"]}


PLANT = Plant(
    name="pneumatic-cylinder",
    title="pneumatic cylinder under test",
    inputs=(Signal("displacement", "mm", 40.0), Signal("pressure", "bar", 10.0)),
    output=Signal("force", "N", 400.0),
    parameters=(
        Parameter("piston_area", "mm^2", 500.0, 1.0, 1e5, "area that the pressure acts on", hook="seal"),
        Parameter(
            "preload",
            "N",
            0.0,
            -500.0,
            500.0,
            "force without pressure: weight, spring, zero of the load cell",
            hook="sensor",
        ),
    ),
    hooks=(
        Hook("seal", "seal", "N", 400.0, extra="displacement"),
        Hook("sensor", "load cell", "N", 400.0),
    ),
    equations=equations,
    coefficients=coefficients,
    sub_step_s=0.01,
    source="Zillen, Vallery, Smit: measurements of pneumatic seal friction, TU Delft",
)
