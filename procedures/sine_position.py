"""Sine position: a slow sine about an offset on each side, of a cylinder's position in an open or a closed loop.

The test of the SP08-47C paper: 5 V at 1 rad/s about 5 V, each direction for itself. Whether the stroke is long enough
is worked out before anything moves; with the paper's numbers in an open loop it is not, so there it is faster.
"""

from __future__ import annotations

import math

import numpy as np

from hil.errors import InputError, SettingError
from hil.identification.frequency.sine_segments import Segment, declared_segments
from hil.identification.steady.characteristic import ratio_of
from hil.language.note import Note
from hil.record.measurement import Findings, Measured, Measurement
from hil.record.recording import Array, Recording
from hil.rig import Rig
from hil.signals.harmonic_order import sine_fit_beyond
from hil.signals.rounding import rounding_step
from hil.signals.sine_fit import SineFit, sine_fit, with_rounding
from hil.signals.stepped_sine import check_frequencies, sine
from procedures._cylinder import Axis, approach, axis_of
from procedures._definitions import SINES, defined
from procedures._recorded import calibration_share, departures, parts_of, roles_of
from procedures._run_sequence import RunSequence, joined
from procedures._scale import Scale, scale_of
from procedures._settings import NotNegative, NotNegativePercent, Once, Positive, PositivePercent
from procedures._sine import HARMONICS, MEASURED, curve, figures

GAIN = Measurement("gain", "", "amplitude of position over command; in an open loop of speed over command")
RATIO = Measurement("direction_ratio", "1", "gain of the positive side over that of the negative side")
MEASUREMENTS = (*MEASURED, *defined(SINES, GAIN, RATIO))

_PAPER_RAD_S = 1.0
_SETTLING = 0.1  # of the measured sine: the model starts from rest, the cylinder was moving


def run(
    rig: Rig,
    *,
    amplitude: PositivePercent = 50.0,
    offset: NotNegativePercent | None = None,
    frequency_rad_s: Positive | None = None,
    cycles: Once = 3,
    stroke_mm: Positive = 250.0,
    retracted_mm: float | None = None,
    bore_mm: Positive = 50.0,
    rod_mm: Positive = 30.0,
    full_flow_lpm: Positive = 11.4,
    warm_up_s: NotNegative = 0.0,
    full_command: Positive | None = None,
    rate_hz: Positive | None = None,
) -> None:
    """Drive a sine on the positive side of neutral, then one on the negative side.

    In a closed loop (the command is a position) the sine is a position. In an open loop it is an opening, the cylinder
    goes one way all the time, and is brought to the end where it has the way before it.

    Args:
        rig: the bench.
        amplitude: in % of full command.
        offset: in % of full command, without sign; the amplitude when not given, so that a side is never left.
        frequency_rad_s: angular frequency; when not given 1 rad/s, as in the paper, or in an open loop as many whole
            rad/s as the stroke asks for.
        cycles: periods that are measured; in an open loop all that are driven.
        stroke_mm: of the cylinder.
        retracted_mm: reading at the retracted end; minus half the stroke when not given.
        bore_mm: diameter of the piston.
        rod_mm: diameter of the rod.
        full_flow_lpm: flow at full command, which limits the speed.
        warm_up_s: time at the first level before anything is measured, in s.
        full_command: what 100 % is, in the unit of the command; the farther end of its range when not given.
        rate_hz: sample rate; that of the bench when not given. At least 20 times the frequency.
    """
    rate_hz = rig.actual_rate_hz(rate_hz)
    axis = axis_of(rig, stroke_mm, retracted_mm, bore_mm, rod_mm, full_flow_lpm)
    scale = scale_of(rig, full_command)
    share = amplitude if offset is None else offset
    if frequency_rad_s is None:
        slowest_rad_s = 0.0 if axis.closed else _slowest_rad_s(axis, share, cycles)
        frequency_rad_s = max(_PAPER_RAD_S, math.ceil(slowest_rad_s))
    frequency_hz = frequency_rad_s / (2.0 * math.pi)
    check_frequencies((frequency_hz,), rate_hz)
    size, middles = _levels(scale, amplitude, share)
    if axis.closed:
        _check_closed(axis, amplitude, share, size, middles, frequency_rad_s)
    else:
        _check_open(axis, amplitude, share, cycles, frequency_rad_s)
    settle = max(1, math.ceil(rig.settling_s * frequency_hz)) if axis.closed else 0
    waves = [_wave(axis, frequency_hz, size, rate_hz, settle + cycles, middle, scale.neutral) for middle in middles]
    opening = _opening(size, middles[0] - scale.neutral)
    ways = [] if axis.closed else [np.array([scale.neutral + opening]), np.array([scale.neutral - opening])]
    plan = {"amplitude": size, "middles": middles, "closed loop": axis.closed}
    sequence = RunSequence(rig, rate_hz, joined(rig, rate_hz, warm_up_s, [*ways, *waves]), plan)
    sequence.warm_up(middles[0] if axis.closed else scale.neutral, warm_up_s)
    for middle, wave, direction in zip(middles, waves, (1, -1), strict=True):
        if not axis.closed:
            speed_per_s = axis.speed_per_s(-direction) * opening / scale.full
            approach(rig, sequence, axis.low if direction > 0 else axis.high, opening, speed_per_s)
        sequence.go_to(float(wave[0]))
        sequence.play(wave, f"{frequency_rad_s:g} rad/s, {middle:+.3g} ± {size:.3g} {rig.command.unit}")
        measured = len(wave) - round(settle * rate_hz / frequency_hz)
        part = {"kind": "sine", "frequency_hz": frequency_hz, "amplitude": size, "bias": middle, "closed": axis.closed}
        rig.mark(measured, part)
    sequence.finish()


def evaluate(recording: Recording) -> Findings:
    """Amplitude, phase, gain and distortion on each side, and what a process model makes of them."""
    closed = bool(parts_of(recording, "sine")[0]["closed"])
    command, response = roles_of(recording)
    share = math.hypot(calibration_share(response), calibration_share(command))
    measured: list[Measured] = []
    curves, notes, gains = [], [], []
    grid = rounding_step(response.values)
    for segment in declared_segments(recording):
        rows = segment.samples if closed else _under_way(segment, recording.interval_s)
        time_s = recording.time_s[rows]
        given = sine_fit(time_s, command.values[rows], segment.frequency_hz, harmonics=1)
        answer = sine_fit_beyond(
            recording.stamps(response.name)[rows], response.values[rows], segment.frequency_hz, harmonics=HARMONICS,
            drift_order=1,
        )  # fmt: skip
        answer = with_rounding(answer, grid)
        place = f"{segment.bias:+.4g} ± {segment.amplitude:.4g} {command.unit}"
        measured += figures(recording, place, given, answer)
        gain = _gain(given, answer, closed)
        gains.append(gain)
        unit = f"{response.unit}{'' if closed else '/s'} per {command.unit}"
        measured.append(GAIN.at(place, unit).of(*gain, calibration=share * gain[0]))
        curves.append(curve(recording, rows, segment, place, answer))
        notes.append(_model_note(recording, rows, place, closed))
    if len(gains) == 2:
        measured.append(RATIO.of(*ratio_of(*gains)))
    notes.append(Note(
        "One sine determines a gain and one time; for an order, dead time or resonance run multisine_response "
        "or step_response."
    ))  # fmt: skip
    return Findings(tuple(measured), {"large_sines": curves}, tuple(notes), departures(recording))


def _levels(scale: Scale, amplitude: float, offset: float) -> tuple[float, tuple[float, float]]:
    """Amplitude and the two middles in the unit of the command."""
    middles = (scale.level("offset", offset), scale.level("offset", -offset))
    size, _ = (scale.amplitude_about("amplitude", amplitude, middle) for middle in middles)
    return size, middles


def _check_closed(
    axis: Axis, amplitude: float, offset: float, size: float, middles: tuple[float, float], frequency_rad_s: float
) -> None:
    given = f"{amplitude:g} % about ±{offset:g} %"
    axis.check_position("amplitude", given, min(middles) - size, max(middles) + size)
    needed, able = size * frequency_rad_s, axis.extend_per_s
    if needed > able:
        raise SettingError(
            f"setting frequency_rad_s: {given} at {frequency_rad_s:g} rad/s needs {needed:.4g} {axis.unit}/s; the full "
            f"flow extends at {able:.4g} {axis.unit}/s: at most {able / size:.3g} rad/s"
        )


def _check_open(axis: Axis, amplitude: float, offset: float, cycles: int, frequency_rad_s: float) -> None:
    """The way of the sine into one direction, at the rated speed, against the stroke."""
    if offset < amplitude:
        raise SettingError(
            f"setting offset: {offset:g} % is below the amplitude, {amplitude:g} %; the cylinder would turn, and each "
            "direction is measured by itself"
        )
    period_s = 2.0 * math.pi / frequency_rad_s
    fastest = max(axis.extend_per_s, axis.retract_per_s)
    able = axis.high - axis.low
    for speed, word in ((axis.extend_per_s, "extending"), (axis.retract_per_s, "retracting")):
        way = offset / 100.0 * speed * period_s
        if cycles * way > able:
            slower = 100.0 * able / (cycles * fastest * period_s)
            faster = _slowest_rad_s(axis, offset, cycles)
            raise SettingError(
                f"setting offset: {amplitude:g} % about {offset:g} % at {frequency_rad_s:g} rad/s goes {way:.4g} "
                f"{axis.unit} {word} in each period, {cycles * way:.4g} {axis.unit} in {cycles}; of the stroke of "
                f"{axis.stroke:g} {axis.unit}, {able:.4g} {axis.unit} can be used: at most {slower:.2g} % at this "
                f"frequency, or at least {faster:.3g} rad/s at this offset"
            )


def _slowest_rad_s(axis: Axis, offset: float, cycles: int) -> float:
    """The frequency at which a sine of an open loop uses the whole stroke, in the direction that goes faster."""
    fastest = max(axis.extend_per_s, axis.retract_per_s)
    return cycles * offset / 100.0 * fastest * 2.0 * math.pi / (axis.high - axis.low)


def _wave(
    axis: Axis, frequency_hz: float, size: float, rate_hz: float, periods: int, middle: float, neutral: float
) -> Array:
    """From the middle in a closed loop; in an open one from where it is nearest to neutral."""
    phase_rad = 0.0 if axis.closed else -math.copysign(math.pi / 2.0, middle - neutral)
    return sine(frequency_hz, size, rate_hz, periods, bias=middle, phase_rad=phase_rad)


def _opening(size: float, middle: float) -> float:
    """With which an open cylinder is brought to its end: the largest of the sine."""
    return size + abs(middle)


def _under_way(segment: Segment, interval_s: float) -> slice:
    """Samples of an open loop without the first period, in which the cylinder gets going."""
    period = round(1.0 / (segment.frequency_hz * interval_s))
    return slice(segment.first + (period if segment.count >= 2 * period - 1 else 0), segment.first + segment.count)


def _gain(given: SineFit, answer: SineFit, closed: bool) -> tuple[float, float]:
    """Gain and its standard uncertainty; of the speed where the loop is open."""
    per_s = 1.0 if closed else 2.0 * math.pi * given.frequency_hz
    value, std = ratio_of((answer.amplitude, answer.amplitude_std), (given.amplitude, given.amplitude_std))
    return per_s * value, per_s * std


def _model_note(recording: Recording, rows: slice, place: str, closed: bool) -> Note:
    """Gain and time of the first-order model that one sine supports, with its fit to the same data."""
    from hil.identification.papers.first_order import first_order

    command, response = roles_of(recording)
    part = recording.rows(rows.start, rows.stop - rows.start)
    skip_s = _SETTLING * part.duration_s
    try:
        found = first_order(part, command.name, response.name, integrates=not closed, skip_s=skip_s)
    except InputError as error:
        return Note("no process model: {why}.", why=str(error)).at(place)
    return found.note(command.unit, response.unit).at(place)
