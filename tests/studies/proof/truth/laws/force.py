"""Laws of what pushes, brakes and stops the moving part, and of its speed."""

from __future__ import annotations

import numpy as np

from ..chance import chance
from ..law import ADDS_UP, AXIS, EFC, HPV41, SP08, Shared, Times, acts
from ..memory import KEY
from ..slots import FORCE, RATE, TRAVEL, VISCOSITY

_FRICTION = {"strength": "coulomb", "largest": {HPV41: 10.0, EFC: 0.08, SP08: 12.0, AXIS: 60.0}, "full_sigma": ADDS_UP}


@acts(
    FORCE,
    "friction",
    others={
        "static_over_coulomb": (1.1, 1.5),
        "stribeck_speed": Times({HPV41: 6.0, EFC: 0.2, SP08: 20.0, AXIS: 0.008}, 0.7, 1.4),
        "bristle_deflection": Times({HPV41: 0.08, EFC: 0.0015, SP08: 0.6, AXIS: 5e-5}, 0.9, 1.3),
        "elastic_share": (0.3, 0.7),
    },
    **_FRICTION,
)
def friction_elasto_plastic(x, a, b, r):
    """Elasto-plastic bristle friction: truly elastic before it slides (Dupont et al., IEEE TAC 47(5), 2002).

    ż = v·(1 − α(z, v)·z/z_ss), F = σ0·z; α is 0 below the break-away deflection, 1 at sliding, smooth between.
    """
    coulomb, ratio, stribeck_speed, bristle, elastic = r.p[0], r.p[1], r.p[2], r.p[3], r.p[4]
    if coulomb <= 0.0:
        return x
    z = r.z[0]
    sliding = bristle * (1.0 + (ratio - 1.0) / (1.0 + (b / stribeck_speed) ** 2))
    breakaway = elastic * sliding
    alpha = 0.0
    if z * b > 0.0 and abs(z) >= breakaway:
        alpha = 1.0
        if abs(z) < sliding:
            alpha = 0.5 + 0.5 * np.sin(np.pi * (abs(z) - 0.5 * (sliding + breakaway)) / (sliding - breakaway))
    r.dz[0] = b * (1.0 - alpha * abs(z) / sliding)
    return x - coulomb / bristle * z


# bristle deflections are as short as the solver's step allows at the fastest motion of each plant
@acts(
    FORCE,
    "friction",
    others={
        "static_over_coulomb": (1.1, 1.6),
        "stribeck_speed": Times({HPV41: 8.0, EFC: 0.25, SP08: 25.0, AXIS: 0.01}, 0.7, 1.4),
        "bristle_deflection": Times({HPV41: 0.08, EFC: 0.0015, SP08: 0.6, AXIS: 2e-4}, 0.9, 1.3),
        "bristle_damping_s": (0.0, 5e-4),
    },
    **_FRICTION,
)
def friction_lugre(x, a, b, r):
    """LuGre bristle friction with Stribeck curve (Canudas de Wit et al., IEEE TAC 40(3), 1995).

    ż = v − σ0·|v|·z/g(v), F = σ0·z + σ1·ż, g(v) = Fc + (Fs − Fc)·exp(−(v/vs)²)
    """
    coulomb, ratio, stribeck_speed, bristle, damping = r.p[0], r.p[1], r.p[2], r.p[3], r.p[4]
    if coulomb <= 0.0:
        return x
    level = coulomb * (1.0 + (ratio - 1.0) * np.exp(-((b / stribeck_speed) ** 2)))
    stiffness = coulomb / bristle
    r.dz[0] = b - stiffness * abs(b) * r.z[0] / level
    return x - stiffness * (r.z[0] + damping * r.dz[0])


@acts(
    FORCE,
    "friction",
    others={
        "static_over_coulomb": (1.1, 1.5),
        "stribeck_speed": Times({HPV41: 8.0, EFC: 0.25, SP08: 25.0, AXIS: 0.01}, 0.7, 1.4),
        "deflection": Times({HPV41: 0.15, EFC: 0.002, SP08: 0.8, AXIS: 6e-5}, 0.8, 1.2),
        "spread_of_elements": (0.2, 0.5),
    },
    **_FRICTION,
)
def friction_maxwell_slip(x, a, b, r):
    """Maxwell-slip friction: four spring-slider elements in parallel, each with its own break-away (Iwan 1966).

    Element i carries k_i·z_i up to its share w_i of the friction force, which weakens with speed.
    """
    coulomb, ratio, stribeck_speed, deflection, spread = r.p[0], r.p[1], r.p[2], r.p[3], r.p[4]
    level = 1.0 + (ratio - 1.0) / (1.0 + abs(b) / stribeck_speed)
    force = 0.0
    for i in range(4):
        reach = deflection * (1.0 + spread * (i - 1.5))
        z = r.m[i]
        if r.first == 1:  # elements follow step by step, as sliders do
            z = min(max(z + b * r.h, -reach * level), reach * level)
            r.m[i] = z
        force += 0.25 * z / reach
    return x - coulomb * force


@acts(
    FORCE,
    "load_force",
    strength="force_n",
    largest={AXIS: 40.0},
    shared=(Shared("force", "N", lambda p: abs(p[0])),),
    full_sigma={AXIS: (3000.0, 30000.0)},  # a constant force adds up most of all
)
def load_force_constant(x, a, b, r):
    """A constant force on the carriage: an inclined axis, or a drive that is not quite at zero."""
    return x - r.p[0]


@acts(
    FORCE,
    "end_stop",
    strength="moved_in",
    others={
        "reach": {HPV41: 101.0, EFC: 2.11, AXIS: 0.11},
        "stiffness": Times({HPV41: 300.0, EFC: 150.0, AXIS: 4e6}, 0.8, 1.5),  # input units per unit of position
        "damping_s": Times({HPV41: 0.002, EFC: 0.002, AXIS: 0.012}, 0.5, 2.0),
    },
    largest={HPV41: 60.0, EFC: 0.6, AXIS: 0.08},
    shared=tuple(Shared("position", unit, lambda p: p[1] - p[0], both_ways=True) for unit in ("%", "A", "m")),
    full_sigma=ADDS_UP,
)
def end_stop_contact(x, a, b, r):
    """A part that meets its stop: spring and damper, pushing only. The strength is how far the stop is moved in."""
    limit, stiffness, damping_s = r.p[1] - r.p[0], r.p[2], r.p[3]
    deep = abs(a) - limit
    if deep <= 0.0:
        return x
    outward = b if a > 0.0 else -b
    push = stiffness * max(0.0, deep + damping_s * outward)
    return x - push if a > 0.0 else x + push


@acts(
    TRAVEL,
    "end_stop",
    strength="moved_in_mm",
    others={"reach_mm": 188.0, "cushion_mm": (0.3, 0.8)},
    largest={SP08: 70.0},
    shared=(Shared("position", "mm", lambda p: p[1] - p[0]),),
)
def end_stop_cushion(x, a, b, r):
    """The cylinder meets a cushioned stop before the end of its stroke: oil leaves only as the cushion is pressed."""
    deep = a - (r.p[1] - r.p[0])
    if deep <= 0.0:
        return x
    return min(x, 0.0) if deep > r.p[2] else min(x, x * (1.0 - deep / r.p[2]))


@acts(
    RATE,
    "rate_limit",
    strength="reference_over_limit",
    others={"sharpness": (6.0, 14.0), "reference_speed": {HPV41: 500.0, SP08: 2000.0}},
    largest={HPV41: 12.0, SP08: 25.0},
    shared=(Shared("limit", "%/s", lambda p: p[2] / p[0]),),
)
def rate_limit_pilot(x, a, b, r):
    """Pilot oil is limited: the spool's speed runs into it softly, y = x/(1 + |x/R|^p)^(1/p).

    The strength is a reference speed over the limit R.
    """
    share, power, reference = r.p[0], r.p[1], r.p[2]
    return x / (1.0 + abs(share * x / reference) ** power) ** (1.0 / power)


@acts(
    RATE,
    "rate_limit",
    strength="reference_over_limit",
    others={"full_current_a": (5.0, 7.0), "fall": (0.35, 0.6)},
    largest={EFC: 40.0},
)
def rate_limit_voltage(x, a, b, r):
    """The coil's current can rise only as fast as what is left of the supply voltage allows, and falls faster."""
    share, full_current, fall = r.p[0], r.p[1], r.p[2]
    if share <= 0.0:
        return x
    rise = 30.0 / share * max(0.05, 1.0 - a / full_current)
    drop = 30.0 / share * (fall + a / full_current)
    limit = rise if x > 0.0 else drop
    return x / (1.0 + abs(x / limit) ** 10.0) ** 0.1


@acts(
    VISCOSITY,
    "asymmetry",
    strength="more_drag_backwards",
    others={"transition": (0.005, 0.03)},
    largest={AXIS: 2.0},
    full_sigma=ADDS_UP,
)
def uneven_drag(x, a, b, r):
    """A wiper of the guide that is pushed into its groove one way and drags along the other, smoothly changing over."""
    return x * (1.0 + r.p[0] * 0.5 * (1.0 - np.tanh(b / r.p[1])))


@acts(
    VISCOSITY,
    "viscosity_ramp",
    listed=False,
    strength="log_of_ratio_at_start",
    others={"time_to_normal_s": (30.0, 60.0)},
    largest={HPV41: 1.5, EFC: 1.5, AXIS: 0.7},
)
def odd_viscosity_ramp(x, a, b, r):
    """The oil warms up during the recording, so that damping and pilot change with time."""
    return x * np.exp(r.p[0] * (1.0 - max(0.0, r.t) / r.p[1]))


@acts(
    FORCE,
    "cubic_spring",
    listed=False,
    strength="strength",
    others={"reach": {HPV41: 100.0, SP08: 100.0, AXIS: 0.1}, "force_at_reach": 100.0},
    largest={HPV41: 1.0, SP08: 2.0, AXIS: 1.0},
    full_sigma=ADDS_UP,
)
def odd_cubic_spring(x, a, b, r):
    """A centring spring that stiffens with the cube of the stroke."""
    return x - r.p[0] * r.p[2] * (a / r.p[1]) ** 3.0


@acts(
    FORCE,
    "knocked_spool",
    listed=False,
    strength="size",
    others={"every_s": (1.0, 3.0), "lasting_s": (0.02, 0.06)},
    largest={HPV41: 300.0, EFC: 3.0, SP08: 600.0},
    predictable=False,
)
def odd_knocked_spool(x, a, b, r):
    """Something knocks against the moving part now and then."""
    size, every_s, lasting_s = r.p[0], r.p[1], r.p[2]
    if r.t < 0.0:
        return x
    count = np.floor(r.t / every_s)
    since = r.t - count * every_s - 0.8 * every_s * chance(r.p[KEY] + 211.0, count)
    if since < 0.0 or since > lasting_s or chance(r.p[KEY] + 223.0, count) > 0.7:
        return x
    direction = 1.0 if chance(r.p[KEY] + 227.0, count) > 0.5 else -1.0
    return x + direction * size * np.sin(np.pi * since / lasting_s)
