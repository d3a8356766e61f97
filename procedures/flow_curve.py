"""Flow curve: response over command, slowly up and down; dead band, hysteresis, symmetry, gain, linearity.

A triangle over the whole range, and once more at half speed: what widens the loop with speed is the valve's lag, and is
taken out; what stays is hysteresis. Works for any steady characteristic, pressure over current or position over
request as well.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from hil.errors import SettingError
from hil.identification.steady.flow_curve import monotone, polynomial, polynomial_text
from hil.record.measurement import Findings, Measured, Measurement
from hil.record.recording import Recording
from hil.rig import Rig
from hil.signals.interval import UNIFORM
from procedures._characteristic import Characteristic, Swept, characteristic, steady, swept
from procedures._definitions import SWEEPS, defined
from procedures._pressure_drop import pressure_drops
from procedures._recorded import calibration_std, departures, parts_of, roles_of
from procedures._run_sequence import RunSequence, check_cycle, joined, sweep, sweep_part
from procedures._scale import Scale, check_stands, scale_of
from procedures._settings import NotNegative, Once, Percent, Positive

MEASUREMENTS = defined(
    SWEEPS,
    Measurement("response_high", "", "response at the upper end of the sweep"),
    Measurement("response_low", "", "response at the lower end of the sweep"),
    Measurement("hysteresis", "%", "largest width of the loop along the command, in % of the swept command"),
    Measurement("dead_band_positive", "", "command above neutral at which the response begins"),
    Measurement("dead_band_negative", "", "command below neutral at which the response begins"),
    Measurement("gain_positive", "", "slope above neutral, 30 % to 90 % of the response there"),
    Measurement("gain_negative", "", "slope below neutral, 30 % to 90 % of the response there"),
    Measurement("symmetry", "", "gain of the weaker side over that of the stronger"),
    Measurement("linearity", "%", "largest departure from those slopes, in % of the response at the end"),
    Measurement("polarity", "", "1 where more command makes more response, −1 where it makes less"),
    Measurement("null_bias", "%", "command at which nothing flows, from neutral, in % of full command"),
    Measurement("lap", "%", "overlap, below 0 underlap, in % of full command"),
    Measurement("saturation_positive", "", "command above neutral from which the response rises no more"),
    Measurement("saturation_negative", "", "command below neutral from which the response falls no more"),
    Measurement("pressure_drop_high", "bar", "valve pressure drop of the response at the upper end"),
    Measurement("pressure_drop_low", "bar", "valve pressure drop of the response at the lower end"),
    Measurement("leakage", "", "steady response at neutral, before the sweep"),
    Measurement(
        "command_half", "", "command at which half of the response is reached; for a command that goes one way"
    ),
    Measurement("gain_largest", "", "steepest slope; for a command that goes one way"),
    Measurement("lag", "ms", "lag of the valve at the sweep's speed, from the repeat at half speed; taken out"),
)
_BY_NAME = {measurement.name: measurement for measurement in MEASUREMENTS}
_DEGREE = 9


def run(
    rig: Rig,
    *,
    low: Percent | None = None,
    high: Percent | None = None,
    cycle_s: Positive = 60.0,
    cycles: Once = 1,
    half_speed: bool = True,
    warm_up_s: NotNegative = 0.0,
    full_command: Positive | None = None,
    rate_hz: Positive | None = None,
) -> None:
    """Drive the sweeps.

    Args:
        rig: the bench.
        low: lower end, in % of full command from neutral; the lower end of the command's range when not given.
        high: upper end, in % of full command from neutral; the upper end of the command's range when not given.
        cycle_s: time of one sweep up and down, in s.
        cycles: how many sweeps.
        half_speed: whether to repeat a sweep at half speed, which tells lag from hysteresis.
        warm_up_s: time at the beginning of the sweep before anything is measured, in s.
        full_command: what 100 % is, in the unit of the command; the farther end of its range when not given.
        rate_hz: sample rate; that of the bench when not given.
    """
    rate_hz = rig.actual_rate_hz(rate_hz)
    check_cycle(rig, cycle_s, rate_hz)
    scale = scale_of(rig, full_command)
    check_stands(scale, "a flow curve")
    bottom, top = _ends(scale, low, high)
    speeds = [(cycle_s, cycles), *([(2.0 * cycle_s, 1)] if half_speed else [])]
    sweeps = [sweep(rig, bottom, top, duration_s, rate_hz, count) for duration_s, count in speeds]
    sequence = RunSequence(rig, rate_hz, joined(rig, rate_hz, warm_up_s, sweeps), {"from": bottom, "to": top})
    sequence.play(np.full(max(1, round(rig.settling_s * rate_hz)), scale.neutral), "neutral", {"kind": "neutral"})
    sequence.warm_up(bottom, warm_up_s)
    for path, (duration_s, _) in zip(sweeps, speeds, strict=True):
        sequence.go_to(bottom)
        part = {"kind": "sweep", **sweep_part(rig, scale, bottom, top, duration_s)}
        sequence.play(path, f"sweep of {duration_s:g} s", part)
    sequence.finish()


def evaluate(recording: Recording) -> Findings:
    """The curve without the valve's lag, its figures, and the repeat at half speed beside it."""
    parts = parts_of(recording, "sweep")
    _, response = roles_of(recording)
    zero, zero_std = steady(recording, parts_of(recording, "neutral")[0], response)
    sweeps = swept(recording, parts[:2])
    neutral = parts_of(recording, "neutral")[0]
    crept = sweeps.creep_per_s * (neutral["first"] + neutral["count"]) * recording.interval_s
    zero_std = math.hypot(zero_std, 2.0 * UNIFORM * crept)
    curve = characteristic(sweeps, parts[0], (zero, zero_std), _BY_NAME)
    leakage = _BY_NAME["leakage"].at(unit=response.unit).of(zero, zero_std, calibration=calibration_std(response))
    drops = pressure_drops(recording, parts[:2], _BY_NAME)
    return Findings(
        measured=(*curve.measured, _polarity(sweeps), *drops, leakage),
        curves={"flow_curve": _curve(recording, curve)},
        notes=curve.notes,
        deviations=departures(recording),
    )


def _polarity(sweeps: Swept) -> Measured:
    """Of a curve whose ends differ beyond noise: without that there is no curve."""
    return _BY_NAME["polarity"].of(math.copysign(1.0, sweeps.high.response - sweeps.low.response), 0.0)


def _ends(scale: Scale, low: float | None, high: float | None) -> tuple[float, float]:
    bottom = scale.command.low if low is None else scale.level("low", low)
    top = scale.command.high if high is None else scale.level("high", high)
    if not bottom < top:
        unit = scale.command.unit
        raise SettingError(f"settings low and high: from {bottom:g} {unit} to {top:g} {unit}; high must be above low")
    return bottom, top


def _curve(recording: Recording, curve: Characteristic) -> Mapping[str, Any]:
    command, response = roles_of(recording)
    nominal = (curve.rising + curve.falling) / 2.0
    fitted = polynomial(curve.command, nominal, _DEGREE)
    return {
        "command_unit": command.unit,
        "response_unit": response.unit,
        "command": curve.command,
        "rising": curve.rising,
        "falling": curve.falling,
        "std": curve.std,
        "spline": monotone(curve.command, nominal)(curve.command),
        "polynomial": fitted(curve.command),
        "polynomial_text": polynomial_text(curve.command, nominal, _DEGREE),
        "dead_band": curve.dead_band,
        "half_speed": None
        if curve.half_speed is None
        else {"command": curve.command, "rising": curve.half_speed[0], "falling": curve.half_speed[1]},
    }
