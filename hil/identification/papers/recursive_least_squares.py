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
from typing import Any, Literal, NamedTuple

import numpy as np

from hil.errors import InputError
from hil.kernel import kernel
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


@dataclass(frozen=True, slots=True)
class Excitation:
    """What the samples have told, direction by direction.

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
    """The estimator; feed it sample by sample with `update`, or a block at a time with `run`.

    Args:
        form: what is estimated.
        memory: λ, the weight of a sample that is one older, 0 < λ ≤ 1; 1/(1 − λ) samples are remembered.
        forgetting: `directional` forgets only where new samples bring news, `exponential` everywhere.
        prior_std: standard deviation of each parameter before the first sample, in units of the noise's: the
            root of P(0) of eq. 3.15. One small against what the signals carry acts as a spring to the start.
        start: parameters before the first sample, 0 when None.

    Raises:
        InputError: λ is not in 0…1, the prior is not above 0, or the start has another length.
    """

    form: ArxForm
    memory: float = 1.0
    forgetting: Forgetting = "directional"
    prior_std: float = 1e3
    start: Array | None = None
    parameters: Array = field(init=False)
    samples: int = field(default=0, init=False)
    _state: _State = field(init=False)

    def __post_init__(self) -> None:
        size = len(self.form.names)
        if not 0.0 < self.memory <= 1.0 or not self.prior_std > 0.0:
            raise InputError(
                f"recursive least squares: memory {self.memory:g}, prior_std {self.prior_std:g}; memory lies in 0…1, "
                "prior_std above 0"
            )
        start = np.zeros(size) if self.start is None else np.array(self.start, dtype=np.float64)
        if start.shape != (size,):
            raise InputError(f"recursive least squares: {len(start)} start values for {', '.join(self.form.names)}")
        self.parameters, prior = start, self.prior_std**2
        self._state = _State(
            prior * np.eye(size), np.eye(size) / prior, prior * np.eye(size), np.zeros(size),
            np.zeros(self.form.delay + self.form.inputs), np.zeros(2), np.zeros(2), np.zeros((4, size)),
        )  # fmt: skip

    def update(self, command: float, output: float) -> float:
        """Take one sample in; returns the prediction error it met."""
        return float(self.run(np.array([command]), np.array([output]))[0])

    def run(self, command: Array, output: Array, path: Array | None = None) -> Array:
        """Take samples in, both of shape (n,); returns their prediction errors, shape (n,).

        Args:
            command: u.
            output: y.
            path: shape (n, parameters), filled with the parameters after each sample.
        """
        form = self.form
        errors = np.empty(len(output))
        _run(
            np.asarray(command, dtype=np.float64), np.asarray(output, dtype=np.float64), form.poles, form.inputs,
            form.delay, form.difference, self.memory, self.forgetting == "directional", self.parameters, *self._state,
            errors,
            np.empty((0, 0)) if path is None else path,
        )  # fmt: skip
        self.samples += len(errors)
        return errors

    @property
    def noise_std(self) -> float:
        """Standard deviation of e, from the prediction errors and the uncertainty at which each was met."""
        weight, total = self._state.noise
        return math.sqrt(total / weight) if weight > 0.0 else math.inf

    @property
    def covariance(self) -> Array:
        """Of the parameters, shape (k, k), prior included."""
        return self._state.covariance * self.noise_std**2

    @property
    def std(self) -> Array:
        """Standard uncertainties of the parameters; those of the prior, in units of noise, where nothing was told."""
        return np.sqrt(np.maximum(np.diag(self._state.covariance), 0.0)) * self.noise_std

    @property
    def excitation(self) -> Excitation:
        """What the samples have told so far."""
        left = self._state.covariance / self.prior_std**2
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


class _State(NamedTuple):
    """What the estimator carries from sample to sample besides its parameters; arrays are changed in place."""

    gain_matrix: Array
    information: Array
    covariance: Array
    past_outputs: Array
    past_inputs: Array
    last: Array
    noise: Array
    work: Array


@kernel(error_model="numpy")
def _run(
    u: Any, y: Any, poles: Any, inputs: Any, delay: Any, difference: Any, memory: Any, directional: Any, theta: Any,
    p: Any, r: Any, s: Any, past_y: Any, past_u: Any, last: Any, noise: Any, work: Any, errors: Any, path: Any,
) -> None:  # fmt: skip
    """Samples in turn. `p` is the gain's matrix, `r` its inverse, `s` the covariance over the noise's variance."""
    psi = work[0]
    for t in range(len(y)):
        now_u, now_y = u[t], y[t]
        if difference:
            now_u, now_y = u[t] - last[0], y[t] - last[1]
        last[0], last[1] = u[t], y[t]
        for i in range(len(past_u) - 1, 0, -1):
            past_u[i] = past_u[i - 1]
        past_u[0] = now_u
        for i in range(poles):
            psi[i] = -past_y[i]
        for i in range(inputs):
            psi[poles + i] = past_u[delay + i]
        if directional:
            _forget(p, r, psi, work[1], memory)
        errors[t] = _correct(theta, p, s, work, now_y, 1.0 if directional else memory, memory, noise)
        for i in range(poles - 1, 0, -1):
            past_y[i] = past_y[i - 1]
        if poles:
            past_y[0] = now_y
        if len(path):
            # number by number: a row's check of shapes, with the text it fails with, compiles for seconds
            for i in range(len(theta)):
                path[t, i] = theta[i]


@kernel(error_model="numpy")
def _forget(p: Any, r: Any, psi: Any, rp: Any, memory: Any) -> None:
    """Forget what `r` knows about the direction of `psi`, and nothing else; then `r` takes the new sample in."""
    n = len(psi)
    known = 0.0
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += r[i, j] * psi[j]
        rp[i] = total
        known += psi[i] * total
    if not known > 0.0:
        return
    lost, grown = (1.0 - memory) / known, (1.0 - memory) / (memory * known)
    for i in range(n):
        for j in range(n):
            p[i, j] += grown * psi[i] * psi[j]
            r[i, j] += psi[i] * psi[j] - lost * rp[i] * rp[j]


@kernel(error_model="numpy")
def _correct(theta: Any, p: Any, s: Any, work: Any, now: Any, forget: Any, memory: Any, noise: Any) -> Any:
    """Eqs 3.13 to 3.15, and the covariance (I − Kψᵀ)S(I − Kψᵀ)ᵀ + KKᵀ that this gain K really leaves."""
    n = len(theta)
    psi, pp, sp, gain = work[0], work[1], work[2], work[3]
    error, news, doubt = now, 0.0, 0.0
    for i in range(n):
        a, b = 0.0, 0.0
        for j in range(n):
            a += p[i, j] * psi[j]
            b += s[i, j] * psi[j]
        pp[i], sp[i] = a, b
        error -= psi[i] * theta[i]
        news += psi[i] * a
        doubt += psi[i] * b
    # the noise's variance: an error is expected at variance·(1 + doubt), so the first ones say next to nothing
    weight = 1.0 / (1.0 + doubt)
    noise[0] = memory * noise[0] + weight
    noise[1] = memory * noise[1] + weight * weight * error * error
    for i in range(n):
        gain[i] = pp[i] / (forget + news)
        theta[i] += gain[i] * error
    for i in range(n):
        for j in range(i + 1):
            p[i, j] = (p[i, j] - gain[i] * pp[j]) / forget
            p[j, i] = p[i, j]
            s[i, j] += (1.0 + doubt) * gain[i] * gain[j] - gain[i] * sp[j] - sp[i] * gain[j]
            s[j, i] = s[i, j]
    return error
