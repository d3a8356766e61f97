"""Friction damper moved by a machine: displacement and velocity are imposed, force is measured."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hil.physics.plant import Hook, Parameter, Plant, Signal


def equations(displacement: Any, velocity: Any, x: Any, c: Any, hook: Any) -> Any:  # noqa: ARG001  (no states)
    """One sub-step: spring and drag of the moved parts, the band on its drum, and what the load cell reads.

    Whatever play there is lies between the machine and the band.
    """
    moved = hook.opening(displacement)
    force = hook.band(c.stiffness * moved + c.viscous * velocity, moved)
    reading = hook.sensor(force + c.zero)
    return reading  # noqa: RET504  (a hook's value needs a name)


def coefficients(p: Mapping[str, float], _step_s: float) -> dict[str, float]:
    """Force per displacement and per speed, and the force at rest."""
    return {"stiffness": p["stiffness"], "viscous": p["viscous"], "zero": p["zero"]}


PLANT = Plant(
    name="friction-damper",
    title="rotary friction damper under test",
    inputs=(Signal("displacement", "mm", 25.0), Signal("velocity", "mm/s", 100.0)),
    output=Signal("force", "kN", 20.0),
    parameters=(
        Parameter("stiffness", "kN/mm", 0.1, 0.0, 100.0, "force per displacement", hook="band"),
        Parameter("viscous", "kN*s/mm", 0.1, 0.0, 100.0, "force per speed", hook="band"),
        Parameter("zero", "kN", 0.0, -20.0, 20.0, "force at rest: weight, zero of the load cell", hook="sensor"),
    ),
    hooks=(
        Hook("opening", "linkage", "mm", 25.0),
        Hook("band", "band", "kN", 20.0, extra="displacement", motion_unit="mm", motion_scale=25.0),
        Hook("sensor", "load cell", "kN", 20.0),
    ),
    equations=equations,
    coefficients=coefficients,
    sub_step_s=0.01,
    source="Cao, Downey, Laflamme, Taylor, Ricles: Variable friction device for structural control based on duo-servo "
    "vehicle brake, J. Sound Vib. 348, 2015",
)
