"""What a bench drives for a command: the nearest level of its converter, and the mean of its dither."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from hil.arrays import ROUNDING
from hil.identification.preparation.criteria import CRITERIA
from hil.record.recording import Array, Recording

PHASES = 8  # of a dither, whose own is not known: two for what is the same at any, eight for its second harmonic
FINER = 2  # so much finer than its command is a dither driven: held over a whole sample, it would be cut off too little
_STOOD_S = 1.0  # longer than the coil of a valve remembers, L/R being 0.06 s at most in those that ship


def as_driven(recording: Recording) -> Recording:
    """The recording with the applied inputs in place of the commanded ones, where its header knows the outputs.

    A command is kept as it was asked for. A plant that integrates sees the converter's rounding of it, and any plant
    sees that a current drive neither pulls nor exceeds itself: at the end of its range half of a dither is missing. The
    phase of a dither is not known; its mean over a period is what is taken.
    """
    outputs = _outputs(recording)
    channels, own = dict(recording.channels), dict(recording.own)
    for name, how in outputs.items():
        channels[name] = replace(channels[name], values=_applied_input(channels[name].values, how))
        if name in own:
            own[name] = replace(own[name], values=_applied_input(own[name].values, how))
    return replace(recording, channels=channels, own=own)


def with_dither(recording: Recording) -> tuple[Recording, ...]:
    """The same as `as_driven` with the dither itself, at `PHASES` even phases, on a grid `FINER` times as fine.

    The first sample is left at the mean. Empty where nothing says what the dither is, or where the samples lie too far
    apart to carry it.
    """
    outputs = {name: how for name, how in _outputs(recording).items() if _is_carried(how, recording)}
    if not outputs or recording.own:
        return ()
    recording = _finer(recording)
    mean = as_driven(recording)
    return tuple(_waved(recording, mean, outputs, 2.0 * math.pi * k / PHASES) for k in range(PHASES))


def stood_before(recording: Recording) -> Recording:
    """The recording with a second before it in which everything stands as in its first sample.

    A coil that rectifies a dither has long settled on more current than the mean of the dither makes.
    """
    count = math.ceil(_STOOD_S / recording.interval_s)
    time_s = recording.time_s[0] - recording.interval_s * np.arange(count, 0, -1)
    channels = {
        name: replace(c, values=np.concatenate((np.full(count, c.values[0]), c.values)))
        for name, c in recording.channels.items()
    }
    return replace(recording, time_s=np.concatenate((time_s, recording.time_s)), channels=channels)


def _finer(recording: Recording) -> Recording:
    time_s = recording.time_s[0] + recording.interval_s / FINER * np.arange(FINER * len(recording))
    held = {name: replace(c, values=np.repeat(c.values, FINER)) for name, c in recording.channels.items()}
    return replace(recording, time_s=time_s, channels=held)


def _waved(recording: Recording, mean: Recording, outputs: Mapping[str, Mapping[str, Any]], phase: float) -> Recording:
    channels = dict(mean.channels)
    for name, how in outputs.items():
        wave = np.sin(2.0 * math.pi * float(how["dither_hz"]) * recording.time_s + phase)
        values = _applied_input(recording.channels[name].values, how, wave)
        values[0] = channels[name].values[0]
        channels[name] = replace(channels[name], values=values)
    return replace(mean, channels=channels)


def _outputs(recording: Recording) -> dict[str, Mapping[str, Any]]:
    by_name = recording.meta.get("driven")
    return {n: how for n, how in by_name.items() if n in recording.channels} if isinstance(by_name, Mapping) else {}


def _is_carried(how: Mapping[str, Any], recording: Recording) -> bool:
    if not float(how.get("dither_amplitude", 0.0)) > 0.0 or "dither_hz" not in how or not recording.is_even():
        return False
    return CRITERIA.carried * float(how["dither_hz"]) * recording.interval_s <= 1.0 + ROUNDING


def _applied_input(command: Array, how: Mapping[str, Any], wave: Array | None = None) -> Array:
    low, high = float(how.get("low", -math.inf)), float(how.get("high", math.inf))
    dither, step = float(how.get("dither_amplitude", 0.0)), float(how.get("step", 0.0))
    exact = not step > 0.0 or not math.isfinite(low) or high <= low  # versions before had a digital line end at its low
    rounded = command if exact else np.clip(low + step * np.rint((command - low) / step), low, high)
    if dither <= 0.0:
        return rounded
    if wave is not None:
        return np.clip(rounded + dither * wave, low, high)
    return rounded + dither * (_missing((low - rounded) / dither) - _missing((rounded - high) / dither))


def _missing(end: Array) -> Array:
    """Mean of what a sine of amplitude 1 lacks below an end of its range, ∫ max(end − sin, 0) over a period."""
    inside = np.clip(end, -1.0, 1.0)
    return (inside * (math.pi / 2.0 + np.arcsin(inside)) + np.sqrt(1.0 - inside**2)) / math.pi
