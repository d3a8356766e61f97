"""What every backend asks before it drives the first sample: rate and range."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from hil.arrays import ROUNDING
from hil.daq.channel import OutputChannel
from hil.daq.contract import Promises, Waveform
from hil.errors import RangeError
from hil.record.recording import Array


def coerced_rate(promises: Promises, asked_hz: float) -> float:
    """The rate that a device with these promises really uses: the nearest whole division of its clock.

    Raises:
        RangeError: not a positive number, or beyond what the device can do.
    """
    if not (math.isfinite(asked_hz) and asked_hz > 0.0):
        raise RangeError(f"sample rate {asked_hz:g} Hz: a positive number is needed")
    if not promises.lowest_rate_hz <= asked_hz <= promises.highest_rate_hz * (1.0 + ROUNDING):
        raise RangeError(
            f"sample rate {asked_hz:g} Hz: the device offers {promises.lowest_rate_hz:g} … "
            f"{promises.highest_rate_hz:.4g} Hz{', as its link was measured' if promises.timing == 'polled' else ''}"
        )
    if promises.clock_hz is None:
        return asked_hz
    fewest = math.ceil(promises.clock_hz / promises.highest_rate_hz - ROUNDING)
    return promises.clock_hz / max(fewest, round(promises.clock_hz / asked_hz))


def check_waveform(waveform: Waveform, outputs: Mapping[str, OutputChannel], promises: Promises) -> None:
    """Raise `RangeError` unless a device with these outputs can play every sample."""
    if not math.isclose(coerced_rate(promises, waveform.rate_hz), waveform.rate_hz, rel_tol=ROUNDING):
        raise RangeError(
            f"sample rate {waveform.rate_hz:g} Hz is none that the device has; ask for its actual rate first"
        )
    for name, values in waveform.outputs.items():
        if name not in outputs:
            raise RangeError(f"no output '{name}'; the device drives: {', '.join(outputs) or 'none'}")
        channel = outputs[name]
        within(values, channel.low, channel.high, name, channel.unit, "the device's ")


def within(values: Array, low: float, high: float, output: str, unit: str, whose: str = "") -> Array:
    """Samples of an output, shape (n,), n ≥ 1, with rounding beyond a range trimmed off.

    Raises:
        RangeError: one is further beyond, or not a number; `whose` range it is says the message.
    """
    if low <= values.min() and values.max() <= high:  # false for NaN
        return values
    rounding = ROUNDING * (high - low)
    inside = (values >= low - rounding) & (values <= high + rounding)  # false for NaN too
    if not inside.all():
        at = int(np.argmin(inside))
        raise RangeError(
            f"output '{output}', sample {at}: {values[at]:.9g} {unit} is outside {whose}{low:g} … {high:g} {unit}"
        )
    return np.clip(values, low, high)


def checked_task(
    waveforms: Iterable[Waveform], outputs: Mapping[str, OutputChannel], promises: Promises
) -> Iterator[Waveform]:
    """The waveforms of one continuous task, each checked when it is asked for.

    Raises:
        RangeError: one cannot be played, or has another rate or other outputs than the first.
    """
    first: Waveform | None = None
    for waveform in waveforms:
        check_waveform(waveform, outputs, promises)
        first = first or waveform
        if waveform.rate_hz != first.rate_hz or set(waveform.outputs) != set(first.outputs):
            raise RangeError(
                f"one task has one rate and one set of outputs; it began with {first.rate_hz:g} Hz and "
                f"{', '.join(first.outputs)}, then came {waveform.rate_hz:g} Hz and {', '.join(waveform.outputs)}"
            )
        yield waveform


def next_or_failure(waveforms: Iterator[Waveform]) -> tuple[Waveform | None, Exception | None]:
    """The next waveform, or why there is none; raised only after what has been read was handed over."""
    try:
        return next(waveforms, None), None
    except Exception as error:
        return None, error
