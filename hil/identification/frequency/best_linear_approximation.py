"""Best linear approximation from a multisine: response, noise, and even and odd distortion kept apart.

Noise is what changes from period to period. What repeats but sits on lines that were not excited is
distortion: on even lines from even nonlinearity (asymmetry, orifice law), on silent odd lines from odd
nonlinearity (friction, dead band, saturation). Odd distortion falls on the excited lines as well and is
there part of the uncertainty of the linear model; even distortion does not.
Pintelon, Schoukens: System Identification, a Frequency Domain Approach, 2nd ed., ch. 4 (fast method).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from hil.errors import InputError
from hil.identification.frequency.criteria import EFFORT
from hil.identification.frequency.frequency_response import FrequencyResponse
from hil.identification.uncertainty.parametric_bootstrap import DRAWS, draws_of
from hil.language.note import Note
from hil.language.words import marked
from hil.record.recording import Array, Complex, Integers, Recording
from hil.signals.rounding import mean_rounding_std, rounding_step

Distortion = Literal["noise", "even nonlinearity", "odd nonlinearity"]
_DISTORTIONS: tuple[Distortion, ...] = (marked("noise"), marked("even nonlinearity"), marked("odd nonlinearity"))


@dataclass(frozen=True, slots=True)
class BestLinearApproximation:
    """The linear part of a response to one multisine, and what is not linear in it.

    Attributes:
        response: at the excited lines, covariance from noise and odd distortion together.
        noise_std: of the mean over periods, in the output's unit, at the excited lines, shape (n,).
        odd_std, even_std: level of odd and even distortion there, rms, in the output's unit, shape (n,).
        resampled_noise, resampled_odd, resampled_even: the same levels with the noise drawn again, shape (draws, n).
        verdicts: which of the three is largest, per line.
        periods: how many were averaged.
    """

    response: FrequencyResponse
    noise_std: Array
    odd_std: Array
    even_std: Array
    resampled_noise: Array
    resampled_odd: Array
    resampled_even: Array
    verdicts: tuple[Distortion, ...]
    periods: int

    @property
    def sentence(self) -> Note:
        """What dominates over the band, in one line."""
        counts = {name: self.verdicts.count(name) for name in dict.fromkeys(self.verdicts)}
        largest = max(counts, key=lambda name: counts[name])
        share = 100.0 * counts[largest] / len(self.verdicts)
        amplitude = self.response.output_amplitude
        odd, even = (100.0 * float(np.median(level / amplitude)) for level in (self.odd_std, self.even_std))
        return Note(
            "{what} dominates on {share:.0f} % of the lines; odd distortion {odd:.2g} % and even distortion {even:.2g} "
            "% of the output (median)",
            what=Note(largest), share=share, odd=odd, even=even,
        )  # fmt: skip


def best_linear_approximation(
    recording: Recording, input_name: str, output_name: str, *, settle_periods: int = 1
) -> tuple[BestLinearApproximation, ...]:
    """One best linear approximation for each multisine part (kind "multisine") of a recording.

    Args:
        recording: with `meta["parts"]` as `hil.signals.multisine.Multisine.as_part` describes them, each with
            `first`, `count` and `bias` beside.
        input_name: the command's channel.
        output_name: the response's channel.
        settle_periods: first periods of each part that are left out.

    Where each sample of the response was read at a time of its own, their mean delay is taken out.

    Raises:
        InputError: no multisine part, or fewer than two periods left.
    """
    u, y = recording.channel(input_name), recording.channel(output_name)
    parts = [part for part in recording.meta.get("parts", ()) if part.get("kind") == "multisine"]
    if not parts:
        raise InputError(f"{recording.name}: no part of kind 'multisine' is written down in it")
    made = []
    for part in parts:
        samples = round(1.0 / (float(part["base_hz"]) * recording.interval_s))
        rows = slice(int(part["first"]), int(part["first"]) + int(part["count"]))
        given, answer = (_periods(recording.name, c.values[rows], samples, settle_periods) for c in (u, y))
        grid = rounding_step(y.values[rows])
        found = approximate(recording.name, given, _level(answer), part, (u.unit, y.unit), grid)
        delay_s = float(np.mean((recording.stamps(y.name) - recording.time_s)[rows]))
        made.append(_read_later(found, delay_s) if delay_s else found)
    return tuple(made)


def approximate(
    name: str, inputs: Array, outputs: Array, part: Mapping[str, Any], units: tuple[str, str] = ("1", "1"),
    grid: float = 0.0,
) -> BestLinearApproximation:  # fmt: skip
    """From periods in steady state, shape (periods, samples of one period), and the lines of the multisine.

    `grid` is the distance of the codes of the converter that read the outputs, 0 for none: where noise is smaller,
    every period is rounded alike, which is no distortion of the valve.
    """
    excited = np.asarray(part["excited"], dtype=np.int64)
    odd, even = (np.asarray(part[key], dtype=np.int64) for key in ("odd_detection", "even_detection"))
    given, answer = _spectrum(inputs), _spectrum(outputs)
    response = answer[:, excited].mean(axis=0) / given[:, excited].mean(axis=0)
    seen = _noise(answer[:, excited] - response * given[:, excited])  # which the input does not explain
    pooled = _pooled(seen)
    noise = np.maximum(seen, pooled)  # a line of its own stands out of its neighbours, a chance does not hide
    rounded = _rounded(outputs, grid)
    (odd_level, odd_again), (even_level, even_again) = (
        _distortion(given, answer, silent, excited, response, rounded) for silent in (odd, even)
    )  # fmt: skip
    size = np.abs(given[:, excited].mean(axis=0))
    variance = (noise + rounded + odd_level) / size**2 / 2.0
    amplitudes = np.abs(answer[:, excited].mean(axis=0))
    lines_hz = np.asarray(excited * float(part["base_hz"]), dtype=np.float64)
    made = FrequencyResponse(
        name, lines_hz, response, variance[:, None, None] * np.eye(2), *units,
        float(part.get("amplitude", np.max(np.abs(inputs - inputs.mean())))),
        float(part.get("bias", inputs.mean())), amplitudes,
        np.full(len(excited), float(np.std(outputs - outputs.mean(axis=0)))),
        np.zeros((len(excited), 0), dtype=np.complex128),
    )  # fmt: skip
    levels = np.sqrt(np.stack((pooled, even_level, odd_level)))
    verdicts = tuple(_DISTORTIONS[int(k)] for k in np.argmax(levels, axis=0))
    freed = 2 * (len(inputs) - 1)
    drawn = draws_of(outputs).chisquare(freed, (DRAWS, len(excited))) / freed * pooled
    again = np.sqrt(np.array([_pooled(one) for one in drawn]))
    return BestLinearApproximation(
        made, levels[0], levels[2], levels[1], again, odd_again, even_again, verdicts, len(inputs)
    )


def _read_later(found: BestLinearApproximation, delay_s: float) -> BestLinearApproximation:
    """The same without what it is that the response was read so much later than its stamps say."""
    ahead = np.exp(2j * np.pi * found.response.frequency_hz * delay_s)
    note = f"read {1e3 * delay_s:.3g} ms after the update on average"
    return replace(found, response=found.response.divided_by(ahead, note))


def _periods(name: str, values: Array, samples: int, settle: int) -> Array:
    count = len(values) // samples
    if count - settle < 2:
        raise InputError(f"{name}: {count} periods of the multisine, {settle} of them to settle; two must remain")
    return values[settle * samples : count * samples].reshape(count - settle, samples)


def _spectrum(periods: Array) -> Complex:
    """Amplitude spectrum of each period."""
    return np.fft.rfft(periods, axis=1) * (2.0 / periods.shape[1])


def _noise(rest: Complex) -> Array:
    """Variance of the mean over periods, both parts together."""
    return np.var(rest, axis=0, ddof=1) / len(rest)


def _pooled(noise: Array) -> Array:
    """Of each line and its neighbours: noise is smooth over frequency, and few periods tell little of one line."""
    around = np.ones(min(EFFORT.pooled, len(noise)))
    return np.convolve(noise, around, "same") / np.convolve(np.ones(len(noise)), around, "same")


def _level(periods: Array) -> Array:
    """Periods without the straight drift over them."""
    count, samples = periods.shape
    late = np.arange(count) - (count - 1) / 2.0
    per_period = float(late @ periods.mean(axis=1)) / float(late @ late)
    drift = per_period * (np.arange(count * samples) / samples - count / 2.0)
    return periods - drift.reshape(count, samples)


def _rounded(outputs: Array, grid: float) -> float:
    """Power on each line of what rounding makes alike in every period: white, as a sine of many codes leaves it."""
    periods, samples = outputs.shape
    noise_std = float(np.sqrt(np.mean(np.var(outputs, axis=0, ddof=1))))
    return 4.0 * mean_rounding_std(noise_std, grid) ** 2 / samples if periods > 1 else 0.0


def _distortion(
    given: Complex, answer: Complex, silent: Integers, excited: Integers, response: Complex, rounded: float
) -> tuple[Array, Array]:
    """Power on silent lines beyond noise, rounding and the input's own leakage, averaged around each excited line.

    Shape (n,). The second is the root of it with the noise resampled, shape (draws, n).
    """
    if not silent.size:
        return np.zeros(len(excited)), np.zeros((DRAWS, len(excited)))
    linear = np.interp(silent, excited, response.real) + 1j * np.interp(silent, excited, response.imag)
    rest = answer[:, silent] - linear * given[:, silent]
    noise, mean = _noise(rest), rest.mean(axis=0)
    near = _near(silent, excited)
    power = np.maximum((np.abs(mean) ** 2 - noise - rounded) @ near, 0.0)
    # resampled about answers as large as they are without the noise in them; few periods tell the noise badly as well
    level = np.sqrt(np.interp(silent, excited, power)) * np.exp(1j * np.angle(mean))
    rng, pooled, freed = draws_of(answer[:, silent]), _pooled(noise), 2 * (len(rest) - 1)
    parts = rng.normal(size=(2, DRAWS, len(silent)))
    drawn = np.abs(level + (parts[0] + 1j * parts[1]) * np.sqrt((pooled + rounded) / 2.0)) ** 2
    seen = rng.chisquare(freed, drawn.shape) / freed * pooled
    return power, np.sqrt(np.maximum((drawn - seen - rounded) @ near, 0.0))


def _near(silent: Integers, excited: Integers) -> Array:
    """Weights that average the silent lines nearest to each excited one, shape (silent, excited)."""
    count = min(EFFORT.neighbours, max(2, len(silent) // EFFORT.share))
    weights = np.zeros((len(silent), len(excited)))
    for i, line in enumerate(excited.tolist()):
        weights[np.argsort(np.abs(silent - line))[:count], i] = 1.0 / min(count, len(silent))
    return weights
