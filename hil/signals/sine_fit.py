"""The sine fit: amplitude, phase, offset and harmonics of a response at a known frequency, with uncertainty.

The frequency was commanded, so it is known: the fit is linear least squares, has one optimum, and reaches
the Cramér–Rao bound for white noise. Harmonics and drift are columns of the same fit, so that a distorted
or creeping response does not bend the fundamental (IEEE Std 1057, three-parameter fit, with harmonics).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from hil.arrays import Array, Complex
from hil.errors import SettingError
from hil.signals.colour import colour_factors
from hil.signals.rounding import sine_rounding_std
from hil.signals.sine_basis import sine_basis
from hil.signals.sine_solution import Solved, solve


@dataclass(frozen=True, slots=True)
class SineFit:
    """offset + Σ A_k·sin(k·2πf·t + φ_k) + drift, fitted to samples.

    Attributes:
        frequency_hz: of the fundamental.
        offset: mean level, drift terms zero in the middle of the samples.
        phasors: A_k·e^(iφ_k) for k = 1…harmonics; phase zero is a sine that starts at t = 0. Complex, shape (k,).
        drift: change over half the record per power of time, shape (order,).
        residual_std: standard deviation of what is left.
        covariance: of [offset, Re, Im of each phasor, drift…], including the colour of the residual.
            `bound`: the same for white noise, the Cramér–Rao bound. Shape (p, p).
        samples: how many were fitted. `periods`: how many periods they span.
    """

    frequency_hz: float
    offset: float
    phasors: Complex
    drift: Array
    residual_std: float
    covariance: Array
    bound: Array
    samples: int
    periods: float

    @property
    def phasor(self) -> complex:
        """A·e^(iφ) of the fundamental."""
        return complex(self.phasors[0])

    @property
    def amplitude(self) -> float:
        """Of the fundamental, in the unit of the samples."""
        return abs(self.phasor)

    @property
    def phase_rad(self) -> float:
        """Of the fundamental, −π…π."""
        return math.atan2(self.phasor.imag, self.phasor.real)

    @property
    def offset_std(self) -> float:
        """Standard uncertainty of the offset."""
        return math.sqrt(self.covariance[0, 0])

    @property
    def amplitude_std(self) -> float:
        """Standard uncertainty of the amplitude."""
        return _along(self.phasor_covariance(), self.phasor)

    @property
    def phase_std_rad(self) -> float:
        """Standard uncertainty of the phase; infinite when there is no amplitude."""
        across = _along(self.phasor_covariance(), 1j * self.phasor)
        return across / self.amplitude if self.amplitude else math.inf

    @property
    def distortion(self) -> float:
        """THD: rms of harmonics 2… over the fundamental."""
        harmonics = float(np.linalg.norm(self.phasors[1:]))
        return harmonics / self.amplitude if self.amplitude else math.inf

    def phasor_covariance(self) -> Array:
        """Covariance of (Re, Im) of the fundamental's phasor, shape (2, 2)."""
        return self.covariance[1:3, 1:3]

    def at(self, time_s: Array) -> Array:
        """The fit at all the stamps that it was made of, shape (n,)."""
        turn = 2.0j * math.pi * self.frequency_hz * np.outer(np.arange(1, len(self.phasors) + 1), time_s)
        made = self.offset + (self.phasors[:, None] * np.exp(turn)).imag.sum(axis=0)
        return made + self.drift @ _powers(time_s, len(self.drift)) if len(self.drift) else made

    def left(self, time_s: Array, values: Array) -> Array:
        """What the fit leaves of the samples that it was made of, shape (n,)."""
        return values - self.at(time_s)


def sine_fit(time_s: Array, values: Array, frequency_hz: float, *, harmonics: int = 5, drift_order: int = 0) -> SineFit:
    """Fit a sine of known frequency, its harmonics, an offset and drift in one linear least squares.

    Input and output of a plant are fitted at the same frequency on the same stamps, one call each.

    Args:
        time_s: stamps, shape (n,), even or not; phases refer to its zero.
        values: samples, shape (n,).
        frequency_hz: the commanded frequency.
        harmonics: highest one fitted; 1 fits the fundamental alone.
        drift_order: powers of time fitted beside the offset; 1 is a straight drift.

    Raises:
        SettingError: too few samples or periods, or a harmonic above half the sample rate.
    """
    _check(time_s, values, frequency_hz, harmonics, drift_order)
    basis = sine_basis(time_s, frequency_hz, harmonics)
    slow = _powers(time_s, drift_order)
    solved = solve(basis, values, slow, frequency_hz)
    return _finished(solved, values, slow, _cycles(time_s, frequency_hz), frequency_hz)


def sine_phasor(time_s: Array, values: Array, frequency_hz: float, *, harmonics: int = 5) -> complex:
    """The phasor that `sine_fit` finds with these arguments, without its uncertainty. Raises as that does."""
    _check(time_s, values, frequency_hz, harmonics, 0)
    solved = solve(sine_basis(time_s, frequency_hz, harmonics), values, _powers(time_s, 0), frequency_hz)
    return complex(solved.phasors[0])


def with_rounding(fit: SineFit, step: float) -> SineFit:
    """The fit of rounded samples, with what rounding by the steps of a converter may have made of it."""
    if step == 0.0:
        return fit
    added = np.zeros(len(fit.covariance))
    one = sine_rounding_std(fit.residual_std, step, fit.amplitude) ** 2
    added[0], added[1 : 1 + 2 * len(fit.phasors)] = one / 4.0, one / 2.0
    return replace(fit, covariance=fit.covariance + np.diag(added))


def _finished(solved: Solved, values: Array, drift: Array, cycles_per_sample: float, frequency_hz: float) -> SineFit:
    """The fit with its uncertainty."""
    rest = solved.residuals(values, drift)
    n, p = len(values), len(solved.parameters)
    variance = float(np.sum(np.square(rest))) / (n - p)
    bound = variance * solved.inverse
    k = solved.basis.harmonics
    lines = np.sqrt(colour_factors(rest, cycles_per_sample * np.arange(k + 1, dtype=np.float64)))
    # drift is as slow as the offset
    colour = np.concatenate((lines[:1], np.repeat(lines[1:], 2), np.full(p - 1 - 2 * k, lines[0])))
    return SineFit(
        frequency_hz, float(solved.parameters[0]), solved.phasors, solved.parameters[1 + 2 * k :], math.sqrt(variance),
        bound * np.outer(colour, colour), bound, n, n * cycles_per_sample,
    )  # fmt: skip


def _powers(time_s: Array, order: int) -> Array:
    half = (time_s[-1] - time_s[0]) / 2.0
    middle = (time_s[-1] + time_s[0]) / 2.0
    x = (time_s - middle) / half
    return np.array([x**power for power in range(1, order + 1)]).reshape(order, len(time_s))


def _cycles(time_s: Array, frequency_hz: float) -> float:
    return float(frequency_hz * (time_s[-1] - time_s[0]) / (len(time_s) - 1))


def _along(covariance: Array, direction: complex) -> float:
    """Standard deviation of a phasor along a direction in the complex plane."""
    size = abs(direction)
    if size == 0.0:
        return math.sqrt(float(np.trace(covariance)) / 2.0)
    unit = np.array([direction.real, direction.imag]) / size
    return math.sqrt(float(unit @ covariance @ unit))


def _check(time_s: Array, values: Array, frequency_hz: float, harmonics: int, drift_order: int) -> None:
    n, wanted = len(time_s), 1 + 2 * harmonics + drift_order
    if frequency_hz <= 0.0 or harmonics < 1 or drift_order < 0:
        raise SettingError(
            f"sine fit: frequency {frequency_hz:g} Hz, {harmonics} harmonics, drift order {drift_order}; "
            "frequency must be above 0, harmonics at least 1, drift order at least 0"
        )
    if len(values) != n or n <= wanted:
        raise SettingError(f"sine fit: {len(values)} samples on {n} stamps for {wanted} unknowns; more are needed")
    cycles = _cycles(time_s, frequency_hz)
    if cycles * harmonics >= 0.5:
        raise SettingError(
            f"sine fit: harmonic {harmonics} of {frequency_hz:g} Hz is beyond half the sample rate "
            f"({0.5 * frequency_hz / cycles:g} Hz); fit fewer harmonics"
        )
    if harmonics > 1 and n * cycles < 0.95:
        raise SettingError(
            f"sine fit: {n * cycles:.2g} periods of {frequency_hz:g} Hz; harmonics need at least one, "
            "fit the fundamental alone or record longer"
        )
