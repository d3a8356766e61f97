"""Large sine: a few slow sines over the whole range; amplitude, phase and distortion where the valve is not linear.

The HPV41 paper verifies its model with 70 l/min at 0.1, 0.3 and 0.5 Hz; `hil compare` holds a model against the
recording that this leaves.
"""

from __future__ import annotations

import math

from hil.errors import SettingError
from hil.identification.frequency.sine_segments import declared_segments
from hil.language.note import Note
from hil.record.measurement import Findings, Measured
from hil.record.recording import Recording
from hil.rig import Rig
from hil.signals.harmonic_order import sine_fit_beyond
from hil.signals.interval import CERTAIN
from hil.signals.rounding import mean_rounding_std, rounding_step
from hil.signals.sine_fit import SineFit
from hil.signals.stepped_sine import check_frequencies, sine
from procedures._recorded import departures, parts_of, roles_of
from procedures._run_sequence import RunSequence, joined
from procedures._scale import Scale, check_stands, scale_of
from procedures._settings import NotNegative, Once, Percent, Positive, PositiveHertz, PositivePercent
from procedures._sine import HARMONICS, MEASURED, curve, figures

MEASUREMENTS = MEASURED


def run(
    rig: Rig,
    *,
    frequencies: tuple[PositiveHertz, ...] = (0.1, 0.3, 0.5),
    amplitude: PositivePercent | None = None,
    bias: Percent | None = None,
    cycles: Once = 3,
    warm_up_s: NotNegative = 0.0,
    full_command: Positive | None = None,
    rate_hz: Positive | None = None,
) -> None:
    """Drive the sines.

    Args:
        rig: the bench.
        frequencies: in Hz, rising.
        amplitude: in % of full command; as far as the range goes about the bias when not given. To be given where the
            response integrates.
        bias: in % of full command from neutral; neutral when not given, the middle of the range for a command
            that goes one way.
        cycles: periods of each that are measured, after at least one to settle.
        warm_up_s: time at the bias before anything is measured, in s.
        full_command: what 100 % is, in the unit of the command; the farther end of its range when not given.
        rate_hz: sample rate; that of the bench when not given. At least 20 times the top frequency.
    """
    rate_hz = rig.actual_rate_hz(rate_hz)
    check_frequencies(frequencies, rate_hz)
    middle, size = _level(scale_of(rig, full_command), amplitude, bias)
    settling = [max(1, math.ceil(rig.settling_s * f)) for f in frequencies]
    waves = [
        sine(f, size, rate_hz, settle + cycles, bias=middle) for f, settle in zip(frequencies, settling, strict=True)
    ]
    sequence = RunSequence(rig, rate_hz, joined(rig, rate_hz, warm_up_s, waves), {"amplitude": size, "bias": middle})
    sequence.warm_up(middle, warm_up_s)
    for f, settle, wave in zip(frequencies, settling, waves, strict=True):
        sequence.go_to(middle)
        sequence.play(wave, f"{f:g} Hz, {middle:+.3g} ± {size:.3g} {rig.command.unit}")
        measured = len(wave) - round(settle * rate_hz / f)
        rig.mark(measured, {"kind": "sine", "frequency_hz": f, "amplitude": size, "bias": middle})
    sequence.finish()


def evaluate(recording: Recording) -> Findings:
    """Amplitude, phase, mean and distortion at each frequency."""
    parts_of(recording, "sine")
    command, response = roles_of(recording)
    measured: list[Measured] = []
    curves = []
    creep_per_s = 0.0
    for segment in declared_segments(recording):
        rows = segment.samples
        time_s = recording.time_s[rows]
        given, answer = (
            sine_fit_beyond(
                recording.stamps(c.name)[rows], c.values[rows], segment.frequency_hz,
                harmonics=HARMONICS, drift_order=order,
            )
            for c, order in ((command, 0), (response, 1))
        )  # fmt: skip
        middle_s = float(time_s[0] + time_s[-1]) / 2.0 - float(recording.time_s[0])
        creep_per_s = max(creep_per_s, _creep_per_s(answer, float(time_s[-1] - time_s[0])))
        # a sine that goes to the ends of a range stands there: rounding is that of a level
        rounding = mean_rounding_std(answer.residual_std, rounding_step(response.values))
        place = f"{segment.frequency_hz:g} Hz"
        measured += figures(recording, place, given, answer, rounding, creep_per_s * middle_s)
        curves.append(curve(recording, rows, segment, place, answer))
    notes = (_crept(creep_per_s, response.unit),) if creep_per_s else ()
    return Findings(tuple(measured), {"large_sines": curves}, notes, departures(recording))


def _level(scale: Scale, amplitude: float | None, bias: float | None) -> tuple[float, float]:
    """(bias, amplitude) in the unit of the command."""
    middle = scale.centre if bias is None else scale.middle("bias", bias)
    if amplitude is None:
        check_stands(scale, "a sine over the whole range", "give an amplitude, or run sine_position")
        size = min(scale.command.high - middle, middle - scale.command.low)
        if not size > 0.0:
            raise SettingError(f"setting bias: {bias:g} % is an end of the range and leaves no room for an amplitude")
        return middle, size
    return middle, scale.amplitude_about("amplitude", amplitude, middle)


def _creep_per_s(fit: SineFit, duration_s: float) -> float:
    """Size of a straight drift beyond noise, in the response's unit per second; 0 for none."""
    change, std = float(fit.drift[0]), math.sqrt(float(fit.covariance[-1, -1]))
    return 2.0 * abs(change) / duration_s if abs(change) > CERTAIN * std else 0.0


def _crept(creep_per_s: float, unit: str) -> Note:
    return Note(
        "The response drifts by up to {creep_per_s:.2g} {unit}/s beneath the sines. That is taken out of amplitude and "
        "phase. How far it has moved the mean since the recording began is in the uncertainty of the mean.",
        creep_per_s=creep_per_s, unit=unit,
    )  # fmt: skip
