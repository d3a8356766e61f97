"""The frequency response: complex output over input per frequency, with covariance, harmonics and noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hil.errors import FileError, InputError
from hil.record.measurement import COVERAGE_FACTOR
from hil.record.recording import Array, Complex, Integers, Mask
from hil.signals.decibel import PER_NEPER, decibels, of_decibels
from hil.signals.sine_fit import SineFit

DISTORTION_FLAG = 0.05  # customary limit of THD above which a response counts as distorted (5…10 %)

_BY_LINE = (
    "frequency_hz", "response", "covariance", "output_amplitude", "noise_std", "harmonics",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class FrequencyResponse:
    """Output over input at n frequencies, one amplitude about one bias.

    Attributes:
        name: recording or table it comes from.
        frequency_hz: rising, shape (n,).
        response: raw output over input, in output unit per input unit, shape (n,).
        covariance: of (Re, Im) of the response, shape (n, 2, 2); NaN where nothing is known (a table).
        input_unit, output_unit: of the two channels.
        amplitude, bias: of the input, in its unit; NaN for a table.
        output_amplitude, noise_std: per frequency, shape (n,).
        harmonics: output harmonics 2… over its fundamental, shape (n, harmonics − 1).
        corrections: what has been taken out of the raw response.
        delay_std_s: standard uncertainty of a delay that all lines share; `covariance` is without it.
    """

    name: str
    frequency_hz: Array
    response: Complex
    covariance: Array
    input_unit: str
    output_unit: str
    amplitude: float
    bias: float
    output_amplitude: Array
    noise_std: Array
    harmonics: Complex
    corrections: tuple[str, ...] = ()
    delay_std_s: float = 0.0

    def __len__(self) -> int:
        return len(self.frequency_hz)

    @property
    def label(self) -> str:
        """`+50 ± 5 %`; a bias is rounded to 1e-4 of the amplitude."""
        bias = self.amplitude * round(self.bias / self.amplitude, 4) + 0.0 if self.amplitude > 0.0 else self.bias
        return f"{bias:+.4g} ± {self.amplitude:.4g} {self.input_unit}"

    @property
    def gain_unit(self) -> str:
        """`l/min per %`."""
        return f"{self.output_unit} per {self.input_unit}"

    @property
    def gain_std(self) -> Array:
        """Standard uncertainty of the gain, in its unit, shape (n,)."""
        return np.abs(self.response) * (of_decibels(self.magnitude_std_db) - 1.0)

    @property
    def magnitude_db(self) -> Array:
        """20·lg of the raw ratio."""
        return decibels(self.response)

    @property
    def phase_deg(self) -> Array:
        """Phase, unwrapped from the lowest frequency on, beyond −360° where it goes there."""
        return np.degrees(np.unwrap(np.angle(self.response)))

    @property
    def magnitude_std_db(self) -> Array:
        """Standard uncertainty of the magnitude."""
        return PER_NEPER * self._std_along(self.response)

    @property
    def phase_std_deg(self) -> Array:
        """Standard uncertainty of the phase."""
        return np.hypot(self.own_phase_std_deg, self.shared_phase_std_deg)

    @property
    def own_phase_std_deg(self) -> Array:
        """The part of it that is each line's own."""
        return np.degrees(self._std_along(1j * self.response))

    @property
    def shared_phase_std_deg(self) -> Array:
        """The part of it that the lines share, by their common delay."""
        return 360.0 * self.frequency_hz * self.delay_std_s

    @property
    def distortion(self) -> Array:
        """THD of the output: rms of harmonics 2… over the fundamental."""
        return np.linalg.norm(self.harmonics, axis=1)

    @property
    def distortion_beyond_noise(self) -> tuple[Array, Array]:
        """Distortion beyond what noise alone makes of the harmonics, and its standard uncertainty, shape (n,).

        NaN where the fundamental itself is not known to better than its own size: there is nothing to compare with.
        """
        noise = np.trace(self.covariance, axis1=1, axis2=2) / np.abs(self.response) ** 2
        count = self.harmonics.shape[1]
        beyond = np.maximum(self.distortion**2 - count * noise, 0.0)
        one = noise / 2.0  # variance of each of the components, and of the fundamental that they are compared with
        squared = 4.0 * beyond * one * (1.0 + beyond) + 4.0 * count * one**2
        std = np.sqrt(squared / np.maximum(4.0 * beyond, 2.0 * np.sqrt(squared)))
        return np.where(COVERAGE_FACTOR * np.sqrt(one) < 1.0, np.sqrt(beyond), np.nan), std

    def normalised(self) -> FrequencyResponse:
        """Magnitude over that at the lowest frequency: eq. 1 of the HPV41 paper.

        This deletes the static gain, which friction and dead band make depend on amplitude; keep the raw one
        too. The uncertainty of the reference is added to every other line.
        """
        along, across = self._std_along(self.response) ** 2, self._std_along(1j * self.response) ** 2
        along += along[0]
        along[0] = 0.0
        response = self.response / abs(self.response[0])
        note = f"magnitude over that at {self.frequency_hz[0]:g} Hz"
        return replace(
            self, response=response, covariance=_rotated(response, along, across), output_unit="1", input_unit="1",
            corrections=(*self.corrections, note),
        )  # fmt: skip

    def divided_by(self, other: Complex, note: str) -> FrequencyResponse:
        """The response with a known factor taken out, covariance included."""
        turn = 1.0 / np.asarray(other, dtype=np.complex128)
        return replace(
            self, response=self.response * turn, covariance=_multiplied(turn, self.covariance),
            corrections=(*self.corrections, note),
        )  # fmt: skip

    def scaled(self, factor: float) -> FrequencyResponse:
        """The response times a number."""
        return replace(self, response=factor * self.response, covariance=factor**2 * self.covariance)

    def select(self, keep: Mask | Integers) -> FrequencyResponse:
        """Some of the frequencies."""
        return replace(self, **{name: getattr(self, name)[keep] for name in _BY_LINE})

    def _std_along(self, direction: Complex) -> Array:
        """Standard deviation along a direction, over the size of the response."""
        unit = direction / np.abs(direction)
        pairs = np.stack((unit.real, unit.imag), axis=-1)
        variance = np.einsum("ni,nij,nj->n", pairs, self.covariance, pairs)
        return np.sqrt(np.maximum(variance, 0.0)) / np.abs(self.response)


def from_fits(
    name: str,
    fits: Sequence[tuple[SineFit, SineFit]],
    units: tuple[str, str],
    amplitude: float | None = None,
    bias: float | None = None,
) -> FrequencyResponse:
    """A frequency response from sine fits of (input, output), one pair per frequency.

    Noise of input and output is taken as independent.

    Raises:
        InputError: no fits, or an input or output without amplitude.
    """
    if not fits:
        raise InputError(f"{name}: no sine to make a frequency response of")
    fits = sorted(fits, key=lambda pair: pair[0].frequency_hz)
    inputs, outputs = [pair[0] for pair in fits], [pair[1] for pair in fits]
    given = np.array([fit.phasor for fit in inputs])
    if np.any(np.abs(given) == 0.0):
        raise InputError(
            f"{name}: the input does not move at {inputs[int(np.argmin(np.abs(given)))].frequency_hz:g} Hz"
        )
    answers = np.array([fit.phasor for fit in outputs])
    if np.any(np.abs(answers) == 0.0):  # to the last bit: nothing was measured
        raise InputError(
            f"{name}: the output does not move at {outputs[int(np.argmin(np.abs(answers)))].frequency_hz:g} Hz"
        )
    response = answers / given
    covariance = _multiplied(np.reciprocal(given), np.array([fit.phasor_covariance() for fit in outputs]))
    covariance += _multiplied(response / given, np.array([fit.phasor_covariance() for fit in inputs]))
    return FrequencyResponse(
        name, np.array([fit.frequency_hz for fit in inputs]), response, covariance, *units,
        float(np.median(np.abs(given))) if amplitude is None else amplitude,
        float(np.median([fit.offset for fit in inputs])) if bias is None else bias,
        np.array([fit.amplitude for fit in outputs]),
        np.array([fit.residual_std for fit in outputs]),
        np.array([fit.phasors[1:] / fit.phasor for fit in outputs]),
    )  # fmt: skip


def from_table(
    name: str, frequency_hz: Array, magnitude_db: Array, phase_deg: Array, units: tuple[str, str] = ("1", "1")
) -> FrequencyResponse:
    """A frequency response from a published Bode table; nothing is known of its noise."""
    order = np.argsort(frequency_hz)
    response = np.asarray(of_decibels(magnitude_db) * np.exp(1j * np.radians(phase_deg)), dtype=np.complex128)
    return from_polar(name, np.asarray(frequency_hz)[order], response[order], units=units)


def from_polar(
    name: str,
    frequency_hz: Array,
    response: Complex,
    gain_std: Array | None = None,
    phase_std_rad: Array | None = None,
    units: tuple[str, str] = ("1", "1"),
) -> FrequencyResponse:
    """A frequency response from complex lines at rising frequencies, with the standard uncertainties of both parts.

    `gain_std` is relative; where one of them is not known, nothing is taken to be known of the noise.
    """
    n = len(frequency_hz)
    unknown = np.full(n, math.nan)
    known = gain_std is not None and phase_std_rad is not None
    covariance = _rotated(response, gain_std**2, phase_std_rad**2) if known else np.full((n, 2, 2), math.nan)  # type: ignore[operator]
    return FrequencyResponse(
        name, np.asarray(frequency_hz, dtype=np.float64), np.asarray(response, dtype=np.complex128), covariance, *units,
        math.nan, math.nan, unknown, unknown, np.zeros((n, 0), dtype=np.complex128),
    )  # fmt: skip


def joined(responses: Sequence[FrequencyResponse]) -> FrequencyResponse:
    """The lines of several responses by rising frequency; what is said of the whole is that of the first."""
    rows: dict[str, Any] = {name: np.concatenate([getattr(one, name) for one in responses]) for name in _BY_LINE}
    return replace(responses[0], **rows).select(np.argsort(rows["frequency_hz"], kind="stable"))


def average(responses: Sequence[FrequencyResponse]) -> FrequencyResponse:
    """The mean of responses on the same frequencies: of their dB and of their unwrapped phases.

    What the paper calls a mean model is fitted to this. It describes none of the runs; use it to speak about
    all of them at once.

    Raises:
        FileError: on different frequencies.
    """
    first, *others = responses
    for other in others:
        if not np.array_equal(other.frequency_hz, first.frequency_hz):
            raise FileError(f"{other.name}: other frequencies than {first.name}; a mean is taken line by line")
    return from_table(
        f"mean of {len(responses)} responses",
        first.frequency_hz,
        np.mean([r.magnitude_db for r in responses], axis=0),
        np.mean([r.phase_deg for r in responses], axis=0),
        (first.input_unit, first.output_unit),
    )


def _multiplied(turn: Complex, covariance: Array) -> Array:
    """Covariances of complex numbers multiplied by `turn`; shapes (n,) and (n, 2, 2)."""
    matrix = np.empty((len(turn), 2, 2))
    matrix[:, 0, 0] = matrix[:, 1, 1] = turn.real
    matrix[:, 1, 0], matrix[:, 0, 1] = turn.imag, -turn.imag
    return np.einsum("nij,njk,nlk->nil", matrix, covariance, matrix)


def _rotated(response: Complex, along: Array, across: Array) -> Array:
    """Covariances from relative variances along and across each phasor."""
    diagonal = np.zeros((len(response), 2, 2))
    diagonal[:, 0, 0], diagonal[:, 1, 1] = along, across
    return _multiplied(response, diagonal)
