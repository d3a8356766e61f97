"""Hydraulic actuator of a crane: a valve drives an arm, the oil between them is a spring; its pressure is measured."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hil.physics.linear import braked_mass
from hil.physics.plant import Hook, Parameter, Plant, Signal

# Its second is a sample, of which an arm that swings once a second takes some twenty.
_SLOWER = 20.0


def equations(opening: Any, x: Any, c: Any, hook: Any) -> Any:
    """One sub-step: valve opening → flow → oil spring → arm. A positive reading lets the arm down.

    Flow is counted in openings. Oil is compressed by what flows in and is not yet taken by the arm; the arm is a
    mass with drag and a load. A recording that begins with an open valve begins in motion: the arm then takes what
    flows in.

    Half of what the sub-step does to the oil comes before the arm moves and half after, and drag acts by its exact
    decay: an error that falls with the square of the step (Strang, SIAM J. Numer. Anal. 5, 1968).
    """
    opening = hook.opening(c.null - opening)
    flow = opening
    if opening < 0.0:
        flow = c.lowering * opening
    flow = hook.edge(flow, x.oil)
    x.oil += c.half_squeeze * (flow - x.speed)
    x.speed += c.settling * (flow - x.speed)
    free_speed = c.keep * x.speed + c.mobility * (x.oil - c.load)
    opposing = hook.force(free_speed, c.mobility)
    free_speed = free_speed - c.mobility * opposing
    lost = hook.line(free_speed, c.mobility)
    x.speed = free_speed - c.mobility * lost
    x.oil += c.half_squeeze * (flow - x.speed)
    reading = hook.sensor(x.oil)
    return reading  # noqa: RET504  (a hook's value needs a name)


def coefficients(p: Mapping[str, float], step_s: float) -> dict[str, float]:
    """Coefficients of one sub-step; before the first sample the arm moves steadily, at the first pressure."""
    step = 0.0 if math.isinf(step_s) else step_s
    keep, mobility, _, _ = braked_mass(p["oil_stiffness"] / p["oil_frequency"] ** 2, p["drag"], step)
    return {
        "settling": float(math.isinf(step_s)),
        "null": p["null"],
        "lowering": p["lowering_ratio"],
        "half_squeeze": 0.5 * p["oil_stiffness"] * step,
        "keep": keep,
        "mobility": mobility,
        "load": p["load"],
    }


def initial(p: Mapping[str, float], _inputs: tuple[float, ...], output: float) -> dict[str, float]:
    """The oil has the pressure that is read first."""
    return {"oil": p["load"] if math.isnan(output) else output}


PLANT = Plant(
    name="hydraulic-actuator",
    title="hydraulic actuator of a crane",
    inputs=(Signal("valve opening", "1", 1.0),),
    output=Signal("oil pressure", "1", 3.0),
    parameters=(
        Parameter("oil_frequency", "rad/s", 0.25, 0.01, 5.0, "natural frequency of the arm on the oil", hook="force"),
        Parameter(
            "oil_stiffness",
            "1/s",
            0.7,
            0.01,
            50.0,
            "rise of pressure per second at full opening, arm held",
            hook="edge",
        ),
        Parameter("drag", "1", 1.0, 0.0, 50.0, "pressure that moves the arm steadily at full opening", hook="force"),
        Parameter("lowering_ratio", "1", 1.0, 0.1, 10.0, "speed down over speed up", change="asymmetry", hook="edge"),
        Parameter("null", "1", 0.0, -1.0, 1.0, "opening reading at which nothing flows", hook="opening"),
        Parameter("load", "1", 0.0, -3.0, 3.0, "pressure that holds the arm", hook="force"),
    ),
    hooks=(
        Hook("opening", "orifice", "1", 1.0, slower=_SLOWER),
        Hook("edge", "orifice", "1", 1.0, extra="load_pressure", slower=_SLOWER),
        Hook("force", "arm", "1", 3.0, extra="mobility", slower=_SLOWER),
        Hook("line", "lines", "1", 3.0, extra="mobility", slower=_SLOWER),
        Hook("sensor", "sensor", "1", 3.0, slower=_SLOWER),
    ),
    states={"oil": 1, "speed": 1},
    equations=equations,
    coefficients=coefficients,
    sub_step_s=0.05,
    initial=initial,
    source="Sjöberg et al.: Nonlinear black-box modeling in system identification, Automatica 31(12), 1995; "
    "Merritt: Hydraulic Control Systems, 1967, ch. 6",
)
