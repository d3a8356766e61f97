"""Frequency response by stepped sine: amplitude ratio, phase, −3 dB and −90° frequencies, transfer functions.

One sine after another about a bias, each until the response is steady and has been measured over whole periods.
Structure and terms follow ISO 10770-1 (docs/explanation/standard.md); frequencies, amplitudes and biases are those
of the HPV41 paper, and data.
"""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np

from hil.identification.frequency.frequency_response import DISTORTION_FLAG, FrequencyResponse
from hil.identification.frequency.sine_segments import Segment, declared_segments, frequency_responses, hum_beneath
from hil.identification.uncertainty.parametric_bootstrap import DRAWS, draws_of
from hil.language.note import Note
from hil.physics.published.tordal import FREQUENCIES_HZ
from hil.record.measurement import Findings, Measured, Measurement
from hil.record.recording import Array, Mask, Recording
from hil.rig import Rig
from hil.signals.stepped_sine import check_frequencies
from procedures._definitions import FREQUENCIES, defined
from procedures._recorded import departures, parts_of, roles_of
from procedures._response import (
    MEASURED,
    Evaluated,
    chain_notes,
    evaluated,
    reference_deviations,
)
from procedures._run_sequence import RunSequence, joined
from procedures._scale import about_levels, check_form_asked, scale_of
from procedures._settings import NotNegative, Percent, Poles, Positive, PositiveHertz, PositivePercent, Twice, Zeros
from procedures._sine import overlay
from procedures._statistics import extreme
from procedures._steady_sine import Heard, Patience, Tone, heard_before, listen, steady_path

THD = Measurement("thd", "%", "largest distortion of the response beyond noise: harmonics 2 to 5 over the fundamental")
MEASUREMENTS = defined(FREQUENCIES, *MEASURED, THD)
RESUMABLE = True

_STANDARD_HZ, _STANDARD_SHARE = 5.0, 0.05  # reference: the first, or this share of the −90° frequency if that is less


def run(
    rig: Rig,
    *,
    frequencies: tuple[PositiveHertz, ...] = FREQUENCIES_HZ,
    amplitudes: tuple[PositivePercent, ...] = (5.0, 10.0, 20.0),
    biases: tuple[Percent, ...] | None = None,
    reference: Literal["lowest", "standard"] = "lowest",
    measure_periods: Twice = 3,
    measure_s: NotNegative = 5.0,
    tolerance: PositivePercent = 0.2,
    longest_wait_s: NotNegative = 30.0,
    warm_up_s: NotNegative = 0.0,
    correct_chain: bool = True,
    poles: Poles | None = 3,
    zeros: Zeros | None = None,
    dead_time: bool | None = None,  # noqa: ARG001 — for the evaluation
    full_command: Positive | None = None,
    rate_hz: Positive | None = None,
) -> None:
    """Drive the stepped sines.

    Args:
        rig: the bench.
        frequencies: in Hz, rising.
        amplitudes: of the sines, in % of full command.
        biases: about which they swing, in % of full command from neutral. When not given: the bench's operating point,
            else ±50, the middle of a one-way command, or 0 where the response integrates.
        reference: where 0 dB is: at the lowest frequency, or as the standard asks. That is 5 Hz or 5 % of the −90°
            frequency, whichever is less; it is measured where no line is so low.
        measure_periods: least number of whole periods that are measured, 2 or more.
        measure_s: least time that is measured, in s.
        tolerance: change still to come at which a response counts as steady, in % of its amplitude.
        longest_wait_s: time after which a response is measured even if it is not steady, in s.
        warm_up_s: time at the first bias before anything is measured, in s.
        correct_chain: take the measuring chain's own lag, skew and hold out of the results.
        poles: of the transfer function, 1 to 5; chosen by evidence when "none".
        zeros: of the transfer function; chosen by evidence when not given.
        dead_time: whether the transfer function has one; chosen by evidence when not given.
        full_command: what 100 % is, in the unit of the command; the farther end of its range when not given.
        rate_hz: sample rate; that of the bench when not given. At least 20 times the top frequency.
    """
    rate_hz = rig.actual_rate_hz(rate_hz)
    check_frequencies(frequencies, rate_hz)
    levels = about_levels(scale_of(rig, full_command), amplitudes, biases)
    check_form_asked(poles, zeros)
    patience = Patience(rig.settling_s, measure_periods, measure_s, tolerance / 100.0, longest_wait_s)
    sweeps = [[Tone(f, amplitude, bias) for f in frequencies] for bias, amplitude in levels]
    path = joined(rig, rate_hz, warm_up_s, [steady_path(sweep, patience, rate_hz) for sweep in sweeps])
    sequence = RunSequence(
        rig, rate_hz, path,
        {"sines": len(levels) * len(frequencies), "reference": reference, "correct_chain": correct_chain},
    )  # fmt: skip
    sequence.warm_up(levels[0][0], warm_up_s)
    for sweep in sweeps:
        _sweep(rig, sequence, sweep, patience, reference)
    sequence.finish()


def evaluate(recording: Recording) -> Findings:
    """Responses with uncertainty, bandwidths, distortion and transfer functions, one for each bias and amplitude."""
    command, response = roles_of(recording)
    parts = parts_of(recording, "sine")
    found = evaluated(recording, frequency_responses(recording, command.name, response.name))
    top = max(found, key=lambda one: float(one.response.frequency_hz[-1])).response
    notes, deviations = chain_notes(recording, top.frequency_hz)
    segments = declared_segments(recording)
    hum_hz = hum_beneath(recording, response.name, segments)
    hummed = {one.label: _hummed(one.response, segments, recording, hum_hz) for one in found}
    return Findings(
        measured=tuple(m for one in found for m in (*one.measured(), _distortion(one, hummed[one.label]))),
        curves={"responses": [_curve(recording, one, segments) for one in found]},
        notes=(
            *notes,
            *(note for one in found for note in (*one.explained(), *_distorted(one))),
            *(_hum_note(one, hummed[one.label], hum_hz) for one in found if hummed[one.label].any()),
        ),
        deviations=(*deviations, *reference_deviations(found), *_unsteady(parts), *departures(recording)),
    )


def _sweep(
    rig: Rig, sequence: RunSequence, sweep: list[Tone], patience: Patience, reference: Literal["lowest", "standard"]
) -> None:
    """All frequencies about one bias at one amplitude, and the reference of the standard if it lies below them."""
    first = sweep[0]
    if any(heard_before(rig, tone) is None for tone in sweep):
        sequence.go_to(first.bias)
    phase_rad = 0.0
    found: list[Heard] = []
    for tone in sweep:
        heard = heard_before(rig, tone)
        if heard is None:
            heard = _listened(rig, sequence, tone, patience, phase_rad)
            phase_rad = heard.phase_rad
        found.append(heard)
    wanted_hz = _reference_hz(np.array([tone.frequency_hz for tone in sweep]), np.array([h.response for h in found]))
    if reference == "standard" and wanted_hz is not None and wanted_hz < first.frequency_hz:
        lowest = Tone(wanted_hz, first.amplitude, first.bias)
        if heard_before(rig, lowest) is None:
            _listened(rig, sequence, lowest, patience, phase_rad)


def _listened(rig: Rig, sequence: RunSequence, tone: Tone, patience: Patience, phase_rad: float) -> Heard:
    unit = rig.command.unit
    text = f"{tone.frequency_hz:.3g} Hz, {tone.bias:+.3g} ± {tone.amplitude:.3g} {unit}"
    return listen(rig, sequence, tone, patience, phase_rad, text)


def _reference_hz(frequency_hz: Array, response: Any) -> float | None:
    """The frequency that the standard refers to; None when the phase does not reach −90°."""
    phase_deg = np.degrees(np.unwrap(np.angle(response)))
    if phase_deg[0] < -90.0 or phase_deg.min() > -90.0:
        return None
    after = int(np.argmax(phase_deg <= -90.0))
    at_hz = float(np.interp(90.0, -phase_deg[after - 1 : after + 1], frequency_hz[after - 1 : after + 1]))
    return float(f"{min(_STANDARD_HZ, _STANDARD_SHARE * at_hz):.3g}")


def _curve(recording: Recording, one: Evaluated, segments: list[Segment]) -> dict[str, Any]:
    mine = [s for s in segments if (s.amplitude, s.bias) == (one.response.amplitude, one.response.bias)]
    mine.sort(key=lambda segment: segment.frequency_hz)
    shown = sorted({0, len(mine) // 2, len(mine) - 1})
    overlays = [overlay(recording, mine[i]) for i in shown]
    return one.curve(thd_percent=100.0 * one.response.distortion_beyond_noise[0], overlays=overlays)


def _hummed(response: FrequencyResponse, segments: list[Segment], recording: Recording, hum_hz: float | None) -> Mask:
    """Lines of which a harmonic lies on a tone that goes on beneath every sine, shape (n,)."""
    if hum_hz is None:
        return np.zeros(len(response), dtype=np.bool_)
    orders = np.arange(1, response.harmonics.shape[1] + 2)
    near = np.min(np.abs(np.outer(response.frequency_hz, orders) - hum_hz), axis=1)
    interval_s = recording.interval_s
    resolved = {one.frequency_hz: 1.0 / (one.count * interval_s) for one in segments}
    return near < np.array([resolved.get(f, 0.0) for f in response.frequency_hz.tolist()])


def _hum_note(one: Evaluated, hummed: Mask, hum_hz: float | None) -> Note:
    lines_hz = tuple(Note("{line_hz:g}", line_hz=line_hz) for line_hz in one.response.frequency_hz[hummed])
    note = Note(
        "a tone of {tone_hz:.3g} Hz goes on beneath every sine. What it adds to harmonics of {lines_hz} Hz cannot be "
        "separated from distortion; drive other frequencies.",
        tone_hz=hum_hz, lines_hz=lines_hz,
    )  # fmt: skip
    return note.at(one.label)


def _distortion(one: Evaluated, hummed: Mask) -> Measured:
    """The largest over the lines; what noise adds to the largest of many is taken off."""
    response = one.response
    thd, line_std = response.distortion_beyond_noise
    what = THD.at(response.label)
    if np.isnan(thd).all() or not one.follows:
        return what.of(None)
    largest = float(np.nanmax(thd))
    scale = np.sqrt(np.trace(response.covariance, axis1=1, axis2=2) / 2.0) / np.abs(response.response)
    size = np.linalg.norm(response.harmonics, axis=1)
    # resampled about harmonics as large as they are without the noise in them
    clean = response.harmonics * (np.nan_to_num(thd) / np.where(size > 0.0, size, 1.0))[:, None]
    parts = draws_of(response.harmonics).normal(size=(2, DRAWS, *clean.shape))
    drawn = clean + (parts[0] + 1j * parts[1]) * scale[:, None]
    power = np.linalg.norm(drawn, axis=2) ** 2 - clean.shape[1] * 2.0 * scale**2
    resampled = np.sqrt(np.max(np.maximum(power, 0.0), axis=1))
    added = max(float(np.mean(resampled)) - largest, 0.0)
    # where lines are nearly as large, the largest scatters less than each, but which it is changes from run to run
    spread = max(float(np.std(resampled)), float(line_std[np.nanargmax(thd)]))
    value, std = 100.0 * max(largest - added, 0.0), 100.0 * math.hypot(spread, added)
    return what.of(None) if hummed.any() else extreme(what, value, std)


def _distorted(one: Evaluated) -> tuple[Note, ...]:
    thd, _ = one.response.distortion_beyond_noise
    over = one.response.frequency_hz[thd > DISTORTION_FLAG]
    if not over.size or not one.follows:
        return ()
    worst = int(np.nanargmax(thd))
    note = Note(
        "distortion above {limit:g} % at {n} of {all} frequencies ({thd:.0f} % at {worst_hz:g} Hz); there the valve is "
        "not linear at this amplitude.",
        limit=100 * DISTORTION_FLAG, n=over.size, all=thd.size, thd=100 * thd[worst],
        worst_hz=one.response.frequency_hz[worst],
    )  # fmt: skip
    return (note.at(one.label),)


def _unsteady(parts: list[Any]) -> tuple[Note, ...]:
    late = [part for part in parts if not part["steady"]]
    if not late:
        return ()
    places = tuple(
        Note("{frequency_hz:g} Hz at {bias:+.4g} ± {amplitude:.4g}", frequency_hz=part["frequency_hz"],
             bias=part["bias"], amplitude=part["amplitude"])
        for part in late[:5]
    )  # fmt: skip
    if len(late) <= 5:
        return (Note("Measured before the response was steady: {places}.", places=places),)
    more = len(late) - 5
    return (Note("Measured before the response was steady: {places} and {n} more.", places=places, n=more),)
