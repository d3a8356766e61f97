"""Threshold: the least change of command that changes the response by more than three standard uncertainties.

Slow ramps begin at a stop. Their responses, counted from the mean at the stop, are averaged over all ramps and over a
window of command. The window is the shortest in which a valve without friction would show: it moves the response by
three standard uncertainties over half of the window, so that the mean is none of before and after.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hil.identification.steady.characteristic import Read
from hil.identification.steady.criteria import CRITERIA, EFFORT
from hil.identification.uncertainty.fit import rms
from hil.record.recording import Array
from hil.signals.crossing import crossing, first_crossing
from hil.signals.interval import UNIFORM

CLEAR = 3.0  # standard uncertainties that a change must exceed: the definition


@dataclass(frozen=True, slots=True)
class Stop:
    """Mean of a response where the command stands, its standard uncertainty from noise, and when, in s."""

    response: float
    std: float
    time_s: float


@dataclass(frozen=True, slots=True)
class Ramp:
    """A slow ramp from one stop to another.

    Attributes:
        change: of the command since the stop, from 0 on, shape (n,). `time_s`: of the samples.
        response: shape (n,), as read.
        before, after: the stops at its ends.
        sense: 1 where the response rises along it, −1 where it falls.
    """

    change: Array
    time_s: Array
    response: Array
    before: Stop
    after: Stop
    sense: float


@dataclass(frozen=True, slots=True)
class Reading:
    """What limits a reading: standard deviation of a mean of one sample with its colour, and what rounding leaves."""

    noise_std: float
    rounding_std: float


@dataclass(frozen=True, slots=True)
class Threshold:
    """A threshold in the unit of the command.

    Attributes:
        value: the change of command; infinite where the response has not changed by so much at the end of the ramps.
        ideal: what a valve of this gain without friction would need for the same change of response.
        counted: the change of response that counts.
        command, moved: the averaged change of response over the change of command, lag taken out.
    """

    value: Read
    ideal: float
    counted: float
    command: Array
    moved: Array


def gain_and_lag(ramps: Sequence[Ramp], drift: Read) -> tuple[Read, Read]:
    """(response per command, delay as command) of ramps along which the response follows: from their last third.

    What the response still makes up after the command has stopped is its delay.
    """
    gains, delays = [], []
    for ramp in ramps:
        late = ramp.change >= CRITERIA.late * ramp.change[-1]
        moved = _moved(ramp, drift[0])
        slope, level = np.polyfit(ramp.change[late] - ramp.change[-1], moved[late], 1)
        stood = ramp.sense * (ramp.after.response - ramp.before.response - drift[0] * _between_s(ramp))
        gains.append(float(slope))
        delays.append((stood - float(level)) / float(slope) if slope else math.nan)
    return _mean(gains), _mean(delays)


def threshold_of(ramps: Sequence[Ramp], reading: Reading, drift: Read, gain: float, lag: Read) -> Threshold | None:
    """The threshold that ramps of one kind show together; None where noise hides the whole reach.

    Args:
        ramps: all of one reach and speed.
        reading: what limits it.
        drift: of the reading, per s.
        gain: response per command where it follows, above 0.
        lag: delay of the response, as command at the speed of the ramps.
    """
    reach = float(ramps[0].change[-1])
    per_command = len(ramps) * len(ramps[0].change) / reach
    steady = math.hypot(
        math.sqrt(sum(ramp.before.std**2 for ramp in ramps)) / len(ramps), reading.rounding_std,
        drift[1] * _between_s(ramps[0]),
    )  # fmt: skip

    def std_of(window: float) -> float:
        return math.hypot(reading.noise_std / math.sqrt(max(per_command * window, 1.0)), steady)

    windows = np.geomspace(1e-4, 0.5, 400) * reach
    enough = np.array([CLEAR * std_of(window) <= gain * window / 2.0 for window in windows])
    if not enough.any():
        return None
    window = float(windows[np.argmax(enough)])
    each, places = _averaged(ramps, window, drift[0])
    pooled = each.mean(axis=0)
    std = std_of(window)
    counted = CLEAR * std
    held = _crossing(places, pooled, counted, std)
    if math.isinf(held):
        return Threshold((math.inf, 0.0), counted / gain, counted, places - lag[0], pooled)
    at = int(np.searchsorted(places, held).clip(0, len(places) - 1))
    scatter = float(np.std(each[:, at], ddof=1)) / math.sqrt(len(ramps)) if len(ramps) > 1 else 0.0
    unsure = max(std, scatter)
    low, high = (_crossing(places, pooled, counted + side * unsure, std) for side in (-1.0, 1.0))
    spread = (min(high, reach) - low) / 2.0
    late, late_std = _delay_at(counted / gain, lag[0])
    value_std = math.hypot(spread, late_std, lag[1], UNIFORM * window / EFFORT.places)
    return Threshold((held - late, value_std), counted / gain, counted, places - lag[0], pooled)


def drift_of(stops: Sequence[Sequence[Stop]]) -> Read:
    """Drift per s of a reading: what stops that are come to in one and the same way differ by, over time."""
    late = np.concatenate([np.array([s.time_s for s in same]) - np.mean([s.time_s for s in same]) for same in stops])
    off = np.concatenate([np.array([s.response for s in same]) - np.mean([s.response for s in same]) for same in stops])
    power, free = float(late @ late), len(late) - len(stops) - 1
    rate = float(late @ off) / power
    left = off - rate * late
    noise = rms(np.array([stop.std for same in stops for stop in same]))
    return rate, max(noise, math.sqrt(float(left @ left) / max(free, 1))) / math.sqrt(power)


def _moved(ramp: Ramp, drift_per_s: float) -> Array:
    """Change of the response since the stop, in the direction that it is to go, without drift."""
    return ramp.sense * (ramp.response - ramp.before.response - drift_per_s * (ramp.time_s - ramp.before.time_s))


def _between_s(ramp: Ramp) -> float:
    return ramp.after.time_s - ramp.before.time_s


def _mean(values: Sequence[float]) -> Read:
    return float(np.mean(values)), float(np.std(values, ddof=1)) / math.sqrt(len(values))


def _averaged(ramps: Sequence[Ramp], window: float, drift_per_s: float) -> tuple[Array, Array]:
    """(means over a window for each ramp, shape (ramps, places); the middles of the windows)."""
    reach = float(ramps[0].change[-1])
    places = np.arange(window / 2.0, reach - window / 2.0, window / EFFORT.places)
    rows = []
    for ramp in ramps:
        sums = np.concatenate(([0.0], np.cumsum(_moved(ramp, drift_per_s))))
        first, last = (np.searchsorted(ramp.change, places + side * window / 2.0) for side in (-1.0, 1.0))
        last = np.maximum(last, first + 1)
        rows.append((sums[last] - sums[first]) / (last - first))
    return np.array(rows), places


def _crossing(places: Array, values: Array, level: float, std: float) -> float:
    """Where values pass a level for good; infinite where they are below it at the end.

    Noise makes them pass it several times. The middle of the first and the last is taken, of those since the values
    were so far below that noise alone does not pass it.
    """
    below = np.flatnonzero(values < level)
    if not len(below):
        return 0.0
    last = int(below[-1])
    if last == len(places) - 1:
        return math.inf
    far = np.flatnonzero(values[: last + 1] < level - 2.0 * std)
    since = int(far[-1]) if len(far) else 0
    first = first_crossing(places[since:], values[since:], level)
    for_good = crossing(places, values, level, last, last + 1)
    return for_good if first is None else (first + for_good) / 2.0


def _delay_at(moved: float, lag: float) -> tuple[float, float]:
    """How late a response is that has moved by so much command, all as command.

    By the whole lag if that is a dead time; a first order is not so far behind yet. The middle of both.
    """
    if not lag > 0.0:
        return 0.0, 0.0
    short = lag * math.exp(-(moved + lag) / lag)
    return lag - short / 2.0, UNIFORM * short
