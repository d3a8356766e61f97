"""Velocity steps: a cylinder's steady speed in both directions, their ratio, and what its areas would make of it.

In an open loop the command jumps from neutral to openings of both signs. In a closed loop the position request jumps
from one side to the other, so far that the valve is fully open for the first part of the way.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hil.errors import SettingError
from hil.identification.steady.characteristic import ratio_of
from hil.language.note import Note
from hil.record.measurement import Findings, Measured, Measurement
from hil.record.recording import Array, Recording
from hil.rig import Rig
from hil.signals.colour import colour_factor
from hil.signals.straight_line import weighted_line
from procedures._cylinder import Axis, approach, axis_of
from procedures._definitions import CYLINDERS, defined
from procedures._recorded import calibration_share, departures, parts_of, roles_of
from procedures._run_sequence import RunSequence, joined
from procedures._scale import Scale, check_above, scale_of
from procedures._settings import Once, Positive, PositivePercent
from procedures._statistics import mean_of

SPEED = Measurement("speed", "", "steady speed after a step, extending positive")
RATIO = Measurement("speed_ratio", "1", "speed retracting over speed extending")
MEASUREMENTS = defined(CYLINDERS, SPEED, RATIO)

_KIND = "velocity step"
_CLOSED_LEVELS, _OPEN_LEVELS = (80.0,), (50.0, 100.0)
_OPEN_WAY = 0.5  # of the usable stroke that an open step goes at its rated speed
_CLOSED_SHARES = (0.1, 0.4)  # of the way of a closed step, between which the speed is read
_OPEN_SHARES = (0.4, 1.0)  # of the time of an open step
_STEADY = 0.05  # change of the speed within these, from which it is said not to be steady
_MOST_POINTS = 1000
_LEAST_SAMPLES = 10


def run(
    rig: Rig,
    *,
    levels: tuple[PositivePercent, ...] | None = None,
    repeats: Once = 2,
    stroke_mm: Positive = 250.0,
    retracted_mm: float | None = None,
    bore_mm: Positive = 50.0,
    rod_mm: Positive = 30.0,
    full_flow_lpm: Positive = 11.4,
    full_command: Positive | None = None,
    rate_hz: Positive | None = None,
) -> None:
    """Step to each level, both ways.

    Args:
        rig: the bench.
        levels: in % of full command, without sign. Closed loop: the request jumps between minus and plus this; 80 when
            not given. Open loop: the opening; 50 and 100 when not given.
        repeats: of every step.
        stroke_mm: of the cylinder.
        retracted_mm: reading at the retracted end; minus half the stroke when not given.
        bore_mm: diameter of the piston.
        rod_mm: diameter of the rod.
        full_flow_lpm: flow at full command, which says how long the steps may last.
        full_command: what 100 % is, in the unit of the command; the farther end of its range when not given.
        rate_hz: sample rate; that of the bench when not given.
    """
    rate_hz = rig.actual_rate_hz(rate_hz)
    axis = axis_of(rig, stroke_mm, retracted_mm, bore_mm, rod_mm, full_flow_lpm)
    scale = scale_of(rig, full_command)
    asked = (_CLOSED_LEVELS if axis.closed else _OPEN_LEVELS) if levels is None else levels
    if not asked:
        raise SettingError("setting levels: none given")
    for level in asked:
        check_above("levels", 0.0, level, "%")
    pairs = [(scale.level("levels", -percent), scale.level("levels", percent)) for percent in asked]
    if axis.closed:
        for percent, (low, high) in zip(asked, pairs, strict=True):
            axis.check_position("levels", f"±{percent:g} %", low, high)
        _drive_closed(rig, axis, pairs * repeats, rate_hz)
    else:
        _drive_open(rig, axis, scale, [pair for pair in pairs for _ in range(repeats)], rate_hz)


def evaluate(recording: Recording) -> Findings:
    """Speed after every step, the ratio of both directions, and how it compares with that of the areas."""
    parts = parts_of(recording, _KIND)
    _, response = roles_of(recording)
    speed_unit = f"{response.unit}/s"
    found: dict[str, list[tuple[float, float]]] = {}
    curves, notes = [], []
    for part in parts:
        curve, value, std, steady = _one(recording, part)
        found.setdefault(part["label"], []).append((value, std))
        curves.append(curve)
        if not steady:
            restless = Note("the speed is not steady where it is read; the uncertainty holds its change.")
            notes.append(restless.at(part["label"]))
    means = {label: mean_of(values) for label, values in found.items()}
    share = calibration_share(roles_of(recording)[1])
    measured: list[Measured] = [
        SPEED.at(label, speed_unit).of(*mean, calibration=share * abs(mean[0])) for label, mean in means.items()
    ]
    for place, extending, retracting in _pairs(parts):
        ratio, std = ratio_of(means[retracting], means[extending])
        measured.append(RATIO.at(place).of(ratio, std))
        notes.append(_areas(ratio, std, float(parts[0]["area_ratio"])).at(place))
    return Findings(tuple(measured), {"velocity_steps": curves}, tuple(dict.fromkeys(notes)), departures(recording))


def _drive_closed(rig: Rig, axis: Axis, pairs: Sequence[tuple[float, float]], rate_hz: float) -> None:
    steps = []
    for low, high in pairs:
        held_s = (high - low) / min(axis.extend_per_s, axis.retract_per_s) + rig.settling_s
        samples = max(1, round(held_s * rate_hz))
        steps += [(low, high, np.full(samples, high)), (high, low, np.full(samples, low))]
    first = steps[0][0]
    path = joined(rig, rate_hz, 0.0, [np.concatenate([[first], *(wave for _, _, wave in steps)])])
    sequence = RunSequence(rig, rate_hz, path, {"levels": [list(pair) for pair in pairs], "closed loop": True})
    before = None
    for start, stop, wave in steps:
        if start != before:
            sequence.go_to(start)
        label = f"{start:.4g} → {stop:.4g} {rig.command.unit}"
        place = f"±{abs(stop - start) / 2.0:.4g} {rig.command.unit}"
        sequence.play(wave, label, _part(axis, label, place, stop > start))
        before = stop
    sequence.finish()


def _drive_open(rig: Rig, axis: Axis, scale: Scale, pairs: Sequence[tuple[float, float]], rate_hz: float) -> None:
    steps = []
    for low, high in pairs:
        share = (high - scale.neutral) / scale.full
        for direction, level in ((1, high), (-1, low)):
            driven_s = _OPEN_WAY * (axis.high - axis.low) / (axis.speed_per_s(direction) * share)
            steps.append((direction, level, share, np.full(max(1, round(driven_s * rate_hz)), level)))
    ways = [np.array([level]) for pair in pairs for level in pair]
    sequence = RunSequence(
        rig, rate_hz, joined(rig, rate_hz, 0.0, [*ways, *(wave for *_, wave in steps)]),
        {"levels": [list(pair) for pair in pairs], "closed loop": False},
    )  # fmt: skip
    sequence.go_to(scale.neutral)
    for direction, level, share, wave in steps:
        start = axis.low if direction > 0 else axis.high
        approach(rig, sequence, start, share * scale.full, share * axis.speed_per_s(-direction))
        label = f"{scale.neutral:.4g} → {level:.4g} {rig.command.unit}"
        place = f"±{share * scale.full:.4g} {rig.command.unit}"
        sequence.play(wave, label, _part(axis, label, place, direction > 0))
        sequence.go_to(scale.neutral)
    sequence.finish()


def _part(axis: Axis, label: str, place: str, extending: bool) -> dict[str, Any]:
    return {
        "kind": _KIND, "label": label, "place": place, "extending": extending, "closed": axis.closed,
        "area_ratio": axis.area_ratio,
    }  # fmt: skip


def _one(recording: Recording, part: Mapping[str, Any]) -> tuple[dict[str, Any], float, float, bool]:
    """(curve, speed, standard uncertainty, whether it is steady)."""
    _, response = roles_of(recording)
    samples = recording.rows(part["first"], part["count"])
    time_s, position = samples.time_s - samples.time_s[0], samples.values(response.name)
    rows = _read(time_s, position, bool(part["closed"]))
    value, std, level = _line(time_s[rows], position[rows])
    half = (rows.stop - rows.start) // 2
    early, late = (_line(time_s[r], position[r])[0] for r in (
        slice(rows.start, rows.start + half), slice(rows.start + half, rows.stop)
    ))  # fmt: skip
    change = abs(late - early)
    picked = slice(None, None, max(1, len(time_s) // _MOST_POINTS))
    curve = {
        "label": part["label"], "response_unit": response.unit, "time_s": time_s[picked],
        "measured": position[picked], "fitted": (level + value * time_s)[picked],
        "from_s": float(time_s[rows.start]), "to_s": float(time_s[rows.stop - 1]), "speed_per_s": value,
    }  # fmt: skip
    # a change of the speed over the stretch moves its mean by up to a quarter of that
    return curve, value, math.hypot(std, change / 4.0), change <= max(_STEADY * abs(value), 6.0 * std)


def _read(time_s: Array, position: Array, closed: bool) -> slice:
    """Samples over which the speed is read: a stretch of the way, or of the time."""
    if not closed:
        low, high = (round(share * len(time_s)) for share in _OPEN_SHARES)
        return slice(low, max(high, low + _LEAST_SAMPLES))
    tail = max(1, len(position) // 20)
    way = (position - position[0]) / (float(np.mean(position[-tail:])) - position[0])
    low, high = (int(np.argmax(way >= share)) for share in _CLOSED_SHARES)
    return slice(low, max(high, low + _LEAST_SAMPLES))


def _line(time_s: Array, position: Array) -> tuple[float, float, float]:
    """Slope, its standard uncertainty, and the level at time 0 of a straight line."""
    line = weighted_line(time_s, position)
    middle_s, mean = line.middle
    return line.slope, line.slope_std() * math.sqrt(colour_factor(line.residuals)), mean - line.slope * middle_s


def _pairs(parts: Sequence[Mapping[str, Any]]) -> list[tuple[str, str, str]]:
    """(place, label extending, label retracting) of every level that was driven both ways."""
    labels: dict[str, dict[bool, str]] = {}
    for part in parts:
        labels.setdefault(part["place"], {})[bool(part["extending"])] = part["label"]
    return [(place, both[True], both[False]) for place, both in labels.items() if len(both) == 2]


def _areas(ratio: float, std: float, area_ratio: float) -> Note:
    """What a limited flow and what a constant pressure would make of the areas."""
    return Note(
        "retracts {ratio:.4f} ± {u:.4f} times as fast as it extends. By its areas it would be {areas:.4g} with the "
        "same flow both ways, and {edges:.3g} with equal edges at constant pressure and no load.",
        ratio=ratio, u=2.0 * std, areas=area_ratio, edges=1.0 / math.sqrt(area_ratio),
    )  # fmt: skip
