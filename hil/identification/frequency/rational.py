"""Least squares of a rational transfer function on complex data: the numerics, without any judgement.

The model is written in factors, gain·Π(1 + n₁s + n₂s²)/Π(1 + d₁s + d₂s²)·e^(−sT), because in them a stable
pole, a zero outside the right half plane and a gain at rest are plain bounds, every derivative is the model
over a factor, and real and complex pairs turn into each other without a seam. The start comes from the
linear problem of Levy, iterated as Sanathanan and Koerner (IEEE Trans. Autom. Control 8(1), 1963) do.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from hil.kernel import kernel
from hil.physics.transfer_function import sections
from hil.record.recording import Array, Complex

_FAR_IN = 1e-9  # of the middle of the band
_SK_STEPS = 8
_DELAY_STARTS = 10
_REFINED_STARTS = 3
_NO_LESS = 1e-6  # smallest d of a pole that must be stable, in units of 1/mean frequency


@dataclass(frozen=True, slots=True)
class Form:
    """How many poles and zeros, whether there is a dead time, and what is not allowed or fixed.

    Attributes:
        dead_time: whether it is estimated; else it is `dead_time_s`.
        stable: poles only in the left half plane. `minimum_phase`: zeros too.
    """

    poles: int
    zeros: int
    dead_time: bool = False
    dead_time_s: float = 0.0
    stable: bool = True
    minimum_phase: bool = False

    @property
    def lags(self) -> tuple[int, ...]:
        """Orders of the denominator's factors: pairs, and a single one when the count is odd."""
        return (2,) * (self.poles // 2) + (1,) * (self.poles % 2)

    @property
    def leads(self) -> tuple[int, ...]:
        """Orders of the numerator's factors."""
        return (2,) * (self.zeros // 2) + (1,) * (self.zeros % 2)

    @property
    def unknowns(self) -> int:
        """Number of parameters to estimate."""
        return self.poles + self.zeros + int(self.dead_time) + 1


@dataclass(frozen=True, slots=True)
class Solution:
    """Parameters of a form that fit best.

    Attributes:
        parameters: [gain, d₁ d₂ of each lag, n₁ n₂ of each lead, dead time (if free)].
        residuals: whitened, real and imaginary parts in turn, shape (2n,). `jacobian`: of them, shape (2n, p).
        converged: whether the optimiser met its tolerance.
    """

    form: Form
    parameters: Array
    residuals: Array
    jacobian: Array
    converged: bool

    @property
    def chi2(self) -> float:
        """Sum of squared residuals."""
        return float(self.residuals @ self.residuals)


@dataclass(frozen=True, slots=True)
class Data:
    """Complex data on s = jω, and what makes their errors white.

    Attributes:
        s: shape (n,), in units of `scale` rad/s. `response`: shape (n,).
        own, mirrored: shape (n,); own · error + mirrored · conjugate of the error has parts of unit variance.
    """

    s: Complex
    response: Complex
    own: Complex
    mirrored: Complex
    scale: float

    def white(self, values: Complex) -> Array:
        """Whitened real and imaginary parts of (n,) or (p, n) complex values, shape (2n,) or (2n, p)."""
        return (self.own * values + self.mirrored * values.conj()).view(np.float64).T


def data(frequency_hz: Array, response: Complex, whitening: Array) -> Data:
    """Data with frequency scaled to the geometric middle of its band, for the conditioning of the powers of s."""
    omega = 2.0 * math.pi * frequency_hz
    scale = math.sqrt(omega[0] * omega[-1])
    s = np.asarray(1j * omega / scale, dtype=np.complex128)
    (a, b), (c, d) = whitening.transpose(1, 2, 0)  # of (Re, Im)
    return Data(s, response, (a + d + 1j * (c - b)) / 2.0, (a - d + 1j * (c + b)) / 2.0, scale)


def solve(form: Form, given: Data, start: Array | None = None) -> Solution:
    """The best parameters of a form, from a start or, when none is given, from the linear problem's solutions."""
    with np.errstate(all="ignore"):  # where a factor is zero there is no number
        starts = _starts(form, given) if start is None else [start]
        free = [(_free(form, given, begin), begin) for begin in starts]
        low, found = bounds(form)[0], []
        for one, begin in sorted(free, key=lambda pair: pair[0].chi2 if math.isfinite(pair[0].chi2) else 0.0):
            if math.isfinite(one.chi2) and np.all(one.parameters >= low):
                found.append(one)
                break  # within bounds none behind it would come below it
            found.append(_within(form, given, begin, one.parameters))
    return min(found, key=lambda solution: solution.chi2)


def evaluate(form: Form, parameters: Array, s: Complex) -> tuple[Complex, Complex]:
    """Model values (n,) and their derivatives (n, p) with respect to the parameters."""
    with np.errstate(all="ignore"):
        values, slopes = _model(form, parameters, s)
    return values, slopes.T


def _model(form: Form, parameters: Array, s: Complex) -> tuple[Complex, Complex]:
    """Model values (n,) and their derivatives, shape (p, n); no number where a factor is zero."""
    dead_time = parameters[-1] if form.dead_time else form.dead_time_s
    return _factored(np.array(form.lags + form.leads), len(form.lags), np.array(parameters), dead_time, s)


@kernel(error_model="numpy")
def _factored(orders: Array, lags: int, parameters: Array, dead_time: float, s: Complex) -> tuple[Complex, Complex]:
    values, slopes = np.empty(len(s), np.complex128), np.empty((len(parameters), len(s)), np.complex128)
    for line, at_line in enumerate(s):
        shape = np.exp(-at_line * dead_time)
        first = 1
        for place, order in enumerate(orders):
            factor = 1.0 + parameters[first] * at_line
            if order == 2:
                factor += parameters[first + 1] * at_line * at_line
            square = factor.real**2 + factor.imag**2  # numba refuses to divide by a complex zero
            inverse = complex(factor.real / square, -factor.imag / square)
            share = at_line * inverse if place >= lags else -at_line * inverse
            shape *= factor if place >= lags else inverse
            for power in range(order):
                slopes[first + power, line] = share
                share *= at_line
            first += order
        values[line] = shape * parameters[0]
        slopes[0, line] = shape
        slopes[1:first, line] *= values[line]
        slopes[first:, line] = -at_line * values[line]
    return values, slopes


def _whitened(form: Form, given: Data, parameters: Array) -> tuple[Array, Array]:
    """Whitened errors of the model, shape (2n,), and their derivatives, shape (2n, p)."""
    dead_time = parameters[-1] if form.dead_time else form.dead_time_s
    orders, lags = np.array(form.lags + form.leads), len(form.lags)
    white = _errors(orders, lags, parameters, dead_time, given.s, given.response, given.own, given.mirrored)
    return white[:, 0], white[:, 1:]


@kernel(error_model="numpy")
def _errors(
    orders: Array, lags: int, parameters: Array, dead_time: float,
    s: Complex, response: Complex, own: Complex, mirrored: Complex,
) -> Array:  # fmt: skip
    values, slopes = _factored(orders, lags, parameters, dead_time, s)
    both = np.empty((len(parameters) + 1, len(s)), np.complex128)
    both[0], both[1:] = values - response, slopes
    return (own * both + mirrored * np.conj(both)).view(np.float64).T


def bounds(form: Form) -> tuple[Array, Array]:
    """Lower and upper bounds of the parameters."""
    low = [-math.inf, *[_NO_LESS if form.stable else -math.inf] * form.poles]
    low += [0.0 if form.minimum_phase else -math.inf] * form.zeros
    low += [0.0] * int(form.dead_time)
    return np.array(low), np.full(len(low), math.inf)


def _free(form: Form, given: Data, start: Array) -> Solution:
    """Levenberg–Marquardt with the analytic Jacobian, without bounds."""
    from scipy.optimize import leastsq

    errors, slopes = _remembered(form, given)
    x, *_, ended = leastsq(errors, start, (), slopes, full_output=True, xtol=1e-12, ftol=1e-12, gtol=1e-8)
    return Solution(form, x, errors(x), slopes(x), ended in range(1, 5))


def _within(form: Form, given: Data, start: Array, free: Array) -> Solution:
    """The same within bounds, from a free optimum that leaves them."""
    from scipy.optimize import least_squares

    low, high = bounds(form)
    errors, slopes = _remembered(form, given)
    inside = np.maximum(np.where(np.isfinite(free), free, start), np.where(low > 0.0, 2.0 * low, low))
    found = least_squares(errors, inside, slopes, bounds=(low, high), x_scale="jac", xtol=1e-9, ftol=1e-9)
    return Solution(form, found.x, errors(found.x), slopes(found.x), found.status > 0)


def _remembered(form: Form, given: Data) -> tuple[Callable[[Array], Array], Callable[[Array], Array]]:
    """Errors, and their slopes: the optimiser asks for the errors of a point, then for their slopes."""

    @lru_cache(maxsize=1)
    def at(point: bytes) -> tuple[Array, Array]:
        return _whitened(form, given, np.frombuffer(point))

    return lambda parameters: at(parameters.tobytes())[0], lambda parameters: at(parameters.tobytes())[1]


def _starts(form: Form, given: Data) -> list[Array]:
    if not form.dead_time:
        return [_linear_start(form, given, form.dead_time_s)]
    top = float(given.s[-1].imag)
    lag = max(-float(np.unwrap(np.angle(given.response))[-1]), 1.0)

    def chi2(start: Array) -> float:
        error, _ = _whitened(form, given, start)
        return float(error @ error)

    tried = [_linear_start(form, given, dead_time) for dead_time in np.linspace(0.0, lag / top, _DELAY_STARTS).tolist()]
    return sorted(tried, key=chi2)[:_REFINED_STARTS]


def _linear_start(form: Form, given: Data, dead_time: float) -> Array:
    """Levy's linear problem, reweighted by the last denominator, at the best of its rounds; factors within the bounds.

    Of lines that no form comes near the weights run away from round to round.
    """
    n, m = form.poles, form.zeros
    powers = given.s[:, None] ** np.arange(max(n, m) + 1)
    late = given.response * np.exp(given.s * dead_time)
    weight = np.hypot(np.abs(given.own), np.abs(given.mirrored))
    below = np.ones(len(given.s), dtype=np.complex128)
    best, least = np.zeros(m + 1 + n), math.inf
    for _ in range(_SK_STEPS):
        # B(s) − H·(A(s) − 1) = H with A = 1 + a₁s + …
        matrix = (
            np.hstack((powers[:, : m + 1], -late[:, None] * powers[:, 1 : n + 1])) * (weight / np.abs(below))[:, None]
        )
        right = late * weight / np.abs(below)
        stacked = np.vstack((matrix.real, matrix.imag))
        norm = np.linalg.norm(stacked, axis=0)
        if not 0.0 < norm.min() <= norm.max() < math.inf:
            break
        solution = np.linalg.lstsq(stacked / norm, np.concatenate((right.real, right.imag)), rcond=None)[0] / norm
        below = 1.0 + powers[:, 1 : n + 1] @ solution[m + 1 :]
        if not below.all():
            break
        missed = float(np.linalg.norm(weight * (late - powers[:, : m + 1] @ solution[: m + 1] / below)))
        if missed < least:
            best, least = solution, missed
    return _factors(form, best[: m + 1], np.concatenate(([1.0], best[m + 1 :])), dead_time)


def _factors(form: Form, above: Array, below: Array, dead_time: float) -> Array:
    """Parameters of a form from polynomial coefficients, lowest power first, mirrored into the bounds."""
    late = [dead_time] if form.dead_time else []
    lags = _split(below, form.lags, mirror=form.stable)
    leads = _split(above / (above[0] or 1.0), form.leads, mirror=form.minimum_phase)
    return np.array([float(above[0]), *lags, *leads, *late])


def _split(coefficients: Array, orders: tuple[int, ...], *, mirror: bool) -> list[float]:
    """Factors 1 + f₁s (+ f₂s²) of a polynomial 1 + c₁s + …, the slowest real root in the single factor."""
    roots = np.roots(np.trim_zeros(coefficients[::-1], "f"))
    roots = np.where(np.abs(roots) < _FAR_IN, -_FAR_IN, roots)  # one at zero has no factor
    if mirror:
        roots = -np.maximum(np.abs(roots.real), _NO_LESS * np.abs(roots)) + 1j * roots.imag
    single, pairs = sections(np.concatenate((roots, np.full(sum(orders) - len(roots), -1e3))))  # a lost power: far out
    return [*(factor for pair in pairs for factor in pair), *single]
