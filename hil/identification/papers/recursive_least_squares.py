"""Recursive least squares on line: forgetting, a check of the excitation, and an uncertainty that holds.

y(t) = −a₁y(t−1) … −a_n·y(t−n) + b₀u(t−k) … + b_m·u(t−k−m) + e(t), or the same for the changes Δy and Δu (eq. 3.7 of
the EFC thesis). With exponential forgetting the update is eqs 3.13 to 3.15. Directional forgetting (Cao
and Schwartz, 2000) forgets only in the direction that a new sample tells about, so that a command that stands still
does not blow up the gain.

The covariance is that of the estimate, not the P of eq. 3.15: with forgetting the two differ, P is up to twice too
large. Both assume that e is white; noise that is added to the output instead biases the estimate, as it does in
every least-squares estimate of this form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from hil.errors import InputError
from hil.record.recording import Array, Complex

Forgetting = Literal["exponential", "directional"]

_KNOWN = 0.1  # of the prior's standard deviation: a direction that is left with less counts as excited
_EXCITED = 1e-6  # of the largest eigenvalue, below which a direction of lagged inputs counts as missing


@dataclass(frozen=True, slots=True)
class ArxForm:
    """What is estimated: `poles` coefficients a, `inputs` coefficients b, the input `delay` samples late.

    `difference` takes the changes from sample to sample in place of the values, which removes offsets. Before the
    first sample both signals count as 0.
    """

    poles: int
    inputs: int
    delay: int = 0
    difference: bool = False

    def __post_init__(self) -> None:
        if self.poles < 0 or self.inputs < 1 or self.delay < 0:
            raise InputError(
                f"recursive least squares with {self.poles} poles, {self.inputs} inputs and a delay of {self.delay} "
                "samples; poles and delay may not be negative, and at least one input coefficient is needed"
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Of the parameters in their order: a1 …, b0 …."""
        return (*(f"a{i + 1}" for i in range(self.poles)), *(f"b{i}" for i in range(self.inputs)))

    @property
    def reach(self) -> int:
        """How many samples before one its regression reaches back."""
        return max(self.poles, self.delay + self.inputs - 1) + int(self.difference)

    def regression(self, command: Array, output: Array) -> tuple[Array, Array]:
        """ψ of every sample, shape (n, k), and what it is to make, shape (n,); both signals begin `reach` before."""
        signals = np.array((command, output))
        u, y = np.diff(signals) if self.difference else signals
        first = self.reach - int(self.difference)

        def late(values: Array, by: int) -> Array:
            return values[first - by : len(values) - by]

        columns = [-late(y, k + 1) for k in range(self.poles)]
        columns += [late(u, self.delay + k) for k in range(self.inputs)]
        return np.column_stack(columns), y[first:]


@dataclass(frozen=True, slots=True)
class Excitation:
    """The information in the samples, direction by direction.

    Attributes:
        informed: number of directions in which the prior's standard deviation fell below a tenth of itself.
        asked: number of parameters.
        unknown: parameters that are still more than a tenth as uncertain as before the first sample.
    """

    informed: int
    asked: int
    unknown: tuple[str, ...]

    @property
    def enough(self) -> bool:
        """Whether every direction is informed."""
        return self.informed == self.asked


@dataclass(slots=True)
class RecursiveLeastSquares:
    """The estimator; feed it a block of samples at a time with `run`.

    Args:
        form: what is estimated.
        memory: λ, the weight of a sample that is one older, 0 < λ ≤ 1; 1/(1 − λ) samples are remembered.
        forgetting: `directional` forgets only where new samples bring news, `exponential` everywhere.
        prior_std: standard deviation of each parameter before the first sample, in units of the noise's: the
            root of P(0) of eq. 3.15. One small against what the signals carry acts as a spring to the start.

    Attributes:
        parameters: the estimate, 0 before the first sample. `samples`: how many it was made of.
        gain_matrix: P of eq. 3.15, shape (k, k).

    Raises:
        InputError: λ is not in 0…1, or the prior is not above 0.
    """

    form: ArxForm
    memory: float = 1.0
    forgetting: Forgetting = "directional"
    prior_std: float = 1e3
    parameters: Array = field(init=False)
    samples: int = field(default=0, init=False)
    gain_matrix: Array = field(init=False)
    _information: Array = field(init=False)
    _covariance: Array = field(init=False)
    _past: Array = field(init=False)
    _noise: Array = field(init=False)

    def __post_init__(self) -> None:
        if not 0.0 < self.memory <= 1.0 or not self.prior_std > 0.0:
            raise InputError(
                f"recursive least squares: memory {self.memory:g}, prior_std {self.prior_std:g}; memory lies in 0…1, "
                "prior_std above 0"
            )
        one = np.eye(len(self.form.names))
        self.parameters, self._information = np.zeros(len(one)), one / self.prior_std**2
        self.gain_matrix, self._covariance = self.prior_std**2 * one, self.prior_std**2 * one
        self._past, self._noise = np.zeros((2, self.form.reach)), np.zeros(2)

    def run(self, command: Array, output: Array) -> Array:
        """Take samples in, both of shape (n,); returns the parameters after each of them, shape (n, k)."""
        signals = np.hstack((self._past, (command, output)))
        self._past = signals[:, len(output) :]
        path = np.empty((len(output), len(self.parameters)))
        for t, (psi, now) in enumerate(zip(*self.form.regression(*signals), strict=True)):
            self._take(psi, now)
            path[t] = self.parameters
        self.samples += len(output)
        return path

    def _take(self, psi: Array, now: float) -> None:
        """Eqs 3.13 to 3.15, and the covariance (I − Kψᵀ)S(I − Kψᵀ)ᵀ + KKᵀ that this gain K really leaves."""
        directional = self.forgetting == "directional"
        if directional:
            self._forget(psi)
        by_gain, by_covariance = self.gain_matrix @ psi, self._covariance @ psi
        error, doubt = now - float(psi @ self.parameters), float(psi @ by_covariance)
        forget = 1.0 if directional else self.memory
        expected = forget + float(psi @ by_gain)
        gain = by_gain / expected
        # the noise's variance: an error is expected at variance·(1 + doubt), so the first ones say next to nothing
        weight = 1.0 / (1.0 + doubt)
        self._noise = self.memory * self._noise + (weight, (weight * error) ** 2)
        self.parameters = self.parameters + gain * error
        self.gain_matrix = (self.gain_matrix - np.outer(by_gain, by_gain) / expected) / forget
        crossed = np.outer(gain, by_covariance)
        self._covariance = self._covariance + (1.0 + doubt) * np.outer(gain, gain) - crossed - crossed.T

    def _forget(self, psi: Array) -> None:
        """Forget what is known about the direction of a new sample, and nothing else; then it is known."""
        known_along = self._information @ psi
        if not (known := float(psi @ known_along)) > 0.0:
            return
        lost = (1.0 - self.memory) / known
        self.gain_matrix = self.gain_matrix + lost / self.memory * np.outer(psi, psi)
        self._information = self._information + np.outer(psi, psi) - lost * np.outer(known_along, known_along)

    @property
    def noise_std(self) -> float:
        """Standard deviation of e, from the prediction errors and the uncertainty at which each was met."""
        weight, total = self._noise.tolist()
        return math.sqrt(total / weight) if weight > 0.0 else math.inf

    @property
    def std(self) -> Array:
        """Standard uncertainties of the parameters; those of the prior, in units of noise, where samples hold none."""
        return np.sqrt(np.maximum(np.diag(self._covariance), 0.0)) * self.noise_std

    @property
    def excitation(self) -> Excitation:
        """The information in the samples so far."""
        left = self._covariance / self.prior_std**2
        informed = int(np.count_nonzero(np.linalg.eigvalsh(left) < _KNOWN**2))
        vague = np.sqrt(np.maximum(np.diag(left), 0.0)) >= _KNOWN
        unknown = tuple(name for name, open_ in zip(self.form.names, vague, strict=True) if open_)
        return Excitation(informed, len(self.form.names), unknown)

    @property
    def numerator(self) -> Array:
        """B in powers of z⁻¹ from z⁰ on."""
        return np.concatenate((np.zeros(self.form.delay), self.parameters[self.form.poles :]))

    @property
    def denominator(self) -> Array:
        """A in powers of z⁻¹, the first 1."""
        return np.concatenate(([1.0], self.parameters[: self.form.poles]))

    @property
    def poles(self) -> Complex:
        """Roots of A in z; a model whose largest lies outside the unit circle cannot be simulated."""
        return np.roots(self.denominator).astype(np.complex128)


def excitation_order(command: Array, most: int, difference: bool = False) -> int:
    """How many parameters a command can tell apart in steady state, counted up to `most`.

    The rank of the covariance of the command and its lags: 1 for a constant, 2 for each sine (a constant beside it
    counts 1), `most` for noise or a binary sequence. The lags' scale does not matter.
    """
    values = np.diff(command) if difference else np.asarray(command, dtype=np.float64)
    if len(values) < 2 * most:
        raise InputError(f"excitation order up to {most}: {len(values)} samples; at least {2 * most} are needed")
    lags = np.lib.stride_tricks.sliding_window_view(values, most)
    power = np.linalg.eigvalsh(lags.T @ lags / len(lags))
    return int(np.count_nonzero(power > _EXCITED * power[-1])) if power[-1] > 0.0 else 0
