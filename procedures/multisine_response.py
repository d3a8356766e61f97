"""Frequency response by multisine: all frequencies at once, with noise and distortion separated.

Odd random-phase multisine about a bias, repeated: what changes between periods is noise, what answers on lines that
were not driven is distortion, even or odd. It takes about a fifth of the bench time of stepped sines
(`frequency_response`) for the same frequencies, with less amplitude in each line.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hil.errors import SettingError
from hil.identification.frequency.best_linear_approximation import BestLinearApproximation, best_linear_approximation
from hil.identification.uncertainty.parametric_bootstrap import about
from hil.record.measurement import Findings, Measured, Measurement
from hil.record.recording import Array, Recording
from hil.rig import Rig
from hil.signals.decibel import decibels
from hil.signals.multisine import Multisine, odd_multisine
from procedures._definitions import FREQUENCIES, defined
from procedures._recorded import departures, parts_of, roles_of
from procedures._response import MEASURED, Evaluated, chain_notes, evaluated, reference_deviations
from procedures._run_sequence import RunSequence, joined
from procedures._scale import about_levels, check_form_asked, scale_of
from procedures._settings import NotNegative, Percent, Poles, Positive, PositivePercent, Seed, Twice, Zeros
from procedures._statistics import extreme

NOISE = Measurement("noise", "%", "noise of the mean over the periods, median over the lines, in % of the response")
ODD = Measurement(
    "odd_distortion", "%", "odd distortion (friction, saturation), median over the lines, in % of the response"
)
EVEN = Measurement(
    "even_distortion", "%", "even distortion (asymmetry, curvature), median over the lines, in % of the response"
)
MEASUREMENTS = defined(FREQUENCIES, *MEASURED, NOISE, ODD, EVEN)


def run(
    rig: Rig,
    *,
    low_hz: Positive = 0.1,
    high_hz: Positive = 4.9,
    base_hz: Positive = 0.1,
    amplitudes: tuple[PositivePercent, ...] = (10.0,),
    biases: tuple[Percent, ...] | None = None,
    periods: Twice = 4,
    seed: Seed = 0,
    warm_up_s: NotNegative = 0.0,
    correct_chain: bool = True,
    poles: Poles | None = 3,
    zeros: Zeros | None = None,
    dead_time: bool | None = None,  # noqa: ARG001 — for the evaluation
    full_command: Positive | None = None,
    rate_hz: Positive | None = None,
) -> None:
    """Drive the multisines.

    Args:
        rig: the bench.
        low_hz: lowest driven frequency, in Hz.
        high_hz: highest driven frequency, in Hz.
        base_hz: spacing of the lines, in Hz; one period lasts 1/base_hz, and odd multiples are driven.
        amplitudes: peak of the multisine, in % of full command.
        biases: about which it swings, in % of full command from neutral. When not given: the bench's operating point,
            else ±50, the middle of a one-way command, or 0 where the response integrates.
        periods: how many are measured, 2 or more, after the valve has settled.
        seed: of the phases and of the lines that stay silent.
        warm_up_s: time at the first bias before anything is measured, in s.
        correct_chain: take the measuring chain's own lag, skew and hold out of the results.
        poles: of the transfer function, 1 to 5; chosen by evidence when "none".
        zeros: of the transfer function; chosen by evidence when not given.
        dead_time: whether the transfer function has one; chosen by evidence when not given.
        full_command: what 100 % is, in the unit of the command; the farther end of its range when not given.
        rate_hz: sample rate; that of the bench when not given. At least 20 times the top frequency.
    """
    rate_hz = rig.actual_rate_hz(rate_hz)
    _check_lines(low_hz, high_hz)
    check_form_asked(poles, zeros)
    levels = about_levels(scale_of(rig, full_command), amplitudes, biases)
    unit_sine = odd_multisine(low_hz, high_hz, base_hz, rate_hz, 1.0, seed=seed)
    lead = _lead(unit_sine, rig.settling_s)
    waves = [bias + amplitude * np.concatenate((lead, unit_sine.signal(periods))) for bias, amplitude in levels]
    sequence = RunSequence(
        rig, rate_hz, joined(rig, rate_hz, warm_up_s, waves),
        {"lines": len(unit_sine.excited), "crest_factor": round(unit_sine.crest_factor, 3),
         "correct_chain": correct_chain},
    )  # fmt: skip
    sequence.warm_up(levels[0][0], warm_up_s)
    for (bias, amplitude), wave in zip(levels, waves, strict=True):
        sequence.go_to(float(wave[0]))
        text = f"multisine {bias:+.3g} ± {amplitude:.3g} {rig.command.unit}"
        sequence.play(wave[: len(lead)], text)
        part = {**unit_sine.as_part(), "amplitude": amplitude, "bias": bias}
        sequence.play(wave[len(lead) :], text, part)
    sequence.finish()


def evaluate(recording: Recording) -> Findings:
    """Best linear approximations with uncertainty, bandwidths, transfer functions, noise and distortion."""
    command, response = roles_of(recording)
    parts_of(recording, "multisine")
    linear = best_linear_approximation(recording, command.name, response.name, settle_periods=0)
    found = evaluated(recording, [one.response for one in linear])
    notes, deviations = chain_notes(recording, found[0].response.frequency_hz)
    linearity = [bla.sentence.at(one.label).stopped for one, bla in zip(found, linear, strict=True)]
    return Findings(
        measured=tuple(
            measured
            for one, bla in zip(found, linear, strict=True)
            for measured in (*one.measured(), *_levels(one, bla))
        ),
        curves={"responses": [_curve(one, bla) for one, bla in zip(found, linear, strict=True)]},
        notes=(*notes, *linearity, *(note for one in found for note in one.explained())),
        deviations=(*deviations, *reference_deviations(found), *departures(recording)),
    )


def _check_lines(low_hz: float, high_hz: float) -> None:
    if not high_hz > low_hz:
        raise SettingError(f"setting high_hz: {high_hz:g} Hz; it must be above low_hz, {low_hz:g} Hz")


def _lead(wave: Multisine, settling_s: float) -> Array:
    """The end of a period, so long that the valve has settled when the first whole one begins."""
    samples = round(settling_s * wave.rate_hz)
    repeats = -(-samples // len(wave.period))
    return np.tile(wave.period, repeats)[len(wave.period) * repeats - samples :]


def _levels(one: Evaluated, bla: BestLinearApproximation) -> tuple[Measured, ...]:
    """Noise with the uncertainty of how often it was seen, distortion with that of the noise resampled."""
    amplitude, label = bla.response.output_amplitude, one.response.label

    def share(level: Array) -> float:
        return 100.0 * float(np.median(level / amplitude))

    noise = share(bla.noise_std)
    noise_std = about(np.array([share(again) for again in bla.resampled_noise]), noise)
    distortion = [
        extreme(what.at(label), share(level), about(np.array([share(again) for again in resampled]), share(level)))
        for what, level, resampled in ((ODD, bla.odd_std, bla.resampled_odd), (EVEN, bla.even_std, bla.resampled_even))
    ]
    return (NOISE.at(label).size(noise, noise_std), *distortion)


def _curve(one: Evaluated, bla: BestLinearApproximation) -> dict[str, Any]:
    gain = np.abs(one.response.response)
    reference = float(gain[0])

    def decibel(level: Array) -> Array:
        share = np.maximum(level / bla.response.output_amplitude, 1e-9)
        return decibels(share * gain / reference)

    return one.curve(noise_db=decibel(bla.noise_std), odd_db=decibel(bla.odd_std), even_db=decibel(bla.even_std))
