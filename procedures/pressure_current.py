"""Pressure over current of an EFC: the curve of the maker's inspection, with hysteresis, lag and direction.

Sweeps of the current up and down, once fast and once at half speed: what widens the loop with speed is the valve's lag,
what stays is hysteresis, twice the friction. The currents are those of the EFC thesis, figure 3.2 and section 3.1.3.2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hil.errors import InputError
from hil.identification.steady.characteristic import averaged_over, largest_slope, level_at, over_all, polyline
from hil.identification.steady.pressure_curve import PressureCurve, pressure_curve
from hil.identification.steady.sweep_estimate import Sweep
from hil.language.note import Note
from hil.physics.published.tugsal import STEP_CURRENTS_A
from hil.record.measurement import Findings, Measured, Measurement
from hil.record.recording import Array, Recording
from hil.rig import Rig
from hil.signals.interval import UNIFORM
from hil.signals.ramps import triangle
from hil.signals.rounding import mean_rounding_std, rounding_step
from procedures._definitions import SWEEPS, defined
from procedures._efc import Stage, held, part_recordings, play
from procedures._recorded import calibration_share, calibration_std, roles_of
from procedures._settings import Positive, PositiveAmpere
from procedures._statistics import extreme

PRESSURE = Measurement("pressure", "psi", "pressure at a current, middle of the loop")
SPAN = Measurement(
    "pressure_span", "psi", "change of pressure over the sweep, in the direction of the valve's type", 100.0
)
HYSTERESIS = Measurement("hysteresis", "mA", "width of the loop along the current that no speed explains")
LAG = Measurement("lag", "ms", "lag that widens the loop with the sweep's speed")
HALF = Measurement("current_half", "A", "current at half of the change of pressure")
STEEPEST = Measurement("slope_largest", "psi/A", "steepest slope of the curve")
MEASUREMENTS = defined(SWEEPS, PRESSURE, SPAN, HYSTERESIS, LAG, HALF, STEEPEST)
KIND = "pressure-current"


def run(
    rig: Rig,
    *,
    top_current: PositiveAmpere = 2.0,
    cycle_s: Positive = 20.0,
    normally_open: bool = False,
    rate_hz: Positive | None = None,
) -> list[Recording]:
    """Drive the sweeps; returns them, so that a sequence can go on from the curve.

    Args:
        rig: the bench.
        top_current: to which the current goes, in A.
        cycle_s: time of the first sweep up and down, in s; the second takes twice as long.
        normally_open: whether current closes the valve.
        rate_hz: sample rate; that of the bench when not given.
    """
    rate_hz = rig.actual_rate_hz(rate_hz)
    return play(rig, stages(top_current, cycle_s, normally_open, rate_hz), rate_hz)


def stages(top_current: float, cycle_s: float, normally_open: bool, rate_hz: float) -> list[Stage]:
    """The sweeps, the second at half the speed."""
    found = []
    for duration_s in (cycle_s, 2.0 * cycle_s):
        sweep = triangle(0.0, top_current, duration_s, rate_hz)
        part = {"kind": KIND, "speed_per_s": 2.0 * top_current / duration_s, "normally_open": normally_open}
        found.append(Stage(np.concatenate((held(0.0, 0.5, rate_hz), sweep)), f"sweep of {duration_s:g} s", part))
    return found


def curve_of(name: str, pieces: Sequence[tuple[float, Recording]], command: str, response: str) -> PressureCurve:
    """The curve of sweeps with their speeds."""
    return pressure_curve(
        name, [Sweep(p.values(command, "A"), p.values(response, "psi"), speed) for speed, p in pieces]
    )


def evaluate(recording: Recording) -> Findings:
    """The curve, its figures, and whether pressure follows current as the valve's type asks."""
    found = part_recordings(recording, KIND)
    if len(found) < 2:
        return Findings(tuple(m.of(None) for m in MEASUREMENTS), notes=(Note("The pressure curve was not measured."),))
    command, response = roles_of(recording)
    pieces = [(float(part["speed_per_s"]), samples) for part, samples in found]
    direction = -1.0 if found[0][0]["normally_open"] else 1.0
    curve = curve_of(recording.name, pieces, command.name, response.name)
    span = direction * curve.span
    estimate, share = curve.estimate, calibration_share(response)
    speeds = [speed for speed, _ in pieces]
    # the branches are shifted by the mean delay; how far the delays of the valve lie apart bends the curve a little
    bent = UNIFORM * averaged_over(estimate, speeds) ** 2
    noise_std = float(np.median(estimate.std * np.sqrt(estimate.points.count)))
    level_std = mean_rounding_std(noise_std, rounding_step(response.values))
    span_std = math.hypot(curve.span_std, level_std * math.sqrt(2.0))
    measured = [SPAN.of(span, span_std, calibration=share * abs(span))]
    notes = list(_notes(curve, span, direction))
    if abs(span) > 10.0 * curve.span_std:
        (steepest, steepest_std), _ = largest_slope(estimate, speeds)
        half = over_all(estimate, lambda p, _slope: level_at(estimate.command, p, (p[0] + p[-1]) / 2.0))
        points = [
            PRESSURE.at(f"{i:g} A").of(
                *_pressure_at(curve, i, math.hypot(level_std, bent * _curvature(curve, i))),
                calibration=calibration_std(response),
            )
            for i in STEP_CURRENTS_A
            if curve.current[0] <= i <= curve.current[-1] + 1e-9
        ]
        slope_share = math.hypot(share, calibration_share(command))
        measured += [
            *points,
            *_of_loop(curve),
            HALF.of(*half, calibration=calibration_std(command)),
            STEEPEST.of(steepest, steepest_std, calibration=slope_share * abs(steepest)),
        ]  # fmt: skip
    return Findings(
        tuple(measured), curves={"flow_curve": _curve(curve, command.unit, response.unit)}, notes=tuple(notes)
    )


def _pressure_at(curve: PressureCurve, current: float, level_std: float) -> tuple[float, float]:
    value, std = over_all(curve.estimate, lambda p, _slope: float(np.interp(current, curve.current, p)))
    return value, math.hypot(std, level_std)


def _curvature(curve: PressureCurve, current: float) -> float:
    """Of the curve at a current, in psi/A²."""
    bends = np.abs(np.gradient(curve.estimate.slope, curve.current))
    return float(np.interp(current, curve.current, bends))


def _of_loop(curve: PressureCurve) -> list[Measured]:
    """Hysteresis and lag."""
    if curve.loop.width is None or curve.loop.lag is None:
        return [HYSTERESIS.of(None), LAG.of(None)]
    width, width_std = curve.loop.width
    lag_s, lag_std_s = curve.loop.lag
    return [extreme(HYSTERESIS, 1e3 * width, 1e3 * width_std), LAG.of(1e3 * lag_s, 1e3 * lag_std_s)]


def _notes(curve: PressureCurve, span: float, direction: float) -> list[Note]:
    if abs(curve.span) <= max(10.0 * curve.span_std, 5.0):
        return [Note("Pressure does not follow the current: sensor stuck, valve stuck, or no supply pressure.")]
    if span < 0.0 < direction:
        return [Note("Current closes this valve; it was tested as one that current is to open: the type is wrong.")]
    if span < 0.0:
        return [Note("Current opens this valve; it was tested as one that current is to close: the type is wrong.")]
    return []


def _curve(curve: PressureCurve, command_unit: str, response_unit: str) -> dict[str, str | Array]:
    at = polyline()
    return {
        "command_unit": command_unit, "response_unit": response_unit, "command": curve.current[at],
        "rising": curve.rising[at], "falling": curve.falling[at], "std": curve.std[at],
    }  # fmt: skip


def checked_current(curve: PressureCurve, pressure: float, setting: str) -> float:
    """The current for a pressure.

    Raises:
        InputError: the curve does not reach it; names the setting that asked for it.
    """
    try:
        return curve.current_at(pressure)
    except InputError as error:
        raise InputError(f"setting {setting}: {error}") from None
