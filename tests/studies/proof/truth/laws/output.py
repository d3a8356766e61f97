"""Laws of the output and of the transducer that reads it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..chance import chance
from ..delay_line import amend, between, remember
from ..law import AXIS, EFC, HPV41, LAWS, SP08, Shared, Times, acts
from ..memory import KEY
from ..slots import DRIVE, OUTPUT, READING, SENSOR


@acts(
    OUTPUT,
    "resonance",
    strength="reflection",
    others={"return_time_s": {HPV41: (0.03, 0.08), EFC: (0.015, 0.04)}, "loss_s": (0.003, 0.006)},
    largest={HPV41: 0.9, EFC: 0.9},
)
def resonance_line(x, a, b, r):
    """A line with a reflecting end: w(t) = (1 + ρ)·x(t) − ρ·w(t − 2T), each reflection rounded by wall losses."""
    reflection, travel_s, loss_s = r.p[0], r.p[1], r.p[2]
    if r.m[0] == 0.0 and r.first == 1:
        r.m[2] = x
    remember(r, x)  # keeps the place of this step's wave, which is overwritten below; what is read is older
    returned = between(r, (travel_s - (r.t - r.m[1])) / r.h, x)
    r.dz[0] = (returned - r.m[2] - r.z[0]) / loss_s
    wave = (1.0 + reflection) * x - reflection * (r.m[2] + r.z[0])
    if r.first == 1:
        amend(r, wave)
    return wave


@acts(
    OUTPUT,
    "resonance",
    strength="share",
    others={
        "frequency_rad_s": {HPV41: (25.0, 70.0), EFC: (70.0, 160.0), SP08: (15.0, 50.0), AXIS: (40.0, 90.0)},
        "damping": (0.03, 0.15),
    },
    largest={HPV41: 1.0, EFC: 1.0, SP08: 1.0, AXIS: 1.0},
    shared=(Shared("frequency", "rad/s", lambda p: p[1]), Shared("frequency", "Hz", lambda p: p[1] / (2.0 * np.pi))),
)
def resonance_mode(x, a, b, r):
    """A lightly damped mode that takes part in the output: y = x + s·(η − x), η̈ + 2ζω·η̇ + ω²·η = ω²·x."""
    share, frequency, damping = r.p[0], r.p[1], r.p[2]
    if r.m[0] == 0.0 and r.first == 1:
        r.m[0], r.m[1] = 1.0, x
    r.dz[0] = r.z[1]
    mode = r.m[1] + r.z[0]
    r.dz[1] = frequency * frequency * (x - mode) - 2.0 * damping * frequency * r.z[1]
    return x + share * (mode - x)


@acts(
    {HPV41: OUTPUT, EFC: OUTPUT, SP08: OUTPUT, AXIS: DRIVE},
    "periodic_disturbance",
    strength="size",
    others={
        "frequency_hz": {HPV41: (3.0, 30.0), EFC: (5.0, 40.0), SP08: (0.7, 6.0), AXIS: (0.4, 3.0)},
        "second_harmonic": (0.0, 0.4),
        "third_harmonic": (0.0, 0.2),
        "phase_rad": (0.0, 6.28),
        "locked": 1.0,
    },
    largest={HPV41: 10.0, EFC: 20.0, SP08: 60.0, AXIS: 60.0},
    shared=(Shared("frequency", "Hz", lambda p: p[1]), Shared("frequency", "rad/s", lambda p: p[1] * 2.0 * np.pi)),
)
def ripple(x, a, b, r):
    """Pump ripple or hum with two harmonics; locked to the start of the recording, or at a chance phase in each."""
    size, frequency, second, third, phase, locked = r.p[0], r.p[1], r.p[2], r.p[3], r.p[4], r.p[5]
    angle = 2.0 * np.pi * frequency * r.t + phase
    if locked == 0.0:
        angle += 2.0 * np.pi * chance(frequency, r.p[KEY])
    return x + size * (np.sin(angle) + second * np.sin(2.0 * angle + 0.7) + third * np.sin(3.0 * angle + 2.1))


# at a chance phase in each recording: it can be named, but not predicted
LAWS["ripple_unlocked"] = replace(LAWS["ripple"], others={**LAWS["ripple"].others, "locked": 0.0}, predictable=False)


@acts(
    READING,
    "sensor_drift",
    strength="size",
    others={"time_s": (5.0, 40.0), "random_walk_share": (0.0, 0.03)},
    largest={HPV41: 10.0, EFC: 20.0},
)
def sensor_drift_warm_up(x, a, b, r):
    """A sensor that warms up: exponential, with a little random walk on top; begins anew with each recording."""
    size, time_s, walk = r.p[0], r.p[1], r.p[2]
    if r.t <= 0.0:
        return x
    second = np.floor(r.t)
    if r.first == 1 and second >= r.m[0]:
        r.m[0] = second + 1.0
        r.m[1] = r.m[2]
        r.m[2] += chance(r.p[KEY] + 17.0, second) - 0.5
    wander = r.m[1] + (r.m[2] - r.m[1]) * (r.t - second)
    return x + size * (1.0 - np.exp(-r.t / time_s) + walk * wander)


@acts(
    SENSOR,
    "sensor_lag",
    strength="lag_s",
    others={"damping": (0.8, 1.2)},
    largest={EFC: 0.08, SP08: 0.15, AXIS: 0.1},
    counterparts=("sensor_lag",),
    shared=(Shared("lag", "s", lambda p: p[0]),),
)
def sensor_lag_second_order(x, a, b, r):
    """A transducer with inertia: second order, its lag 2ζ/ω as strength."""
    lag, damping = r.p[0], r.p[1]
    if r.m[0] == 0.0 and r.first == 1:
        r.m[0], r.m[1] = 1.0, x
    if lag < 4.0 * r.h:
        return x
    frequency = 2.0 * damping / lag
    r.dz[0] = r.z[1]
    r.dz[1] = frequency * frequency * (x - r.m[1] - r.z[0]) - 2.0 * damping * frequency * r.z[1]
    return r.m[1] + r.z[0]


@acts(
    SENSOR,
    "sensor_lag",
    strength="lag_at_full_flow_s",
    others={"rate_at_rest": (0.4, 0.7), "slower_down": (1.1, 1.5), "full_flow": 70.0},
    largest={HPV41: 0.3},
    counterparts=("meter_lag",),
)
def sensor_lag_turbine(x, a, b, r):
    """Turbine flow meter: the rotor speeds up in proportion to flow times slip, slower at small flow.

    ẏ = (x − y)·(κ + |y|/Q)/τ, and faster up than down.
    """
    lag, floor, slower_down, full = r.p[0], r.p[1], r.p[2], r.p[3]
    if r.m[0] == 0.0 and r.first == 1:
        r.m[0], r.m[1] = 1.0, x
    if lag < 2.0 * r.h:
        return x
    y = r.m[1] + r.z[0]
    rate = (floor + (1.0 - floor) * min(1.0, abs(y) / full)) / lag
    if (x - y) * y < 0.0:
        rate /= slower_down
    r.dz[0] = (x - y) * rate
    return y


@acts(
    READING,
    "sensor_offset",
    strength="offset",
    largest={HPV41: 10.0},
    shared=(Shared("offset", "l/min", lambda p: p[0]),),
)
def sensor_offset_zero(x, a, b, r):
    """The zero of the flow meter has shifted."""
    return x + r.p[0]


@acts(
    OUTPUT,
    "chatter",
    listed=False,
    strength="size",
    others={
        "place": {HPV41: (35.0, 65.0), EFC: (1.5, 1.66)},
        "width": Times({HPV41: 10.0, EFC: 0.04}, 0.8, 1.3),
        "frequency_hz": (8.0, 30.0),
    },
    largest={HPV41: 20.0, EFC: 40.0},
)
def odd_chatter(x, a, b, r):
    """The valve chatters, but only while it is open by a certain amount."""
    size, place, width, frequency = r.p[0], r.p[1], r.p[2], r.p[3]
    return x + size * np.exp(-(((a - place) / width) ** 2)) * np.sin(2.0 * np.pi * frequency * r.t)


@acts(
    READING,
    "feedthrough",
    listed=False,
    strength="gain",
    others={"middle": {HPV41: 0.0, EFC: 1.5}},
    largest={HPV41: 0.3, EFC: 80.0},
)
def odd_feedthrough(x, a, b, r):
    """The command leaks electrically into the sensor's cable."""
    return x + r.p[0] * (b - r.p[1])


@acts(
    OUTPUT,
    "gain_modulation",
    listed=False,
    strength="depth",
    others={"period_s": (2.0, 15.0), "phase_rad": (0.0, 6.28)},
    largest={HPV41: 0.6, EFC: 0.4, SP08: 0.95},
)
def odd_gain_modulation(x, a, b, r):
    """The gain swings slowly to and fro, as with a supply regulator that hunts."""
    return x * (1.0 + r.p[0] * np.sin(2.0 * np.pi * r.t / r.p[1] + r.p[2]))


@acts(
    SENSOR,
    "sensor_memory",
    listed=False,
    strength="gain",
    others={"time_s": (1.0, 5.0), "full": {HPV41: 70.0, EFC: 207.0}},
    largest={HPV41: 0.8, EFC: 0.5},
)
def odd_sensor_memory(x, a, b, r):
    """A transducer whose gain remembers how hard it was driven in the last seconds."""
    gain, time_s, full = r.p[0], r.p[1], r.p[2]
    r.dz[0] = (abs(x) / full - r.z[0]) / time_s
    return x * (1.0 + gain * (r.z[0] - 0.4))
