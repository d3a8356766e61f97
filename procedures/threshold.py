"""Threshold: the least change of command that moves the response, onward after a stop and after reversal.

A slow triangle about a bias that stops in its middle and at its ends. What begins in the middle goes on in the old
direction, what begins at an end goes back: friction that holds the spool needs more command there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval, Unit

from hil.identification.steady.threshold_estimate import (
    CLEAR,
    Ramp,
    Reading,
    Stop,
    Threshold,
    drift_of,
    gain_and_lag,
    threshold_of,
)
from hil.language.words import marked
from hil.record.measurement import COVERAGE_FACTOR, Findings, Measured, Measurement
from hil.record.recording import Array, Recording
from hil.rig import Rig
from hil.signals.colour import colour_factor
from hil.signals.interval import CERTAIN
from hil.signals.ramps import ramp
from hil.signals.rounding import mean_rounding_std
from procedures._definitions import THRESHOLDS, defined
from procedures._recorded import calibration_share, departures, parts_of, reading_step, roles_of
from procedures._run_sequence import RunSequence, joined
from procedures._scale import about_levels, check_stands, scale_of
from procedures._settings import NotNegative, Percent, Positive, PositivePercent, Twice
from procedures._statistics import rounded_up

ONWARD, REVERSAL = marked("onward"), marked("reversal")
COUNTED = Measurement("counted_change", "", "change of the response that counts: three standard uncertainties")
OF = {
    ONWARD: Measurement("threshold_onward", "%", "least change of command that moves the response on after a stop"),
    REVERSAL: Measurement("threshold_reversal", "%", "the same after reversal"),
}
MEASUREMENTS = defined(THRESHOLDS, *OF.values(), COUNTED)
_LEAST = 4  # ramps of each kind: two triangles
_WAIT = 2.0  # settling times at each stop, of which the second half is read


def run(
    rig: Rig,
    *,
    biases: tuple[Percent, ...] | None = None,
    reach: PositivePercent = 3.0,
    speed: Annotated[float, Interval(gt=0.0, le=1.0), Unit("%")] = 0.2,
    repeats: Twice = 2,
    warm_up_s: NotNegative = 0.0,
    full_command: Positive | None = None,
    rate_hz: Positive | None = None,
) -> None:
    """Drive the ramps.

    Args:
        rig: the bench.
        biases: about which levels, in % of full command from neutral. When not given: the bench's operating point, else
            ±50, or the middle of a one-way command.
        reach: how far from the bias, in % of full command; more than the threshold.
        speed: of the ramps, in % of full command per second.
        repeats: how often the triangle is driven; drift is known from two on.
        warm_up_s: time at the first level before anything is measured, in s.
        full_command: what 100 % is, in the unit of the command; the farther end of its range when not given.
        rate_hz: sample rate; that of the bench when not given.
    """
    rate_hz = rig.actual_rate_hz(rate_hz)
    scale = scale_of(rig, full_command)
    check_stands(scale, "a threshold")
    levels = about_levels(scale, (reach,), biases)
    every = [_legs(bias, size, reach / speed, rig.settling_s, rate_hz, repeats) for bias, size in levels]
    paths = [np.concatenate([command for command, _ in legs]) for legs in every]
    sequence = RunSequence(
        rig, rate_hz, joined(rig, rate_hz, warm_up_s, paths), {"biases": [bias for bias, _ in levels]}
    )
    sequence.warm_up(float(paths[0][0]), warm_up_s)
    for (bias, _), legs in zip(levels, every, strict=True):
        sequence.go_to(float(legs[0][0][0]))
        for command, part in legs:
            about = {**part, "bias": bias, "full": scale.full, "label": scale.label(bias)}
            sequence.play(command, f"{part['way']} about {bias:.4g} {rig.command.unit}", about)
    sequence.finish()


def _legs(
    bias: float, size: float, ramp_s: float, settling_s: float, rate_hz: float, repeats: int
) -> list[tuple[Array, dict[str, Any]]]:
    """(command, what it is) of every stop with the ramp behind it; the first comes up to the bias, the last stands."""
    wait = max(2, round(_WAIT * settling_s * rate_hz))
    ways = [(0.0, 1.0, ONWARD), (1.0, 0.0, REVERSAL), (0.0, -1.0, ONWARD), (-1.0, 0.0, REVERSAL)] * repeats
    legs = []
    for start, end, way in [(-1.0, 0.0, "approach"), *ways]:
        slope = ramp(bias + start * size, bias + end * size, ramp_s, rate_hz)
        part = {"kind": "threshold", "way": way, "from": start, "to": end, "waited": wait}
        legs.append((np.concatenate((np.full(wait, bias + start * size), slope[1:])), part))
    return [*legs, (np.full(wait, bias), {"kind": "threshold", "way": "end", "from": 0.0, "to": 0.0, "waited": wait})]


def evaluate(recording: Recording) -> Findings:
    """Both thresholds about each bias, with the averaged motion that they are read from."""
    legs = parts_of(recording, "threshold")
    labels = dict.fromkeys(leg["label"] for leg in legs)
    found = [_about(recording, [leg for leg in legs if leg["label"] == label]) for label in labels]
    measured, curves = (tuple(one for part in parts for one in part) for parts in zip(*found, strict=True))
    return Findings(measured, {"threshold": list(curves)}, deviations=departures(recording))


def _about(recording: Recording, legs: Sequence[Mapping[str, Any]]) -> tuple[list[Measured], list[dict[str, Any]]]:
    """What one bias shows."""
    label, full = str(legs[0]["label"]), float(legs[0]["full"])
    stops, reading = _stops(recording, legs)
    ramps = _ramps(recording, legs, stops)
    if min(map(len, ramps.values())) < _LEAST:
        return [what.at(label).of(None) for what in OF.values()], []
    drift = drift_of(_visited(legs, stops))
    (gain, gain_std), lag = gain_and_lag(ramps[ONWARD], drift)
    follows = gain > CERTAIN * gain_std
    command, response = roles_of(recording)
    found, counted, curves = [], [], []
    for way, mine in ramps.items():
        threshold = threshold_of(mine, reading, drift, gain, lag) if follows else None
        if threshold is None:
            found.append(OF[way].at(label).of(None))
            continue
        reach, share = float(mine[0].change[-1]), calibration_share(command)
        found.append(_measured(OF[way].at(label), threshold, reach, 100.0 / full, share))
        counted.append(COUNTED.at(f"{label}, {way}", response.unit).of(threshold.counted, 0.0))
        curves.append({
            "label": f"{label}, {way}", "command_unit": command.unit, "response_unit": response.unit,
            "command": threshold.command, "measured": threshold.moved,
        })  # fmt: skip
    return [*found, *counted], curves


def _ramps(recording: Recording, legs: Sequence[Mapping[str, Any]], stops: Sequence[Stop]) -> dict[str, list[Ramp]]:
    """The ramps of each kind; the approach tells which way the response goes."""
    rose = float(np.sign(stops[1].response - stops[0].response)) or 1.0
    ramps: dict[str, list[Ramp]] = {ONWARD: [], REVERSAL: []}
    for leg, before, after in zip(legs, stops, stops[1:], strict=False):
        if leg["way"] in ramps:
            sense = rose * float(np.sign(leg["to"] - leg["from"]))
            ramps[leg["way"]].append(_ramp(recording, leg, before, after, sense))
    return ramps


def _visited(legs: Sequence[Mapping[str, Any]], stops: Sequence[Stop]) -> list[list[Stop]]:
    """The stops, together those that were come to in one and the same way."""
    found: dict[tuple[float, float], list[Stop]] = {}
    for leg, stop in zip(legs, stops[1:], strict=False):
        if leg["way"] in OF:
            found.setdefault((leg["from"], leg["to"]), []).append(stop)
    return list(found.values())


def _measured(what: Measurement, found: Threshold, reach: float, percent: float, share: float) -> Measured:
    """A value where friction shows; a bound where a valve without any would show no earlier, or none has moved."""
    value, std = found.value
    if math.isinf(value):
        return what.of(percent * reach, 0.0, relation=">")
    if value - found.ideal < CLEAR * std:
        return what.of(rounded_up(percent * (max(value, found.ideal) + COVERAGE_FACTOR * std)), 0.0, relation="<")
    return what.of(percent * value, percent * std, calibration=percent * share * value)


def _stops(recording: Recording, legs: Sequence[Mapping[str, Any]]) -> tuple[list[Stop], Reading]:
    """Every stop, from the second half of its wait, and what limits readings there."""
    _, response = roles_of(recording)
    rests = []
    for leg in legs:
        first, waited = int(leg["first"]), int(leg["waited"])
        rests.append(slice(first + waited // 2, first + waited))
    left = np.concatenate([response.values[rows] - response.values[rows].mean() for rows in rests])
    noise_std = float(np.sqrt(np.mean(left**2)))
    coloured = noise_std * math.sqrt(max(colour_factor(left), 1.0))
    rounding = mean_rounding_std(noise_std, reading_step(recording, response))
    stops = []
    for rows in rests:
        values = response.values[rows]
        stops.append(
            Stop(float(values.mean()), coloured / math.sqrt(len(values)), float(recording.time_s[rows].mean()))
        )
    return stops, Reading(coloured, rounding)


def _ramp(recording: Recording, leg: Mapping[str, Any], before: Stop, after: Stop, sense: float) -> Ramp:
    command, response = roles_of(recording)
    rows = slice(int(leg["first"]) + int(leg["waited"]), int(leg["first"]) + int(leg["count"]))
    change = np.abs(command.values[rows] - command.values[rows.start - 1])
    return Ramp(change, recording.time_s[rows], response.values[rows], before, after, sense)
