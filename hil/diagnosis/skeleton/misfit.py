"""The skeleton misfit: what a nominal model of a wrong structure leaves, in the span of what the library can change."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtri

from hil.diagnosis.skeleton.rows import Rows
from hil.diagnosis.thresholds import NEXT_TO_NOTHING
from hil.record.recording import Array, Integers, Mask

# Ridge over columns whose rms is one on the recordings of before, and those that are tried: none so large that what was
# left before is forgotten.
RIDGE = 55.0
_RIDGES = RIDGE * np.logspace(-1, 2, 7)
# Cosines that describe how the left-out variance depends on the state, their width in standard deviations of
# it, and the ridge over them.
_WAVES, _WIDTH, _SMOOTH = 200, 2.5, 30.0
# Bounds of a log variance, and how many variances of one row count.
_LOG_VARIANCE, _OUTLIER = (-12.0, 14.0), 20.0
# A column whose rms on the recordings of before is less does nothing there.
_NOTHING = 1e-6
# What a column does later counts up to so many times its rms of before.
_FARTHEST = 30.0


@dataclass(frozen=True)
class Misfit:
    """A linear model of the misfit of one channel before: a wrong structure need not mislead all of them alike.

    Attributes:
        channel: its place.
        rms: of every column on the recordings of before; 0 of those that do nothing there. Shape (columns,).
        coefficients: of the columns over their rms, shape (columns,).
        directions: in which columns the recordings of before tell something, shape (k, columns), scaled so that the
            leverage of a row d is (d·d)/λ − Σ (direction·d)².
        ridge: λ, with which each of these recordings was predicted best by the others.
    """

    channel: int
    rms: Array
    coefficients: Array
    directions: Array
    ridge: float

    def leaves(self, rows: Rows, columns: Array | None = None) -> tuple[Array, Array]:
        """What is left of the misfit, 0 where invalid, and the leverage of each row; shape (n,) each.

        `columns`: as `scaled` gives them, where they are at hand.
        """
        d = scaled(rows, self.rms) if columns is None else columns
        left = np.where(rows.valid, rows.misfit - d @ self.coefficients, 0.0)
        seen = d @ self.directions.T
        leverage = np.einsum("ji,ji->i", d.T, d.T) / self.ridge - np.einsum("ij,ij->i", seen, seen)
        return left, np.maximum(leverage, 0.0)


def leaves(misfits: Iterable[Misfit], rows: Rows) -> tuple[Array, Array]:
    """What the misfits of all channels leave, as in `Misfit.leaves`; nothing of a channel that has none."""
    left, leverage = np.zeros(len(rows.misfit)), np.zeros(len(rows.misfit))
    for of in misfits:
        own = rows.channel == of.channel
        left[own], leverage[own] = of.leaves(rows.some(own))
    return left, leverage


def learned(rows: Rows, fold: Integers, ridge: float | None = None) -> tuple[Misfit, Array, Array]:
    """The misfit of one channel; what is left of each fold by a fit of the others, and their leverage.

    Args:
        rows: of that channel.
        fold: of each row, −1 for those that are in none.
        ridge: λ, where it was chosen before; else that with which a fit of the others leaves least of all folds.
    """
    known = rows.valid & (fold >= 0)
    rms = rms_of(rows, known)
    d = scaled(rows, rms)
    channel, left, leverage = int(rows.channel[0]), np.zeros(len(fold)), np.zeros(len(fold))
    products = {k: _products(d, rows.misfit, known & (fold == k)) for k in np.unique(fold[known])}
    whole = sum(products.values(), np.zeros((d.shape[1], d.shape[1] + 1)))
    without = {k: _Spectrum.of(whole - own) for k, own in products.items()}
    if ridge is None:
        squares = np.zeros(len(_RIDGES))
        for k, others in without.items():
            own = known & (fold == k)
            squares += np.sum((rows.misfit[own, None] - d[own] @ others.coefficients(_RIDGES)) ** 2, axis=0)
        ridge = float(_RIDGES[np.argmin(squares)])
    for k, others in without.items():
        there = fold == k
        left[there], leverage[there] = others.misfit(channel, rms, ridge).leaves(rows.some(there), d[there])
    return _Spectrum.of(whole).misfit(channel, rms, ridge), left, leverage


def _products(d: Array, misfit: Array, use: Mask) -> Array:
    """Inner products of the scaled columns, and in the last column those with the misfit."""
    own = d[use]
    return own.T @ np.column_stack([own, misfit[use]])


@dataclass(frozen=True)
class _Spectrum:
    """Eigenvalues and vectors of the products of columns, and along these the products with the misfit."""

    sizes: Array
    vectors: Array
    along: Array

    @classmethod
    def of(cls, products: Array) -> _Spectrum:
        """Of rows that have these products."""
        sizes, vectors = np.linalg.eigh(products[:, :-1])
        return cls(np.maximum(sizes, 0.0), vectors, vectors.T @ products[:, -1])

    def coefficients(self, ridges: Array) -> Array:
        """By ridge regression, shape (columns, ridges)."""
        return np.asarray(self.vectors @ (self.along[:, None] / (self.sizes[:, None] + ridges)), dtype=np.float64)

    def misfit(self, channel: int, rms: Array, ridge: float) -> Misfit:
        """With one ridge."""
        gains = 1.0 / ridge - 1.0 / (self.sizes + ridge)
        telling = self.sizes > NEXT_TO_NOTHING * ridge
        directions = (self.vectors[:, telling] * np.sqrt(gains[telling])).T
        return Misfit(channel, rms, self.coefficients(np.array([ridge]))[:, 0], directions, ridge)


def scaled(rows: Rows, rms: Array) -> Array:
    """Columns over their rms of before, shape (n, columns); 0 where they did nothing."""
    d = rows.changes / np.where(rms > 0.0, rms, np.inf)[:, None]
    return np.clip(d, -_FARTHEST, _FARTHEST, out=d).T


def rms_of(rows: Rows, known: Mask) -> Array:
    """The rms of every column over some rows; 0 of those that do nothing there."""
    found = np.sqrt(np.mean(np.square(rows.changes[:, known], dtype=np.float64), axis=1))
    return np.where(found > _NOTHING, found, 0.0)


@dataclass(frozen=True)
class Remainder:
    """How large what is left on a recording that was not fitted is: log-linear in its leverage and the state.

    Attributes:
        mean, std: of the state on the recordings of before. `coefficients`: of log variance.
        factor: of that variance. `white`: the variance that white noise alone has in a row; none is smaller.
        whole: of both.
    """

    mean: Array
    std: Array
    coefficients: Array
    white: float
    factor: float = 1.0
    whole: float = 1.0

    def std_of(self, rows: Rows, leverage: Array) -> Array:
        """The standard deviation of what is left in each row, shape (n,)."""
        log = _remainder_columns((rows.state - self.mean) / self.std, leverage) @ self.coefficients
        variance = np.maximum(self.factor * np.exp(np.clip(log, *_LOG_VARIANCE)), self.white)
        return np.sqrt(self.whole * variance)


def log_power(left: Array, samples: int) -> Array:
    """Logarithm of squares of rows, those of nothing but luck no less than white noise makes usual; shape (n,)."""
    return np.log(left**2 + 0.5 / samples)


def remainder(rows: Rows, left: Array, leverage: Array, known: Mask) -> Remainder:
    """Fit the scale of what is left of recordings that were not fitted."""
    white = 1.0 / rows.samples
    mean, std = rows.state[known].mean(axis=0), rows.state[known].std(axis=0) + 1e-12
    columns = _remainder_columns((rows.state - mean) / std, leverage)[known]
    penalty = _SMOOTH * np.eye(columns.shape[1])
    penalty[-2:, -2:] *= 1e-3
    power = left[known] ** 2
    coefficients = np.linalg.solve(columns.T @ columns + penalty, columns.T @ log_power(left[known], rows.samples))
    made = Remainder(mean, np.asarray(std, dtype=np.float64), np.asarray(coefficients, dtype=np.float64), white)
    over = power / made.std_of(rows, leverage)[known] ** 2
    made = replace(made, factor=float(np.mean(np.minimum(over, _OUTLIER))))
    over = power / made.std_of(rows, leverage)[known] ** 2
    return replace(made, whole=float(np.mean(over)))


def _remainder_columns(state: Array, leverage: Array) -> Array:
    x = np.clip(state, -6.0, 6.0)
    x[:, 1:] = np.sign(x[:, 1:]) * np.sqrt(np.abs(x[:, 1:]))  # rates: finer about zero
    points = scattered(_WAVES, x.shape[1] + 1)
    directions, phases = ndtri(points[:, 1:]).T / _WIDTH, 2.0 * np.pi * points[:, 0]
    wave = np.cos(x @ directions + phases)
    far, one = np.log(leverage + 1e-4), np.ones(len(x))
    return np.column_stack([wave * np.sqrt(2.0 / _WAVES), 0.1 * x, one, far, one])


def scattered(count: int, dimensions: int) -> Array:
    """Points scattered over a unit cube, shape (count, dimensions), by the minimal standard generator.

    They are the same in every version of every library: a model file keeps what was fitted to them (Park, Miller 1988).
    """
    found, last = np.empty(count * dimensions), 1
    for k in range(len(found)):
        last = 48_271 * last % 2_147_483_647
        found[k] = last / 2_147_483_647
    return found.reshape(count, dimensions)
