"""A steady characteristic from a slow sweep, of a command that goes both ways or one way."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hil.errors import InputError
from hil.identification.flow_curve import FlowCurve, Number, flow_curve
from hil.identification.sweep_branches import branches
from hil.record.measurement import COVERAGE_FACTOR
from hil.record.recording import Array, Channel, Recording
from hil.record.recording import recording as made_recording
from hil.signals.colour import colour_factor
from procedures._recorded import calibration_std, roles_of

Figure = tuple[float, float, str]
"""Value, standard uncertainty, unit."""

_A_SIDE = 0.05  # of the sweep: less beyond neutral is no side of the valve
_STEEP = 0.3  # of the steepest slope: where the width of the loop can be read
_TRANSIENT = 5.0  # lags after a turn until the response runs parallel to the command
_MOST_DROPPED = 0.1  # of a sweep's time, after each turn
_SMOOTHED = 5  # levels over which a slope or a width is averaged


@dataclass(frozen=True, slots=True)
class Characteristic:
    """A curve and the figures read from it.

    Attributes:
        command: levels at which both branches are known, rising, shape (n,).
        rising, falling, std: as in `hil.identification.flow_curve.FlowCurve`.
        figures: by the name under which the procedure declares them.
        dead_band: its two edges, where the sweep goes both ways.
        notes: what the reader should know.
    """

    command: Array
    rising: Array
    falling: Array
    std: Array
    figures: Mapping[str, Figure]
    dead_band: tuple[float, float] | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class SpeedEffect:
    """How the width of the loop depends on the sweep's speed.

    Attributes:
        lag_s, lag_std_s: of the valve; what widens the loop with speed.
        width, width_half: mean width of the loop along the command at full and at half speed.
        width_std: standard uncertainty of each.
        unit: of the widths.
    """

    lag_s: float
    lag_std_s: float
    width: float
    width_half: float
    width_std: float
    unit: str

    @property
    def sentence(self) -> str:
        """For the report."""
        expanded = COVERAGE_FACTOR * self.width_std
        digits = max(0, -math.floor(math.log10(expanded))) if expanded else 3
        return (
            f"The loop is {self.width:.{digits}f} {self.unit} wide, at half speed {self.width_half:.{digits}f} "
            f"{self.unit} (each ± {expanded:.{digits}f} {self.unit}): a lag of {1e3 * self.lag_s:.0f} ms makes the "
            "difference and has been taken out of the curve."
        )


def speed_effect(recording: Recording, parts: Sequence[Mapping[str, Any]]) -> SpeedEffect | None:
    """The lag that two sweeps at different speeds show; None when there is only one.

    A lag τ widens the loop by 2τ times the speed of the command; hysteresis does not depend on it.
    """
    if len(parts) < 2:
        return None
    command, _ = roles_of(recording)
    found = []
    for part in parts[:2]:
        curve = branches(recording.name, *_moving(recording, part, 0.0, float(part["settling_s"])))
        found.append((*_mean_width(*curve), float(part["speed_per_s"])))
    (width, std, speed), (width_half, std_half, speed_half) = found
    slope, both = 2.0 * (speed - speed_half), math.hypot(std, std_half)
    lag_s = max(width - width_half, 0.0) / slope
    return SpeedEffect(lag_s, both / slope, width, width_half, both / math.sqrt(2.0), command.unit)


def characteristic(recording: Recording, part: Mapping[str, Any], lag_s: float) -> Characteristic:
    """The curve of one sweep, the command taken earlier by a lag, with the figures that suit its sides.

    Raises:
        InputError: the response does not follow the command beyond the noise.
    """
    neutral = float(part["neutral"])
    span = float(part["span"])
    moving = _moving(recording, part, lag_s, _TRANSIENT * lag_s or float(part["settling_s"]))
    levels, rising, falling, std = branches(recording.name, *moving)
    ends = _ends(recording, part)
    reach = _A_SIDE * span
    if ends[0].command < neutral - reach and ends[-1].command > neutral + reach:
        made = _both_ways(recording, moving, neutral, span)
    else:
        made = _one_way(recording, part, (levels, rising, falling, std))
    return _with_ends(recording, made, ends)


@dataclass(frozen=True, slots=True)
class _End:
    """Where a sweep turned and waited: the command there, the steady response, its standard uncertainty."""

    command: float
    response: float
    std: float


def _moving(recording: Recording, part: Mapping[str, Any], lag_s: float, drop_s: float) -> tuple[Array, Array]:
    """(command, response) while the sweep moves; the command a lag earlier, the time after each turn left out."""
    command, response = roles_of(recording)
    rows = slice(part["first"], part["first"] + part["count"])
    time_s, driven, measured = recording.time_s[rows], command.values[rows], response.values[rows]
    direction = np.sign(np.diff(driven, prepend=driven[0]))
    starts = np.flatnonzero((direction != 0.0) & (direction != np.concatenate(([0.0], direction[:-1]))))
    since = np.arange(len(driven)) - starts[np.maximum(np.searchsorted(starts, np.arange(len(driven)), "right") - 1, 0)]
    most_s = _MOST_DROPPED * float(part["cycle_s"])
    keep = (direction != 0.0) & (since >= min(drop_s, most_s) / recording.interval_s)
    return np.interp(time_s - lag_s, time_s, driven)[keep], measured[keep]


def _ends(recording: Recording, part: Mapping[str, Any]) -> tuple[_End, _End]:
    """The steady responses at the lower and the upper end, from the second half of the wait there."""
    command, response = roles_of(recording)
    rows = slice(part["first"], part["first"] + part["count"])
    driven, measured = command.values[rows], response.values[rows]
    return _end(driven, measured, float(driven.min())), _end(driven, measured, float(driven.max()))


def _end(driven: Array, measured: Array, level: float) -> _End:
    waiting = np.flatnonzero(driven == level)
    return _End(level, *_settled(measured[waiting]))


def _settled(waited: Array) -> tuple[float, float]:
    """Mean of the second half, and its standard uncertainty from noise."""
    rest = waited[len(waited) // 2 :]
    return float(np.mean(rest)), float(np.std(rest)) * math.sqrt(colour_factor(rest) / len(rest))


def steady(recording: Recording, part: Mapping[str, Any], channel: Channel) -> tuple[float, float]:
    """Mean of a channel over the second half of a part that stands still, and its standard uncertainty."""
    value, std = _settled(recording.rows(part["first"], part["count"]).values(channel.name))
    return value, math.hypot(std, calibration_std(channel))


def _with_ends(recording: Recording, made: Characteristic, ends: tuple[_End, _End]) -> Characteristic:
    """The curve up to its ends, where both branches are the steady response, and the response there as a figure."""
    _, response = roles_of(recording)
    inner = (made.command > ends[0].command) & (made.command < ends[1].command)

    def put(values: Array, low: float, high: float) -> Array:
        return np.concatenate(([low], values[inner], [high]))

    at = [end.response for end in ends]
    per_response = calibration_std(response)
    figures = {
        "response_high": (at[1], math.hypot(ends[1].std, per_response), response.unit),
        "response_low": (at[0], math.hypot(ends[0].std, per_response), response.unit),
        **made.figures,
    }
    return replace(
        made,
        command=put(made.command, ends[0].command, ends[1].command),
        rising=put(made.rising, *at),
        falling=put(made.falling, *at),
        std=put(made.std, ends[0].std, ends[1].std),
        figures=figures,
    )


def _both_ways(recording: Recording, moving: tuple[Array, Array], neutral: float, span: float) -> Characteristic:
    command, response = roles_of(recording)
    time_s = recording.interval_s * np.arange(len(moving[0]), dtype=np.float64)
    columns = {command.heading: moving[0] - neutral, response.heading: moving[1]}
    found = flow_curve(made_recording(recording.name, time_s, columns), command.name, response.name)
    low, high = (neutral + edge.value for edge in (found.dead_band_negative, found.dead_band_positive))
    figures = _both_figures(found, neutral, span, calibration_std(command))
    return Characteristic(neutral + found.command, found.rising, found.falling, found.std, figures, (low, high))


def _both_figures(found: FlowCurve, neutral: float, span: float, command_std: float) -> dict[str, Figure]:
    per = f"{found.output_unit} per {found.input_unit}"
    positive, negative = found.dead_band_positive, found.dead_band_negative
    numbers: dict[str, Number] = {
        "hysteresis": _hysteresis(found, span),
        "dead_band_positive": Number(neutral + positive.value, math.hypot(positive.std, command_std), positive.unit),
        "dead_band_negative": Number(neutral + negative.value, math.hypot(negative.std, command_std), negative.unit),
        "gain_positive": replace(found.gain_positive, unit=per),
        "gain_negative": replace(found.gain_negative, unit=per),
        "symmetry": replace(found.symmetry, unit=""),
        "linearity": found.linearity,
    }
    return {name: (number.value, number.std, number.unit) for name, number in numbers.items()}


def _hysteresis(found: FlowCurve, span: float) -> Number:
    slope = _smooth(np.gradient(found.nominal, found.command))
    width, std = _largest_width(found.command, found.rising, found.falling, found.std, slope)
    return Number(100.0 * width / span, 100.0 * std / span, "%")


def _one_way(recording: Recording, part: Mapping[str, Any], curve: tuple[Array, Array, Array, Array]) -> Characteristic:
    levels, rising, falling, std = curve
    span = float(part["span"])
    command, response = roles_of(recording)
    nominal = (rising + falling) / 2.0
    change = float(nominal[-1] - nominal[0])
    noise = float(np.median(std))
    if abs(change) < 10.0 * noise:
        raise InputError(f"{recording.name}: '{response.name}' does not follow '{command.name}' beyond the noise")
    slope = _smooth(np.gradient(nominal, levels))
    steepest = int(np.argmax(np.abs(slope)))
    spacing = float(np.median(np.diff(levels)))
    slope_std = noise / spacing / math.sqrt(2.0) / _SMOOTHED
    half = _level_at(levels, nominal, nominal[0] + change / 2.0)
    response_std = math.hypot(noise, calibration_std(response))
    half_std = math.hypot(response_std / abs(float(np.interp(half, levels, slope))), calibration_std(command))
    width, width_std = _largest_width(levels, rising, falling, std, slope)
    per = f"{response.unit} per {command.unit}"
    figures = {
        "hysteresis": (100.0 * width / span, 100.0 * width_std / span, "%"),
        "command_half": (half, half_std, command.unit),
        "gain_largest": (float(slope[steepest]), slope_std, per),
    }
    share = 100.0 * (float(levels[steepest]) - float(part["neutral"])) / float(part["full"])
    note = (
        f"The response is steepest at {levels[steepest]:.4g} {command.unit}, {share:.3g} % of full command: a good "
        "bias for dynamic tests."
    )
    return Characteristic(levels, rising, falling, std, figures, None, (note,))


def _level_at(levels: Array, values: Array, wanted: float) -> float:
    """First level at which the values pass a wanted one."""
    beyond = (values >= wanted) if values[-1] > values[0] else (values <= wanted)
    i = max(int(np.argmax(beyond)), 1)
    share = (wanted - values[i - 1]) / (values[i] - values[i - 1])
    return float(levels[i - 1] + share * (levels[i] - levels[i - 1]))


def _mean_width(levels: Array, rising: Array, falling: Array, std: Array) -> tuple[float, float]:
    """Shift of the branches along the command that explains their distance best, and its standard uncertainty."""
    slope = np.gradient((rising + falling) / 2.0, levels)
    weight = float(slope @ slope)
    return float((falling - rising) @ slope) / weight, 2.0 * math.sqrt(float((std * slope) @ (std * slope))) / weight


def _largest_width(levels: Array, rising: Array, falling: Array, std: Array, slope: Array) -> tuple[float, float]:
    """Largest distance of the branches along the command where the curve is steep, and its uncertainty."""
    steep = np.flatnonzero(np.abs(slope) > _STEEP * float(np.max(np.abs(slope))))
    sign = 1.0 if rising[-1] > rising[0] else -1.0
    wanted = sign * (rising + falling)[steep] / 2.0
    up, down = (np.interp(wanted, np.maximum.accumulate(sign * branch), levels) for branch in (rising, falling))
    widths = np.abs(_smooth(up - down))
    worst = int(np.argmax(widths))
    at = int(steep[worst])
    return float(widths[worst]), 2.0 * float(std[at]) / abs(float(slope[at])) / math.sqrt(_SMOOTHED)


def _smooth(values: Array) -> Array:
    made: Array = np.convolve(np.pad(values, _SMOOTHED // 2, mode="edge"), np.full(_SMOOTHED, 1.0 / _SMOOTHED), "valid")
    return made
