"""Laws of the command on its way to the moving part: amplifier, coil, magnet."""

from __future__ import annotations

import numpy as np
from numba import njit

from ..delay_line import between, remember
from ..law import ADDS_UP, AXIS, EFC, HPV41, SP08, Shared, Times, acts
from ..slots import DRIVE

_DELAY = {"largest": {HPV41: 0.12, EFC: 0.06, SP08: 0.12}, "counterparts": ("dead_time",)}
_HELD = {HPV41: 1.0, EFC: 1.0, SP08: 0.0, AXIS: 1.0}


@acts(
    DRIVE,
    "dead_time",
    strength="mean_delay_s",
    others={"mixed_share": (0.1, 0.3), "held": _HELD},
    shared=(Shared("mean delay beyond the baseline's", "s", lambda p: p[0]),),
    **_DELAY,
)
def dead_time_line(x, a, b, r):
    """A transport line: most of the dead time pure, the rest spread over four small mixing volumes."""
    if r.m[0] == 0.0 and r.first == 1:
        r.m[2] = x
    remember(r, x)
    mixing = r.p[0] * r.p[1] / 4.0
    if mixing < r.h:
        mixing = 0.0
    since = 0.0 if r.p[2] == 1.0 else r.t - r.m[1]
    value = between(r, (r.p[0] - 4.0 * mixing - since) / r.h, x)
    if mixing > 0.0:
        for i in range(4):
            r.dz[i] = (value - r.m[2] - r.z[i]) / mixing
            value = r.m[2] + r.z[i]
    return value


@acts(
    DRIVE,
    "dead_time",
    strength="dead_time_s",
    others={"held": _HELD},
    shared=(Shared("dead time beyond the baseline's", "s", lambda p: p[0]),),
    **_DELAY | {"largest": {**_DELAY["largest"], AXIS: 0.1}},
)
def dead_time_pure(x, a, b, r):
    """A further dead time, as a line of remembered values.

    A held command is delayed by taking its mean over the delayed step, a continuous one by interpolation.
    """
    remember(r, x)
    since = 0.0 if r.p[1] == 1.0 else r.t - r.m[1]
    return between(r, (r.p[0] - since) / r.h, x)


@acts(
    DRIVE,
    "asymmetry",
    strength="loss_on_negative_side",
    others={"transition": (0.5, 3.0)},
    largest={AXIS: 0.3},
    full_sigma=ADDS_UP,
)
def asymmetry_drive(x, a, b, r):
    """A motor amplifier whose two half bridges differ in gain."""
    return x * (1.0 - r.p[0] * 0.5 * (1.0 - np.tanh(x / r.p[1])))


@acts(
    DRIVE,
    "coil_heating",
    strength="force_loss",
    others={"winding_s": (4.0, 12.0), "iron_s": (40.0, 120.0), "full": {HPV41: 100.0, EFC: 2.0, SP08: 100.0}},
    largest={HPV41: 1.0, EFC: 0.5, SP08: 6.0},
)
def coil_heating_two_mass(x, a, b, r):
    """Copper heats the iron round it: two masses, the force falls with the winding's temperature.

    τ1·θ̇1 = i² − (θ1 − θ2), τ2·θ̇2 = (θ1 − θ2) − θ2, i = x/(1 + ½·s·θ1); each recording starts cold.
    """
    loss, winding_s, iron_s, full = r.p[0], r.p[1], r.p[2], r.p[3]
    force = x / (1.0 + 0.5 * loss * r.z[0])
    if r.t > 0.0:
        share = force / full
        r.dz[0] = (share * share - (r.z[0] - r.z[1])) / winding_s
        r.dz[1] = (r.z[0] - 2.0 * r.z[1]) / iron_s
    return force


@acts(
    DRIVE,
    "coil_lag",
    strength="lag_s",
    others={"eddy_share": (0.0, 0.12), "full": {HPV41: 100.0, EFC: 2.0, SP08: 100.0, AXIS: 200.0}},
    largest={HPV41: 0.15, EFC: 0.1, SP08: 0.15, AXIS: 0.1},
    counterparts=("coil_lag",),
)
def coil_lag_eddy(x, a, b, r):
    """Coil inductance that falls as the iron saturates, with an eddy-current branch that passes part at once.

    ẏ = (x − y)/τ(y), τ = s/(1 + ½·(y/Y)²), output (1 − e)·y + e·x
    """
    lag, eddy, full = r.p[0], r.p[1], r.p[2]
    if r.m[0] == 0.0 and r.first == 1:
        r.m[0], r.m[1] = 1.0, x
    if lag < 2.0 * r.h:
        return x
    current = r.m[1] + r.z[0]
    r.dz[0] = (x - current) * (1.0 + 0.5 * (current / full) ** 2) / lag
    return (1.0 - eddy) * current + eddy * x


_MIDDLE = {HPV41: 0.0, EFC: 1.5, SP08: 0.0}
_SHAPE = {HPV41: 40.0, EFC: 0.25, SP08: 40.0}
_REACH = {HPV41: 120.0, EFC: 0.7, SP08: 110.0}
_LOOP = {"strength": "strength", "largest": {HPV41: 200.0, EFC: 1.2, SP08: 200.0}}


@njit(inline="always")
def _langevin(h):
    return h / 3.0 if abs(h) < 1e-3 else 1.0 / np.tanh(h) - 1.0 / h


@acts(
    DRIVE,
    "hysteresis",
    others={"middle": _MIDDLE, "shape": Times(_SHAPE, 0.9, 1.3), "pinning": Times(_SHAPE, 0.08, 0.15)},
    **_LOOP,
)
def hysteresis_jiles_atherton(x, a, b, r):
    """Magnetic hysteresis after Jiles and Atherton (J. Magn. Magn. Mater. 61, 1986), without mean-field coupling.

    dM/dH = (M_an(H) − M)/(k·sign dH), M_an = coth(h) − 1/h with h = H/a; y = x + s·(M − M_an).
    """
    strength, middle, shape, pinning = r.p[0], r.p[1], r.p[2], r.p[3]
    if r.first == 1:
        if r.m[0] == 0.0:
            r.m[0], r.m[1], r.m[2] = 1.0, x, _langevin((x - middle) / shape)
        change = x - r.m[1]
        if change != 0.0:
            steps = 1 + int(abs(change) / (0.1 * pinning))
            part = change / steps
            for i in range(steps):
                field = r.m[1] + (i + 0.5) * part
                lost = np.exp(-abs(part) / pinning)
                r.m[2] = _langevin((field - middle) / shape) * (1.0 - lost) + r.m[2] * lost
            r.m[1] = x
    return x + strength * (r.m[2] - _langevin((r.m[1] - middle) / shape))


CENTRES, WIDTHS = 60, 16


@acts(
    DRIVE,
    "hysteresis",
    others={"middle": _MIDDLE, "reach": Times(_REACH, 0.9, 1.2), "half_width": Times(_REACH, 0.02, 0.05)},
    **_LOOP,
)
def hysteresis_preisach(x, a, b, r):
    """Magnetic hysteresis as a stack of relays (Preisach 1935): 60 centres × 16 widths.

    y = x + s·(mean of the relays − mean of the same relays without width): the loop alone, no static change of gain.
    """
    strength, middle, reach, width = r.p[0], r.p[1], r.p[2], r.p[3]
    first_time = r.m[0] == 0.0
    if r.first == 1 and (first_time or abs(x - r.m[1]) > 1e-4 * reach):
        r.m[0], r.m[1] = 1.0, x
        total = 0.0
        for i in range(CENTRES):
            share = (i + 0.5) / CENTRES
            centre = middle + reach * (1.5 * share - 0.75 + (share - 0.5) ** 3)
            for j in range(WIDTHS):
                half = width * (0.3 + 1.4 * j / (WIDTHS - 1))
                k = 4 + i * WIDTHS + j
                if first_time:
                    r.m[k] = 1.0 if x > centre else -1.0
                elif x > centre + half:
                    r.m[k] = 1.0
                elif x < centre - half:
                    r.m[k] = -1.0
                total += r.m[k] - (1.0 if x > centre else -1.0)
        r.m[2] = total / (CENTRES * WIDTHS)
    return x + strength * r.m[2]


_SPAN = {HPV41: 100.0, EFC: 2.1, SP08: 100.0, AXIS: 200.0}
_LIMITED = {
    "strength": "span_over_limit",
    "largest": {HPV41: 2.0, EFC: 1.35, SP08: 3.0, AXIS: 6.0},
    "full_sigma": ADDS_UP,
}


@acts(DRIVE, "saturation", others={"knee": (0.9, 0.97), "span": _SPAN}, **_LIMITED)
def saturation_magnetic(x, a, b, r):
    """Magnetic saturation: linear up to the knee of the B–H curve, then exponentially towards the limit L.

    The strength is the drive's span over the limit.
    """
    share, knee, span = r.p[0], r.p[1], r.p[2]
    if share <= 0.0:
        return x
    limit = span / share
    beyond = abs(x) - knee * limit
    if beyond <= 0.0:
        return x
    rest = (1.0 - knee) * limit
    level = knee * limit + rest * (1.0 - np.exp(-beyond / rest))
    return level if x > 0.0 else -level


@acts(DRIVE, "saturation", others={"sharpness": (10.0, 24.0), "span": _SPAN}, **_LIMITED)
def saturation_norm(x, a, b, r):
    """Saturation with a rounded knee: y = x/(1 + |x/L|^p)^(1/p). The strength is the drive's span over the limit L."""
    share, power, span = r.p[0], r.p[1], r.p[2]
    return x / (1.0 + abs(share * x / span) ** power) ** (1.0 / power)


@acts(
    DRIVE,
    "switching_filter",
    listed=False,
    strength="lag_s",
    others={"every_s": (1.5, 6.0)},
    largest={HPV41: 0.5, EFC: 0.3, SP08: 0.6},
)
def odd_switching_filter(x, a, b, r):
    """A command filter that somebody's program switches on and off every few seconds."""
    lag, every_s = r.p[0], r.p[1]
    if lag < 2.0 * r.h:
        return x
    filtering = r.t > 0.0 and int(r.t / every_s) % 2 == 1
    if filtering:
        r.dz[0] = (x - r.z[0]) / lag
        return r.z[0]
    r.dz[0] = (x - r.z[0]) / max(0.002, 4.0 * r.h)  # off: keeps up, so that it switches without a jump
    return x
