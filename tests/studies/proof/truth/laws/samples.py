"""Laws of samples on their way to the valve and to the recording: links, converters, clocks."""

from __future__ import annotations

import numpy as np

from ..law import AFTER, AXIS, BEFORE, EFC, HPV41, SP08, Shared, acts
from ..spells import spells

_LOST = {"strength": "lasting_s", "others": {"every_s": (1.5, 4.0)}, "predictable": False}
_COARSE = {
    "strength": "step",
    "largest": {HPV41: 20.0, EFC: 40.0, SP08: 4.0, AXIS: 0.05},
    "predictable": False,
    "shared": tuple(Shared("step", unit, lambda p: p[0]) for unit in ("l/min", "psi", "mm", "m")),
}


def _held(values, sample_s, p, rng):
    held = values.copy()
    for gap in spells(len(values), sample_s, p[1], p[0], rng):
        held[gap] = held[gap.start - 1]
    return held


@acts(BEFORE, "dropout", largest={HPV41: 1.5, EFC: 1.0, SP08: 1.5}, **_LOST)
def dropout_held_command(values, sample_s, p, rng):
    """Commands are lost on their way: the valve stays on the last one while the recording shows the new."""
    return _held(values, sample_s, p, rng)


@acts(AFTER, "dropout", largest={HPV41: 1.5, EFC: 1.0, SP08: 1.5, AXIS: 1.0}, **_LOST)
def dropout_stale_output(values, sample_s, p, rng):
    """The link drops out: the last value is recorded again and again until it is back."""
    return _held(values, sample_s, p, rng)


@acts(AFTER, "quantisation", **_COARSE)
def quantisation_mid_tread(values, sample_s, p, rng):
    """A coarse converter that rounds to the nearest level."""
    return values if p[0] <= 0.0 else p[0] * np.round(values / p[0])


@acts(AFTER, "quantisation", **_COARSE)
def quantisation_truncating(values, sample_s, p, rng):
    """A coarse converter that cuts off what is below its level."""
    return values if p[0] <= 0.0 else p[0] * np.floor(values / p[0])


@acts(AFTER, "clock_slip", listed=False, strength="slip", largest={HPV41: 4e-3, EFC: 4e-3, SP08: 8e-3})
def odd_clock_slip(values, sample_s, p, rng):
    """The recorder's clock runs slow, so that its time stamps slip against the command."""
    at = np.arange(len(values), dtype=float)
    return np.interp(at * (1.0 - p[0]), at, values)


def _highest_of_last(values, count):
    padded = np.concatenate([np.full(count, values[0]), values])
    return np.lib.stride_tricks.sliding_window_view(padded, count + 1).max(axis=1)


@acts(BEFORE, "late_when_falling", listed=False, strength="late_s", largest={HPV41: 0.3, EFC: 0.15, SP08: 0.5})
def odd_late_when_falling(values, sample_s, p, rng):
    """Software that passes rising commands at once and falling ones late."""
    samples = p[0] / sample_s
    whole = int(samples)
    share = samples - whole
    return (1.0 - share) * _highest_of_last(values, whole) + share * _highest_of_last(values, whole + 1)


@acts(
    AFTER,
    "loose_connector",
    listed=False,
    strength="signal_lost",
    others={"every_s": (3.0, 8.0), "lasting_s": (0.2, 1.0)},
    largest={HPV41: 0.9, EFC: 0.6, SP08: 0.1},
    predictable=False,
)
def odd_loose_connector(values, sample_s, p, rng):
    """A loose connector divides the sensor's signal for a while, again and again."""
    seen = values.copy()
    for gap in spells(len(values), sample_s, p[1], p[2], rng):
        seen[gap] *= 1.0 - p[0]
    return seen


@acts(BEFORE, "stuck_bit", listed=False, strength="weight_of_bit", largest={HPV41: 12.0, EFC: 0.08, SP08: 8.0})
def odd_stuck_bit(values, sample_s, p, rng):
    """One bit of the command's converter always reads 0."""
    weight = p[0]
    if weight <= 0.0:
        return values
    return values - weight * (np.floor(np.abs(values) / weight) % 2.0) * np.sign(values)
