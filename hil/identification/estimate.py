"""Weighted least squares on simulations: the one optimiser that identification and diagnosis share."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from hil.cores import spread
from hil.record.recording import Array
from hil.signals.colour import colour_factor

_RELATIVE_STEP = 1e-3
_FIRST_DAMPING = 1e-3
_STILL = 1e-9
# Slopes are carried on by secants while a step brings at least this share of what they promised.
_AS_PROMISED = 0.5
# A value has a part in a direction, of unit length in scales, that leads along it by more than this.
_HAS_A_PART = 1e-3


@dataclass(frozen=True, slots=True)
class Unknown:
    """A number to be estimated: where it starts, how far it may go, its natural size and unit."""

    name: str
    unit: str
    start: float
    low: float
    high: float
    scale: float

    def at_bound(self, value: float) -> bool:
        """Whether a value lies on a bound, as near as a fit comes to one."""
        return min(value - self.low, self.high - value) <= 1e-3 * self.scale


@dataclass(frozen=True, slots=True)
class Told:
    """What data tell of k values together.

    Attributes:
        covariance: in all directions but those that no sample tells, shape (k, k).
        untold: those directions, orthonormal in the values' scales, shape (m, k).
    """

    covariance: Array
    untold: Array

    @property
    def is_untold(self) -> NDArray[np.bool_]:
        """Which values have a part in a direction that no sample tells, shape (k,)."""
        return np.asarray(np.linalg.norm(self.untold, axis=0) > _HAS_A_PART)


@dataclass(frozen=True)
class Estimate:
    """The outcome of a fit.

    Attributes:
        unknowns: what was estimated.
        values: shape (k,).
        residuals: weighted, shape (n,).
        converged: whether the optimiser met its tolerance. `sentence`: what it said.
        slopes_at_values: computes the `jacobian`; most fits of a search are only compared, and none asks for it.
    """

    unknowns: tuple[Unknown, ...]
    values: Array
    residuals: Array
    converged: bool
    sentence: str
    slopes_at_values: Callable[[], Array]

    @cached_property
    def jacobian(self) -> Array:
        """Of the residuals, shape (n, k)."""
        return self.slopes_at_values()

    @cached_property
    def told(self) -> Told:
        """What the data tell of the values together."""
        return _told(self.jacobian, self.residuals, np.array([u.scale for u in self.unknowns]))

    @property
    def covariance(self) -> Array:
        """Shape (k, k), scaled by the residual's variance and its colour; infinite variances of what is not told."""
        infinite: Array = np.diag(np.where(self.told.is_untold, np.inf, 0.0))
        return self.told.covariance + infinite

    @property
    def chi2(self) -> float:
        """Sum of squared weighted residuals."""
        return float(self.residuals @ self.residuals)

    @property
    def std(self) -> Array:
        """Standard uncertainties, infinite where the data cannot tell."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def on_bound(self) -> tuple[str, ...]:
        """Names of the unknowns that ended on a bound of theirs."""
        return tuple(u.name for u, value in zip(self.unknowns, self.values, strict=True) if u.at_bound(value))

    def std_holding(self, k: int, held: Collection[int]) -> float:
        """Standard uncertainty of value k if those that are held were known."""
        free = [i for i in range(len(self.unknowns)) if i not in held]
        scale = np.array([self.unknowns[i].scale for i in free])
        told, at = _told(self.jacobian[:, free], self.residuals, scale), free.index(k)
        return float("inf") if told.is_untold[at] else float(np.sqrt(told.covariance[at, at]))

    def value(self, name: str) -> float:
        """An estimated value by name."""
        return float(self.values[[u.name for u in self.unknowns].index(name)])


def side_by_side(errors_of: Callable[[int], Sequence[Array]], recordings: int) -> Array:
    """The errors of every recording, by its number, one after another; simulated side by side."""
    return np.concatenate([error for errors in spread(errors_of, range(recordings)) for error in errors])


def estimate(
    residuals: Callable[[Array], Array],
    unknowns: Sequence[Unknown],
    *,
    sketch: Callable[[Array], Array] | None = None,
    max_evaluations: int = 60,
    tolerance: float = 1e-7,
) -> Estimate:
    """Minimise the sum of squared residuals within the bounds, from the unknowns' start values.

    `residuals` maps values of shape (k,) to weighted residuals of shape (n,); it is called from threads. `sketch`, a
    quicker function that moves nearly as `residuals` do, is asked for the slopes on the way.

    Levenberg and Marquardt; slopes are differences once, and secants as long as steps bring what they promise. It ends
    only by slopes from differences. `max_evaluations` counts the steps that were taken by those.
    """
    low = np.array([u.low for u in unknowns])
    high = np.array([u.high for u in unknowns])
    scale = np.array([u.scale for u in unknowns])
    values = np.clip([u.start for u in unknowns], low, high)
    r = residuals(values)
    if not len(unknowns):
        return Estimate((), values, r, True, "nothing to estimate", lambda: np.zeros((len(r), 0)))

    def differences() -> Array:
        if sketch is None:
            return jacobian(residuals, values, high, scale, r)
        return jacobian(sketch, values, high, scale, sketch(values))

    slopes, secants = differences(), 0
    damping, evaluations, sentence = _FIRST_DAMPING, 1, ""
    while not sentence:
        moved = np.clip(values + _damped_step(slopes, r, values, low, high, scale, damping), low, high)
        step = (moved - values) / scale
        still = bool(np.all(np.abs(step) <= _STILL))
        new = r if still else residuals(moved)
        evaluations += not secants
        foretold = r + slopes @ (moved - values)
        gain, promise = float(r @ r - new @ new), float(r @ r - foretold @ foretold)
        fell = gain > 0.0  # also False when the new residuals are not finite
        converged = still or (fell and gain < tolerance * float(r @ r))
        if fell:
            values, r = moved, new
            damping = max(damping / 5.0, 1e-9)
        elif not secants:
            damping *= 4.0
        if converged and not secants:
            sentence = "no step improves any further" if still else "the misfit no longer falls"
        elif evaluations >= max_evaluations:
            sentence = f"stopped after {evaluations} evaluations"
        elif fell and not converged and gain >= _AS_PROMISED * promise and secants < len(unknowns):
            slopes, secants = _secant(slopes, step, scale, new - foretold), secants + 1
        elif fell or secants:
            slopes, secants = differences(), 0
    done = not sentence.startswith("stopped")
    return Estimate(tuple(unknowns), values, r, done, sentence, partial(jacobian, residuals, values, high, scale, r))


def _secant(slopes: Array, step: Array, scale: Array, missed: Array) -> Array:
    """The slopes that would have foretold a step, in scales, that missed by so much (Broyden, Math. Comp. 19, 1965)."""
    corrected: Array = slopes.T + np.outer(step / scale, missed / float(step @ step))
    return corrected.T


def _damped_step(
    slopes: Array, r: Array, values: Array, low: Array, high: Array, scale: Array, damping: float
) -> Array:
    """A Levenberg–Marquardt step; unknowns that press against a bound stay there.

    On the normal equations: unknowns are few and scaled, samples are many, and a decomposition of the slopes
    would cost more than the simulations.
    """
    gradient = scale * (slopes.T @ r)
    pressed = ((values <= low) & (gradient > 0.0)) | ((values >= high) & (gradient < 0.0))
    free = np.flatnonzero(~pressed)
    information = (slopes.T @ slopes * np.outer(scale, scale))[np.ix_(free, free)]
    weights = np.maximum(np.diag(information), 1e-12 * max(float(np.trace(information)), 1e-300))
    step = np.zeros_like(values)
    step[free] = -np.linalg.solve(information + damping * np.diag(weights), gradient[free])
    return step * scale


def jacobian(residuals: Callable[[Array], Array], values: Array, high: Array, scale: Array, base: Array) -> Array:
    """Forward differences in all unknowns at once (in threads), stepping away from a near bound; shape (n, k).

    Every column lies in one piece: products with long, narrow arrays are as quick as memory then.
    """

    def column(k: int) -> Array:
        step = _RELATIVE_STEP * scale[k]
        if values[k] + step > high[k]:
            step = -step
        moved = values.copy()
        moved[k] += step
        slope: Array = (residuals(moved) - base) / step
        return slope

    return np.array(spread(column, range(len(values)))).T


def _told(jac: Array, residuals: Array, scale: Array) -> Told:
    """Inverse information, times residual variance and the loss of independent samples by colour."""
    scaled = jac * scale
    information = scaled.T @ scaled
    values, vectors = np.linalg.eigh(information)
    blind = values <= 1e-12 * values.max()
    inverse = vectors @ np.diag(np.where(blind, 0.0, 1.0 / np.where(blind, 1.0, values))) @ vectors.T
    dof = max(len(residuals) - len(scale), 1)
    covariance = inverse * (residuals @ residuals) / dof * colour_factor(residuals)
    return Told(covariance * np.outer(scale, scale), vectors[:, blind].T)
