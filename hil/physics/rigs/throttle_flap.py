"""Throttle flap: a motor turns a flap against a return spring, between two stops; the flap's angle is measured."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hil.physics.linear import braked_mass
from hil.physics.plant import Hook, Parameter, Plant, Signal
from hil.physics.stop import speed_after


def equations(motor: Any, x: Any, c: Any, hook: Any) -> Any:
    """One sub-step: motor command → torque against spring and drag → flap → sensor. Torque is counted in command.

    The spring acts half before the flap turns and half after (Strang, SIAM J. Numer. Anal. 5, 1968).
    """
    motor = hook.command(motor)
    torque = c.sign * motor
    half = c.half_spring * (x.angle - c.rest)
    free_speed = c.keep * (x.speed - half) + c.mobility * torque
    friction = hook.force(free_speed, c.mobility)
    moving = free_speed - c.mobility * friction
    before = x.angle
    free = before + c.travel * (x.speed - half) + c.compliance * (torque - friction)
    x.angle = hook.stop(free)
    x.speed = speed_after(moving - c.half_spring * (x.angle - c.rest), free, before, x.angle)
    reading = hook.sensor(x.angle)
    return reading  # noqa: RET504  (a hook's value needs a name)


def coefficients(p: Mapping[str, float], step_s: float) -> dict[str, float]:
    """Coefficients of one sub-step; before the first sample the flap rests."""
    spring = p["frequency"] ** 2
    torque = spring * abs(p["gain"])
    keep, mobility, travel, compliance = braked_mass(1.0, 2.0 * p["damping"] * p["frequency"], step_s)
    return {
        "sign": math.copysign(1.0, p["gain"]),
        "half_spring": 0.0 if math.isinf(step_s) else 0.5 * step_s * spring,
        "rest": p["rest"],
        "keep": keep,
        "mobility": torque * mobility,
        "travel": travel,
        "compliance": torque * compliance,
    }


def initial(p: Mapping[str, float], inputs: tuple[float, ...], output: float) -> dict[str, float]:
    """The flap stands where the first reading says; without one, where spring and motor balance."""
    return {"angle": p["rest"] + p["gain"] * inputs[0] if math.isnan(output) else output}


PLANT = Plant(
    name="throttle-flap",
    title="motor-driven throttle flap with return spring",
    inputs=(Signal("motor command", "V", 50.0),),
    output=Signal("flap angle", "V", 5.0),
    parameters=(
        Parameter("gain", "1", 0.1, -10.0, 10.0, "angle per command against the spring alone", hook="command"),
        Parameter("frequency", "rad/s", 20.0, 0.5, 500.0, "natural frequency of the flap on its spring", hook="force"),
        Parameter("damping", "1", 1.5, 0.01, 50.0, "damping ratio of the flap", hook="force"),
        Parameter("rest", "V", 2.5, -20.0, 20.0, "angle without command", hook="force"),
    ),
    hooks=(
        Hook("command", "motor", "V", 50.0),
        Hook("force", "flap", "V", 50.0, extra="mobility", motion_unit="V", motion_scale=5.0),
        Hook("stop", "flap", "V", 5.0),
        Hook("sensor", "sensor", "V", 5.0),
    ),
    states={"angle": 1, "speed": 1},
    equations=equations,
    coefficients=coefficients,
    sub_step_s=0.001,
    initial=initial,
    source="Deur, Pavković, Perić, Jansz, Hrovat: An electronic throttle control strategy including compensation of "
    "friction and limp-home effects, IEEE Trans. Ind. Appl. 40(3), 2004",
)
