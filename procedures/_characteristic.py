"""A steady characteristic from a slow sweep, of a command that goes both ways or one way."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hil.errors import InputError
from hil.identification.steady.characteristic import (
    Loop,
    Read,
    largest_slope,
    level_at,
    loop,
    over_all,
    polyline,
    reaches_both_sides,
    side,
    symmetry,
    worst_departure,
)
from hil.identification.steady.null import Null, null_of
from hil.identification.steady.sweep_estimate import Standing, Sweep, SweepEstimate, settled, sweep_estimate, together
from hil.identification.uncertainty.parametric_bootstrap import about
from hil.language.note import Note
from hil.record.measurement import COVERAGE_FACTOR, Measured, Measurement
from hil.record.recording import Array, Channel, Recording
from hil.signals.interval import CERTAIN
from hil.signals.rounding import mean_rounding_std, rounding_step
from procedures._recorded import calibration_share, calibration_std, reading_step, roles_of, rows_of
from procedures._statistics import at_most_one, disagreement, extreme, rounded_up


@dataclass(frozen=True, slots=True)
class Characteristic:
    """A curve and the figures read from it.

    Attributes:
        command: levels, rising, shape (n,).
        rising, falling, std: branches with the lag taken out; standard uncertainty of the curve between them.
        half_speed: the branches of the sweep at half speed, or None.
        measured: the figures.
        dead_band: its two edges, where the sweep goes both ways.
        notes: what the reader should know.
    """

    command: Array
    rising: Array
    falling: Array
    std: Array
    half_speed: tuple[Array, Array] | None
    measured: tuple[Measured, ...]
    dead_band: tuple[float, float] | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Swept:
    """The sweeps of a run as figures are read from them: the estimate, the steady ends, speeds, channels.

    `drifted` is what the visits of one end differ by beyond noise, `creep_per_s` that over the time between them,
    `rounding` what the converter leaves in a mean of a level, as a standard uncertainty.
    """

    estimate: SweepEstimate
    low: Standing
    high: Standing
    drifted: float
    creep_per_s: float
    rounding: float
    speeds: tuple[float, ...]
    command: Channel
    response: Channel

    def standing(self, end: Standing) -> Read:
        """The response at an end, with all that its visits leave open."""
        return end.response, math.hypot(end.std, self.rounding, self.drifted)


def swept(recording: Recording, parts: Sequence[Mapping[str, Any]], of: Channel | None = None) -> Swept:
    """The estimate of sweeps that were driven over one range with waits at their ends.

    Args:
        recording: with the parts.
        parts: the sweeps.
        of: the channel over the command; the response when not given.
    """
    command, response = roles_of(recording)
    response = of or response
    sweeps, waits = [], []
    for part in parts:
        rows = rows_of(part)
        driven, measured = command.values[rows], response.values[rows]
        sweeps.append(Sweep(driven, measured, float(part["speed_per_s"])))
        waits += _waits(driven, measured)
    ends = [together([wait for wait in waits if wait.risen == risen]) for risen in (False, True)]
    estimate = sweep_estimate(recording.name, sweeps, ends, float(parts[0]["settling_s"]))
    speeds = tuple(sweep.speed_per_s for sweep in sweeps)
    rounding = mean_rounding_std(0.0, rounding_step(response.values))  # a standing level may never change its code
    drifted = max(
        disagreement([(wait.response, math.hypot(wait.std, rounding)) for wait in waits if wait.risen == risen])
        for risen in (False, True)
    )
    first, last = parts[0], parts[-1]
    # an end is first waited at within the first sweep
    apart = last["first"] + last["count"] - first["first"] - (first["count"] if len(parts) > 1 else 0)
    lasted_s = apart * recording.interval_s
    return Swept(estimate, ends[0], ends[1], drifted, drifted / lasted_s, rounding, speeds, command, response)


def characteristic(swept_: Swept, part: Mapping[str, Any], zero: Read, of: Mapping[str, Measurement]) -> Characteristic:
    """The curve with the figures that suit its sides, as declared in `of`; `zero`: the response at neutral.

    Raises:
        InputError: the response does not follow the command beyond the noise.
    """
    estimate, unit = swept_.estimate, swept_.response.unit
    neutral, span = float(part["neutral"]), float(part["span"])
    between = loop(estimate, CERTAIN, swept_.speeds)
    measured = [
        of[name]
        .at(unit=unit)
        .of(
            *swept_.standing(end),
            calibration=calibration_std(swept_.response),
        )
        for name, end in (("response_high", swept_.high), ("response_low", swept_.low))
    ]
    spoilt = _spoilt(swept_)
    measured += _of_loop(swept_, between, span, of, known=spoilt is None)
    dead_band: tuple[float, float] | None = None
    if reaches_both_sides(swept_.low.command, swept_.high.command, neutral):
        found, dead_band = _both_ways(swept_, neutral, zero, of)
        edges = [one for one in found if one.quantity.startswith("dead_band")]
        of_null, notes = _null(swept_, neutral, float(part["full"]), of, edges)
        found += of_null
    else:
        found, notes = _one_way(swept_, part, of)
    at = polyline()
    half = (estimate.branch(1, 1)[at], estimate.branch(-1, 1)[at]) if len(swept_.speeds) > 1 else None
    of_loop = [spoilt] if spoilt else [_loop_note(swept_, between)]
    return Characteristic(
        estimate.command[at], estimate.completed_branch(1)[at], estimate.completed_branch(-1)[at],
        np.std(estimate.responses, axis=0)[at], half, (*measured, *found), dead_band,
        tuple(text for text in (*of_loop, *_uncovered(swept_), *notes) if text),
    )  # fmt: skip


def steady(recording: Recording, part: Mapping[str, Any], channel: Channel) -> tuple[float, float]:
    """Mean of a channel over the second half of a part that stands still, and its standard uncertainty from noise."""
    values = channel.values[rows_of(part)]  # in the channel's unit, not the recorded one
    value, std = settled(values)
    return value, math.hypot(std, mean_rounding_std(float(np.std(values)), reading_step(recording, channel)))


def at_ends(recording: Recording, parts: Sequence[Mapping[str, Any]], values: Array) -> tuple[Standing, Standing]:
    """(at the lower end, at the upper end): what values of another channel were while the command waited there."""
    command, _ = roles_of(recording)
    waits: list[Standing] = []
    for part in parts:
        rows = rows_of(part)
        waits += _waits(command.values[rows], values[rows])
    low, high = (together([wait for wait in waits if wait.risen == risen]) for risen in (False, True))
    return low, high


def _waits(driven: Array, measured: Array) -> list[Standing]:
    """Every wait at an end, from the second half of it."""
    found = []
    for level, risen in ((float(driven.min()), False), (float(driven.max()), True)):
        at = np.flatnonzero(driven == level)
        for wait in np.split(at, np.flatnonzero(np.diff(at) > 1) + 1):
            if len(wait) > 1:
                value, std = settled(measured[wait])
                found.append(Standing(level, value, std, max(1, len(wait) // 2), risen))
    return found


def _spoilt(swept_: Swept) -> Note | None:
    """Why lag and hysteresis cannot be told."""
    if not swept_.drifted:
        return None
    return Note(
        "The response at the same end of the sweep changes by {change:.2g} {unit} from visit to visit: reading or "
        "valve drifts. Hysteresis, lag and the ends of a dead band cannot be separated from drift.",
        change=swept_.drifted, unit=swept_.response.unit,
    )  # fmt: skip


def _of_loop(swept_: Swept, between: Loop, span: float, of: Mapping[str, Measurement], known: bool) -> list[Measured]:
    """Hysteresis and lag."""
    hysteresis, lag = of["hysteresis"], of["lag"]
    if not known:
        return [hysteresis.of(None), lag.of(None)] if len(swept_.speeds) > 1 else [hysteresis.of(None)]
    if between.width is None or between.lag is None:
        half, halves = swept_.estimate.half_widths[0], swept_.estimate.resampled_half_widths[:, 0]
        whole = 2.0 * abs(float(half)) + COVERAGE_FACTOR * 2.0 * about(halves, float(half))
        return [hysteresis.of(rounded_up(100.0 * whole / span), 0.0, relation="<")]
    width, std = between.width
    return [
        extreme(hysteresis, 100.0 * width / span, 100.0 * std / span),
        lag.of(1e3 * between.lag[0], 1e3 * between.lag[1]),
    ]


def _loop_note(swept_: Swept, between: Loop) -> Note:
    estimate, unit = swept_.estimate, swept_.command.unit
    widths = [2.0 * abs(float(half)) for half in estimate.half_widths]
    if between.lag is None:
        return Note(
            "The loop is {width:.3g} {unit} wide. One speed does not tell how much of that is lag.",
            width=widths[0], unit=unit,
        )  # fmt: skip
    expanded = COVERAGE_FACTOR * 2.0 * about(estimate.resampled_half_widths[:, 0], float(estimate.half_widths[0]))
    digits = max(0, -math.floor(math.log10(expanded))) if expanded > 0.0 else 3
    width, half, u = (Note(f"{{value:.{digits}f}}", value=value) for value in (*widths[:2], expanded))
    text = Note(
        "The loop is {width} {unit} wide, at half speed {half} {unit} (each ± {u} {unit}). A lag of {lag_ms:.0f} ms "
        "makes the difference and has been taken out of the curve.",
        width=width, half=half, u=u, unit=unit, lag_ms=1e3 * between.lag[0],
    )  # fmt: skip
    if not between.is_friction:
        return text
    return Note(
        "{found} Friction that falls with speed looks like lag; both intervals hold its usual amount.",
        found=text,
    )


def _uncovered(swept_: Swept) -> list[Note]:
    """Ends of the range that only one branch has reached."""
    low, high = swept_.estimate.covered
    bottom, top = float(swept_.estimate.command[0]), float(swept_.estimate.command[-1])
    if max(low - bottom, top - high) <= 0.1 * (top - bottom) / 2.0:
        return []
    return [Note(
        "The fast sweep shows both branches only from {low:.3g} to {high:.3g} {unit}. Beyond, the curve rests on one "
        "of them and on the wait at the end. A longer cycle_s covers more.",
        low=low, high=high, unit=swept_.command.unit,
    )]  # fmt: skip


def _both_ways(
    swept_: Swept, neutral: float, zero: Read, of: Mapping[str, Measurement]
) -> tuple[list[Measured], tuple[float, float]]:
    estimate = swept_.estimate
    per = f"{swept_.response.unit} per {swept_.command.unit}"
    sides = {
        sign: side(estimate, neutral, zero, swept_.standing(end), sign, rounding_step(swept_.response.values))
        for sign, end in ((1, swept_.high), (-1, swept_.low))
    }  # fmt: skip
    share = math.hypot(calibration_share(swept_.response), calibration_share(swept_.command))
    level = calibration_std(swept_.command)
    found = []
    for sign, word in ((1, "positive"), (-1, "negative")):
        edge = of[f"dead_band_{word}"].at(unit=swept_.command.unit)
        found.append(edge.of(None) if swept_.drifted else _edge(edge, *sides[sign].edge, neutral, sign, level))
    for sign, word in ((1, "positive"), (-1, "negative")):
        value, std = sides[sign].gain
        found.append(of[f"gain_{word}"].at(unit=per).of(value, std, calibration=share * abs(value)))
    found.append(at_most_one(of["symmetry"], *symmetry(sides.values())))
    found.append(extreme(of["linearity"], *(100.0 * one for one in worst_departure(sides.values()))))
    return found, (sides[-1].edge[0], sides[1].edge[0])


def _null(
    swept_: Swept, neutral: float, full: float, of: Mapping[str, Measurement], edges: Sequence[Measured]
) -> tuple[list[Measured], list[str]]:
    """Null bias, lap with its class, and where the flow saturates; nothing where the response does not pass zero."""
    found = null_of(swept_.estimate, swept_.low.response, swept_.high.response)
    if found is None:
        return [], []
    below, above = found.slopes
    level, share = calibration_std(swept_.response), calibration_share(swept_.command)
    drifted, percent = swept_.drifted or 0.0, 100.0 / full
    lap, lap_std = found.lap
    # a meter off by so much moves both crossings one way, and apart where the gains differ
    spread = abs(1.0 / above - 1.0 / below)
    bias = null_bias(swept_, found, neutral, full, of["null_bias"])
    width = of["lap"].of(
        percent * lap, percent * math.hypot(lap_std, drifted * spread),
        calibration=percent * math.hypot(level * spread, share * lap),
    )  # fmt: skip
    ends = [_saturated(swept_, found, sign, of) for sign in (1, -1)]
    return [bias, width, *ends], [_lap_class(width, edges)]


def null_bias(swept_: Swept, found: Null, neutral: float, full: float, what: Measurement) -> Measured:
    """The null from neutral, in % of full command."""
    below, above = found.slopes
    percent, moved = 100.0 / full, 0.5 * abs(1.0 / above + 1.0 / below)
    centre, centre_std = found.centre
    return what.of(
        percent * (centre - neutral), percent * math.hypot(centre_std, swept_.drifted * moved),
        calibration=percent * math.hypot(calibration_std(swept_.response) * moved, calibration_std(swept_.command)),
    )  # fmt: skip


def _saturated(swept_: Swept, found: Null, sign: int, of: Mapping[str, Measurement]) -> Measured:
    """Where the flow saturates; a bound at the end of the sweep where it does not."""
    what = of[f"saturation_{'positive' if sign > 0 else 'negative'}"].at(unit=swept_.command.unit)
    value, std = found.saturated[sign > 0]
    end = (swept_.high if sign > 0 else swept_.low).command
    if math.isinf(value):
        return what.of(end, 0.0, relation=">" if sign > 0 else "<")
    if math.isinf(std):
        return what.of(None)
    return what.of(value, std, calibration=calibration_std(swept_.command))


def _lap_class(lap: Measured, edges: Sequence[Measured]) -> str:
    """What lap and dead band together make of a valve: the lines alone would call a curve that bends lapped."""
    if lap.value is None or lap.std is None or any(edge.value is None for edge in edges):
        return ""
    dead = any(edge.relation == "=" for edge in edges)
    clear = abs(lap.value) > COVERAGE_FACTOR * lap.std
    if dead != (clear and lap.value > 0.0):
        return Note("Lap class: none. The curve bends near null, so the straight lines do not show the edges.")
    if not clear:
        return Note("Lap class: zero lap within its uncertainty.")
    return Note("Lap class: overlapped.") if lap.value > 0.0 else Note("Lap class: underlapped.")


def _edge(
    of: Measurement, value: float, std: float, neutral: float, sign: int, calibration: float
) -> Measured:  # fmt: skip
    """An edge of the dead band; how far it reaches at most, where its uncertainty covers the whole way from neutral."""
    expanded = COVERAGE_FACTOR * math.hypot(std, calibration)
    if expanded < sign * (value - neutral):
        return of.of(value, std, calibration=calibration)
    return of.of(value + sign * expanded, 0.0, relation="<" if sign > 0 else ">")


def _one_way(swept_: Swept, part: Mapping[str, Any], of: Mapping[str, Measurement]) -> tuple[list[Measured], list[str]]:
    estimate, command, response = swept_.estimate, swept_.command, swept_.response
    start, end = swept_.low.response, swept_.high.response
    if abs(end - start) < 10.0 * float(np.median(np.std(estimate.responses, axis=0))):
        raise InputError(f"the response '{response.name}' does not follow '{command.name}' beyond the noise")
    half = over_all(estimate, lambda curve, _slope: level_at(estimate.command, curve, (start + end) / 2.0))
    at_half = abs(float(np.interp(half[0], estimate.command, estimate.slope)))
    ends_std = math.hypot(swept_.low.std, swept_.high.std, math.sqrt(2.0) * swept_.rounding, swept_.drifted) / 2.0
    half = half[0], math.hypot(half[1], ends_std / at_half)
    (gain, gain_std), steepest = largest_slope(estimate, swept_.speeds)
    share = math.hypot(calibration_share(response), calibration_share(command))
    found = [
        of["command_half"].at(unit=command.unit).of(*half, calibration=calibration_std(command)),
        of["gain_largest"]
        .at(unit=f"{response.unit} per {command.unit}")
        .of(gain, gain_std, calibration=share * abs(gain)),
    ]
    of_full = 100.0 * (steepest - float(part["neutral"])) / float(part["full"])
    note = Note(
        "The response is steepest at {command:.4g} {unit}, {share:.3g} % of full command: a good bias for dynamic "
        "tests.",
        command=steepest, unit=command.unit, share=of_full,
    )  # fmt: skip
    return found, [note]
