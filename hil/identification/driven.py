"""What a bench drives when it is told a command: the nearest level of its converter, and the mean of its dither."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from hil.record.recording import Array, Recording


def as_driven(recording: Recording) -> Recording:
    """The recording with the commands that acted in place of those that were told, where its header knows the outputs.

    A command is kept as it was asked for. A plant that integrates sees the converter's rounding of it, and any plant
    sees that a current drive neither pulls nor exceeds itself: at the end of its range half of a dither is missing. The
    phase of a dither is not known; its mean over a period is what is taken.
    """
    told = recording.meta.get("driven")
    if not isinstance(told, Mapping):
        return recording
    outputs = {name: how for name, how in told.items() if name in recording.channels}
    channels = {name: replace(c, values=_acted(c.values, outputs[name])) for name, c in recording.channels.items()
                if name in outputs}  # fmt: skip
    own = {name: replace(taken, values=_acted(taken.values, outputs[name])) for name, taken in recording.own.items()
           if name in outputs}  # fmt: skip
    return replace(recording, channels={**recording.channels, **channels}, own={**recording.own, **own})


def _acted(command: Array, how: Mapping[str, Any]) -> Array:
    low, high = float(how.get("low", -math.inf)), float(how.get("high", math.inf))
    step, dither = float(how.get("step", 0.0)), float(how.get("dither_amplitude", 0.0))
    exact = not step > 0.0 or not math.isfinite(low)
    rounded = command if exact else np.clip(low + step * np.rint((command - low) / step), low, high)
    if dither <= 0.0:
        return rounded
    acted: Array = rounded + dither * (_missing((low - rounded) / dither) - _missing((rounded - high) / dither))
    return acted


def _missing(end: Array) -> Array:
    """Mean of what a sine of amplitude 1 lacks below an end of its range, ∫ max(end − sin, 0) over a period."""
    inside = np.clip(end, -1.0, 1.0)
    mean: Array = (inside * (math.pi / 2.0 + np.arcsin(inside)) + np.sqrt(1.0 - inside**2)) / math.pi
    return mean
