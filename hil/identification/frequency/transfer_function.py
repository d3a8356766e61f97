"""A continuous transfer function from a frequency response, by maximum likelihood, with its uncertainty."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from hil.errors import InputError
from hil.identification.frequency.criteria import CRITERIA
from hil.identification.frequency.factored import coefficients, model_of, units
from hil.identification.frequency.frequency_response import FrequencyResponse
from hil.identification.frequency.rational import Form, data, solve
from hil.identification.uncertainty.fit import fit_percent
from hil.language.note import Note
from hil.physics.readings import readings
from hil.physics.transfer_function import TransferFunction, coefficient_names
from hil.record.recording import Array, Complex
from hil.signals.interval import rounded, width

Weights = Literal["covariance", "relative", "uniform"]


@dataclass(frozen=True, slots=True)
class Candidate:
    """A form that was tried.

    Attributes:
        bic: Bayesian information criterion, smaller is better.
        held_out: mean squared error at lines left out, in units of what the best candidate has left on all
            lines; NaN when the criterion alone ruled it out.
    """

    form: Form
    bic: float
    fit_percent: float
    held_out: float


@dataclass(frozen=True, slots=True)
class TransferFunctionFit:
    """A transfer function with the uncertainty of everything that follows from it.

    Attributes:
        model: the estimate.
        form: how many poles and zeros, and what was fixed.
        parameters: of the form, time in seconds (see `hil.identification.frequency.rational`).
        covariance: of the parameters, shape (p, p).
        weights: how lines were weighted; with anything but "covariance" the scale comes from the residual.
        misfit: χ² over degrees of freedom; 1 when only noise is left. NaN when the noise was not known.
        fit_percent: 100·(1 − ‖H − Ĥ‖/‖H − mean H‖), complex.
        frequency_hz, response: what was fitted, shape (n,).
        residuals: whitened, in units of the stated uncertainty where it was known, shape (2n,).
        notes: what the reader should know.
        alternative: the same data without the zeros in the right half plane, where there are some.
        candidates: every form that was tried, best evidence first, when the orders were left open.
        form_std_s: standard uncertainty of the dead time by its form, beside its scatter: by which was chosen, and by
            what responses in it disagree about; infinite where a zero in the right half plane is as good a description.
    """

    model: TransferFunction
    form: Form
    parameters: Array
    covariance: Array
    weights: Weights
    misfit: float
    fit_percent: float
    frequency_hz: Array
    response: Complex
    residuals: Array
    converged: bool
    notes: tuple[Note, ...] = ()
    alternative: TransferFunctionFit | None = None
    candidates: tuple[Candidate, ...] = ()
    form_std_s: float = 0.0

    @property
    def coefficients(self) -> Array:
        """[numerator, highest power first; denominator without its leading 1; dead time if free]."""
        return coefficients(self.form, self.parameters).real

    @property
    def coefficient_names(self) -> tuple[str, ...]:
        """b1, b0, a2, a1, a0, dead time: as in `coefficients`."""
        return coefficient_names(self.form.zeros, self.form.poles, self.form.dead_time)

    @property
    def coefficient_covariance(self) -> Array:
        """Of the coefficients, that of the dead time with what its form says of it (`form_std_s`)."""
        made = self.propagated(partial(coefficients, self.form))
        if self.form.dead_time:
            made[-1, -1] += self.form_std_s**2
        return made

    @property
    def scatter(self) -> Array:
        """Standard uncertainties of the coefficients, given the form."""
        return _stds(self.propagated(partial(coefficients, self.form)))

    @property
    def coefficient_std(self) -> Array:
        """Standard uncertainties of the coefficients; that of the dead time with its form."""
        return _stds(self.coefficient_covariance)

    def propagated(self, function: Callable[[Complex], Complex]) -> Array:
        """Covariance of an analytic real function of the parameters, by its complex-step derivative.

        `function` maps parameters (p,) to values (m,) and must accept complex parameters.
        """
        slope = np.empty((len(function(self.parameters.astype(np.complex128))), len(self.parameters)))
        for k, value in enumerate(self.parameters):
            step = 1e-30 * max(abs(value), 1e-30)
            moved = self.parameters.astype(np.complex128)
            moved[k] += 1j * step
            slope[:, k] = function(moved).imag / step
        return slope @ self.covariance @ slope.T

    def summary(self) -> str:
        """Time constants, oscillations, coefficients, each with 95 % intervals, poles, zeros, fit and notes."""
        rows = [
            f"{_counted(self.form.poles, 'pole')}, {_counted(self.form.zeros, 'zero')}, fit {self.fit_percent:.2f} %"
        ]
        model = self.model
        for one in readings(model.numerator, model.denominator, model.dead_time_s, self.coefficient_covariance):
            shown = rounded(one.value, one.std)
            rows.append(f"  {one.name:13} {shown:>12} {width(one.std)} {one.unit}".rstrip())
        for name, value, std in zip(self.coefficient_names, self.coefficients, self.coefficient_std, strict=True):
            rows.append(f"  {name:13} {rounded(value, std):>12} {width(std)}")
        rows.append("  poles " + ", ".join(map(_root, self.model.poles)) + " rad/s")
        if self.form.zeros:
            rows.append("  zeros " + ", ".join(map(_root, self.model.zeros)) + " rad/s")
        return "\n".join([*rows, *(f"  note: {note}" for note in self.notes)])


def _stds(covariance: Array) -> Array:
    return np.sqrt(np.maximum(np.diag(covariance), 0.0))


def _root(root: complex) -> str:
    return f"{root:.4g}" if root.imag else f"{root.real:.4g}"


def _counted(count: int, name: str) -> str:
    return f"{count} {name}" if count == 1 else f"{count} {name}s"


def fit_form(
    response: FrequencyResponse, form: Form, weights: Weights | None = None, start: Array | None = None
) -> TransferFunctionFit:
    """Fit a given number of poles and zeros.

    Args:
        response: lines with covariance, or a table without.
        form: poles, zeros, dead time, constraints.
        weights: "covariance" (default where it is known), "relative" (equal relative error, the default for a
            table) or "uniform" (what a fit in per cent maximises).
        start: parameters to begin from, as in `TransferFunctionFit.parameters`; found anew when None.

    Raises:
        InputError: fewer lines than unknowns, or an impossible form.
    """
    used = weights or ("covariance" if np.all(np.isfinite(response.covariance)) else "relative")
    check_form(response, form)
    given = data(response.frequency_hz, response.response, whitening(response, used))
    begin = None if start is None else start / units(form, given.scale)
    solved = solve(replace(form, dead_time_s=form.dead_time_s * given.scale), given, begin)
    seconds = units(form, given.scale)
    dof = 2 * len(response) - form.unknowns
    spread = solved.chi2 / dof
    # Known noise: the data set the scale, but a misfit beyond it widens every interval (Birge). Unknown: the
    # residual sets it.
    factor = max(1.0, spread) if used == "covariance" else spread
    inverse = np.linalg.pinv(solved.jacobian.T @ solved.jacobian, hermitian=True)
    later = given.white(given.s * given.scale * response.delay_std_s * given.response)
    moved = inverse @ solved.jacobian.T @ later  # by a delay that all lines share
    covariance = factor * inverse + np.outer(moved, moved)
    parameters = solved.parameters * seconds
    model = model_of(form, parameters)
    return TransferFunctionFit(
        model, form, parameters, covariance * np.outer(seconds, seconds), used,
        spread if used == "covariance" else math.nan,
        fit_percent(response.response, model.at(response.frequency_hz)),
        response.frequency_hz, response.response, solved.residuals, solved.converged,
    )  # fmt: skip


def check_form(response: FrequencyResponse, form: Form) -> None:
    """Raise `InputError` unless the form can be fitted to the lines."""
    if form.poles < 1 or form.zeros < 0 or form.zeros > form.poles or form.dead_time_s < 0.0:
        raise InputError(
            f"{form.poles} poles, {form.zeros} zeros, dead time {form.dead_time_s:g} s: at least one pole, no more "
            "zeros than poles and no negative dead time are possible"
        )
    if 2 * len(response) <= form.unknowns:
        raise InputError(
            f"{response.name}: {len(response)} frequencies for {form.unknowns} unknowns; "
            f"at least {form.unknowns // 2 + 1} are needed"
        )


def whitening(response: FrequencyResponse, weights: Weights) -> Array:
    """Matrices that make the errors of the lines white, shape (n, 2, 2)."""
    size = np.abs(response.response)
    if weights == "covariance":
        floor = (CRITERIA.floor * size) ** 2
        covariance = response.covariance + floor[:, None, None] * np.eye(2)
        return np.linalg.inv(np.linalg.cholesky(covariance))
    scale = size if weights == "relative" else np.full(len(size), float(np.mean(size)))
    return np.eye(2) / scale[:, None, None]
