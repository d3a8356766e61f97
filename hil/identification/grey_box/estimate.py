"""Weighted least squares on simulations: the one optimiser that identification and diagnosis share."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hil.arrays import LEAST, ROUNDING
from hil.cores import parallel_map
from hil.identification.uncertainty.identifiability import Curvature, Identifiability, identifiability, products
from hil.physics.plant import Parameter
from hil.record.recording import Array
from hil.signals.colour import colour_factor

_RELATIVE_STEP = 1e-3
_FIRST_DAMPING = 1e-3
# Slopes are carried on by secants while a step brings at least this share of what they promised.
_AS_PROMISED = 0.5


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

    def at_natural_end(self, value: float) -> bool:
        """Whether a share is nothing or all: an end that it may well have, and no bound that somebody chose."""
        return (self.unit, self.low, self.high) == ("1", 0.0, 1.0) and self.at_bound(value)


@dataclass(frozen=True)
class Estimate:
    """The outcome of a fit.

    Attributes:
        unknowns: what was estimated.
        values: shape (k,).
        residuals: weighted, shape (n,).
        converged: whether the optimiser met its tolerance.
        fixed_at_bound: places of values that are not identifiable whatever their slopes say.
        slopes_at_values: computes slopes and curvature; most fits of a search are only compared and ask for none.
    """

    unknowns: tuple[Unknown, ...]
    values: Array
    residuals: Array
    converged: bool
    slopes_at_values: Callable[[], tuple[Array, Curvature]]
    fixed_at_bound: tuple[int, ...] = ()

    @cached_property
    def _at_values(self) -> tuple[Array, Curvature]:
        return self.slopes_at_values()

    @property
    def jacobian(self) -> Array:
        """Slopes of the residuals, shape (n, k)."""
        return self._at_values[0]

    @property
    def curvature(self) -> Curvature:
        """Of the sum of their squares."""
        return self._at_values[1]

    @cached_property
    def identifiability(self) -> Identifiability:
        """What the data tell of the values; times residual variance and the loss of independent samples by colour."""
        variance = self.chi2 / max(self.count - len(self.unknowns), 1) * colour_factor(self.residuals)
        widths = np.array([u.high - u.low for u in self.unknowns])
        return identifiability(self.curvature, variance, widths, sorted(self.fixed_at_bound))

    @property
    def count(self) -> int:
        """How many residuals say something: where nothing was measured they are exactly 0."""
        return max(int(np.count_nonzero(self.residuals)), 1)

    @property
    def mean_square(self) -> float:
        """Of the residuals that say something."""
        return self.chi2 / self.count

    @property
    def covariance(self) -> Array:
        """Shape (k, k), scaled by the residual's variance and its colour; infinite where not identifiable."""
        infinite = np.diag(np.where(self.identifiability.is_unidentifiable, np.inf, 0.0))
        return self.identifiability.whole + infinite

    @property
    def named(self) -> dict[str, float]:
        """The values by the names of the unknowns."""
        return dict(zip((u.name for u in self.unknowns), self.values.tolist(), strict=True))

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

    def moved_by(self, change: Array) -> Array:
        """By how much the values would move if the residuals, shape (n,), changed by so much; shape (k,)."""
        return -self.identifiability.inverse @ (self.jacobian.T @ change)


def side_by_side(errors_of: Callable[[int], Sequence[Array]], recordings: int) -> Array:
    """The errors of every recording, by its number, one after another; simulated side by side."""
    return np.concatenate([error for errors in parallel_map(errors_of, range(recordings)) for error in errors])


def estimate(
    residuals: Callable[[Array], Array],
    unknowns: Sequence[Unknown],
    *,
    sketch: Callable[[Array], Array] | None = None,
    max_evaluations: int = 60,
    tolerance: float = 1e-7,
    careful: bool = False,
) -> Estimate:
    """Minimise the sum of squared residuals within the bounds, from the unknowns' start values.

    `residuals` maps values of shape (k,) to weighted residuals of shape (n,); it is called from threads. `sketch`, a
    quicker function that moves nearly as `residuals` do, is asked for the slopes on the way.

    Levenberg and Marquardt; slopes are differences once, and secants as long as steps bring what they promise. It ends
    only by slopes from differences. `max_evaluations` counts the steps that were taken by those.

    `careful`: the slopes from which uncertainties follow are taken on both sides, and their bend with them.
    """
    low = np.array([u.low for u in unknowns])
    high = np.array([u.high for u in unknowns])
    scale = np.array([u.scale for u in unknowns])
    values = np.clip([u.start for u in unknowns], low, high)
    r = residuals(values)
    if not len(unknowns):
        return Estimate((), values, r, True, lambda: _slopes_alone(np.zeros((len(r), 0))))

    def differences() -> Array:
        return jacobian(sketch or residuals, unknowns, values, sketch(values) if sketch else r)

    slopes, secants = differences(), 0
    damping, evaluations = _FIRST_DAMPING, 1
    while True:
        moved = np.clip(values + _damped_step(slopes, r, values, low, high, scale, damping), low, high)
        step = (moved - values) / scale
        still = bool(np.all(np.abs(step) <= ROUNDING))
        new = r if still else residuals(moved)
        evaluations += not secants
        foretold = r + slopes @ (moved - values)
        with np.errstate(over="ignore", invalid="ignore"):  # a step may lead to where the plant runs away
            gain, promise = float(r @ r - new @ new), float(r @ r - foretold @ foretold)
        fell = gain > 0.0  # also False when the new residuals are not finite
        converged = still or (fell and gain < tolerance * float(r @ r))
        if fell:
            values, r = moved, new
            damping = max(damping / 5.0, 1e-9)
        elif not secants:
            damping *= 4.0
        done = converged and not secants
        if done or evaluations >= max_evaluations:
            break
        if fell and not converged and gain >= _AS_PROMISED * promise and secants < len(unknowns):
            _correct(slopes, step, scale, new - foretold)
            secants += 1
        elif fell or secants:
            del slopes  # before the next: they are by far the largest that a fit holds
            slopes, secants = differences(), 0

    def slopes_there() -> tuple[Array, Curvature]:
        if careful:
            return _slopes_both_ways(residuals, values, low, high, scale, r)
        return _slopes_alone(jacobian(residuals, unknowns, values, r))

    return Estimate(tuple(unknowns), values, r, done, slopes_there)


def _correct(slopes: Array, step: Array, scale: Array, missed: Array) -> None:
    """Make slopes foretell a step, in scales, that missed by so much, in place (Broyden, Math. Comp. 19, 1965)."""
    for column, share in zip(slopes.T, step / scale / float(step @ step), strict=True):
        column += share * missed


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
    weights = np.maximum(np.diag(information), 1e-12 * max(float(np.trace(information)), LEAST))
    step = np.zeros_like(values)
    step[free] = -np.linalg.solve(information + damping * np.diag(weights), gradient[free])
    return step * scale


def jacobian(
    residuals: Callable[[Array], Array], unknowns: Sequence[Unknown | Parameter], values: Array, base: Array
) -> Array:
    """Forward differences in all unknowns at once (in threads), stepping away from a near bound; shape (n, k).

    Every column lies in one piece: products with long, narrow arrays are as quick as memory then.
    """
    made = np.empty((len(values), len(base)))

    def column(k: int) -> None:
        step = _RELATIVE_STEP * unknowns[k].scale
        if values[k] + step > unknowns[k].high:
            step = -step
        moved = values.copy()
        moved[k] += step
        np.subtract(residuals(moved), base, out=made[k])
        made[k] /= step

    parallel_map(column, range(len(values)))
    return made.T


def _slopes_alone(slopes: Array) -> tuple[Array, Curvature]:
    return slopes, Curvature(products(slopes))


def _slopes_both_ways(
    residuals: Callable[[Array], Array], values: Array, low: Array, high: Array, scale: Array, base: Array
) -> tuple[Array, Curvature]:
    """To second order, in all unknowns at once (in threads); near a bound from two steps away from it."""

    def at(k: int, step: float) -> Array:
        moved = values.copy()
        moved[k] += step
        return (residuals(moved) - base) / step

    slopes = np.empty((len(values), len(base)))
    bends = np.empty(slopes.shape, np.float32)  # only their size is asked for

    def column(k: int) -> None:
        step = _RELATIVE_STEP * scale[k]
        if low[k] <= values[k] - step and values[k] + step <= high[k]:
            above, below = at(k, step), at(k, -step)
            slopes[k], bends[k] = (above + below) / 2.0, (above - below) / 2.0
            return
        step = step if values[k] - step < low[k] else -step
        near, far = at(k, step), at(k, 2.0 * step)
        slopes[k], bends[k] = 2.0 * near - far, far - near

    def rise(move: Array) -> float:
        moved = values + move
        if np.any(moved < low) or np.any(moved > high):
            return math.inf
        new = residuals(moved)
        return float(new @ new - base @ base)

    parallel_map(column, range(len(values)))
    return slopes.T, Curvature(products(slopes.T), products(bends.T), rise)
