"""Cylinder drift: how far a cylinder creeps while its command stands, and how restless it is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval

from hil.errors import SettingError
from hil.identification.uncertainty.parametric_bootstrap import DRAWS, about, draws_of
from hil.language.note import Note
from hil.record.measurement import Findings, Measured, Measurement
from hil.record.recording import Array, Channel, Recording
from hil.rig import Rig
from hil.signals.colour import colour_factor
from hil.signals.rounding import mean_rounding_std
from hil.signals.smooth_curve import Smoother
from hil.signals.straight_line import weighted_line
from hil.units import is_convertible, scale_and_offset
from procedures._cylinder import position_per_mm
from procedures._definitions import CYLINDERS, defined
from procedures._recorded import calibration_std, departures, parts_of, reading_step, roles_of
from procedures._run_sequence import RunSequence, joined
from procedures._scale import check_above, scale_of
from procedures._settings import Percent, Positive
from procedures._statistics import extreme

RATE = Measurement("drift_rate", "", "rate of the position while the command stands")
DRIFT = Measurement("drift", "", "largest less smallest position, of a smooth curve through one-second means")
RESTLESSNESS = Measurement(
    "restlessness", "", "standard deviation of the position about its drift, sensor noise included"
)
OFFSET = Measurement("offset", "", "position less command, in a closed loop")
MEASUREMENTS = defined(CYLINDERS, RATE, DRIFT, RESTLESSNESS, OFFSET)

_KIND = "drift"
_LEAST_S = 5.0
_MEAN_S = 1.0
_LEAST_COEFFICIENTS = 5


def run(
    rig: Rig,
    *,
    levels: tuple[Percent, ...] | None = None,
    duration_s: Annotated[float, Interval(ge=_LEAST_S)] = 60.0,
    settle_s: Positive | None = None,
    full_command: Positive | None = None,
    rate_hz: Positive | None = None,
) -> None:
    """Stand still at each level and record.

    Args:
        rig: the bench.
        levels: in % of full command. Neutral when not given, the only place where an open loop stands; a closed loop
            can stand anywhere.
        duration_s: time at each level over which the drift is measured, at least 5 s.
        settle_s: time at each level before that; three settling times of the valve when not given.
        full_command: what 100 % is, in the unit of the command; the farther end of its range when not given.
        rate_hz: sample rate; that of the bench when not given.
    """
    position_per_mm(rig)
    rate_hz = rig.actual_rate_hz(rate_hz)
    waited_s = 3.0 * rig.settling_s if settle_s is None else settle_s
    check_above("settle_s", 0.0, waited_s, "s")
    scale = scale_of(rig, full_command)
    asked = (0.0,) if levels is None else levels
    if not asked:
        raise SettingError("setting levels: none given")
    if any(percent != 0.0 for percent in asked) and not is_convertible(rig.command.unit, rig.response.unit):
        raise SettingError(
            f"setting levels: {', '.join(f'{p:g}' for p in asked)} %; a command in {rig.command.unit} moves the "
            f"'{rig.response.name}' all the time, so only 0 % is allowed"
        )
    values = [scale.level("levels", percent) for percent in asked]
    waves = [np.full(round((waited_s + duration_s) * rate_hz), value) for value in values]
    sequence = RunSequence(rig, rate_hz, joined(rig, rate_hz, 0.0, waves), {"levels": values})
    for value, wave in zip(values, waves, strict=True):
        sequence.go_to(value)
        sequence.play(wave, f"standing at {value:.4g} {rig.command.unit}")
        rig.mark(round(duration_s * rate_hz), {"kind": _KIND, "level": value})
    sequence.finish()


def evaluate(recording: Recording) -> Findings:
    """Rate, way and restlessness at each level."""
    command, response = roles_of(recording)
    closed = is_convertible(command.unit, response.unit)
    level_std = _level_std(command, response) if closed else 0.0
    measured: list[Measured] = []
    curves = []
    for part in parts_of(recording, _KIND):
        place = f"{part['level']:.4g} {command.unit}"
        curve, found = _one(recording, part)
        measured += [
            RATE.at(place, f"{response.unit}/min").of(60.0 * found["slope"], 60.0 * found["slope_std"]),
            extreme(DRIFT.at(place, response.unit), found["way"], found["way_std"]),
            _restlessness(RESTLESSNESS.at(place, response.unit), found, reading_step(recording, response)),
        ]
        if closed:
            measured.append(
                OFFSET.at(place, response.unit).of(*_offset(part, command.unit, response, found), calibration=level_std)
            )
        curves.append({"label": place, "response_unit": response.unit, **curve})
    return Findings(tuple(measured), {"drift": curves}, (_note(closed),), departures(recording))


def _one(recording: Recording, part: Mapping[str, Any]) -> tuple[dict[str, Array], dict[str, float]]:
    _, response = roles_of(recording)
    samples = recording.rows(part["first"], part["count"])
    time_s, position = samples.time_s - samples.time_s[0], samples.values(response.name)
    line = weighted_line(time_s, position)
    middle_s, mean = line.middle
    colour, noise = colour_factor(line.residuals), float(np.std(line.residuals))
    count = max(1, round(_MEAN_S / samples.interval_s))
    blocks = [values[: len(values) // count * count].reshape(-1, count).mean(axis=1) for values in (time_s, position)]
    way, way_std = _way(*blocks)
    # between two ends, each anywhere within a code that noise does not spread
    hidden = mean_rounding_std(noise, reading_step(recording, response))
    apart = math.sqrt(2.0) * hidden
    return {"time_s": blocks[0], "position": blocks[1], "fitted": mean + line.slope * (blocks[0] - middle_s)}, {
        "slope": line.slope,
        "slope_std": math.hypot(line.slope_std() * math.sqrt(colour), apart / float(np.ptp(time_s))),
        "restless": noise, "restless_std": noise * math.sqrt(colour / (2.0 * len(position))),
        "way": way, "way_std": math.hypot(way_std, apart), "mean": mean,
        "mean_std": math.hypot(noise * math.sqrt(colour / len(position)), hidden),
    }  # fmt: skip


def _restlessness(what: Measurement, found: Mapping[str, float], grid: float) -> Measured:
    """How restless the position is; less than a step of the converter cannot be told."""
    if found["restless"] == 0.0:
        return what.of(None)
    if found["restless"] < grid:
        return what.of(grid, 0.0, relation="<")
    return what.of(found["restless"], found["restless_std"])


def _way(time_s: Array, position: Array) -> tuple[float, float]:
    """Largest less smallest of a smooth curve through the means of each second, and its standard uncertainty."""
    smoother = Smoother.on(time_s, max(_LEAST_COEFFICIENTS, len(time_s) // 2))
    found = smoother.curves(position)
    curve = smoother.at(found)[0]
    noise = draws_of(position).normal(size=(DRAWS, len(curve)))
    again = smoother.at(smoother.curves(curve + float(found.noise_std[0]) * noise))
    way = float(np.ptp(curve))
    return way, about(np.ptp(again, axis=1), way)


def _offset(
    part: Mapping[str, Any], command_unit: str, response: Channel, found: Mapping[str, float]
) -> tuple[float, float]:
    per, zero = scale_and_offset(command_unit, response.unit)
    return found["mean"] - per * float(part["level"]) - zero, found["mean_std"]


def _level_std(command: Channel, response: Channel) -> float:
    """Of a difference between the two, by their calibrations."""
    per, _ = scale_and_offset(command.unit, response.unit)
    return math.hypot(calibration_std(response), per * calibration_std(command))


def _note(closed: bool) -> Note:
    if closed:
        return Note(
            "The loop was closed: what is left of the drift is what the controller lets pass. Leakage past spool and "
            "piston shows as an offset in its place."
        )
    return Note("The loop was open: the drift is that of cylinder, load and valve at neutral.")
