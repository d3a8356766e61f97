"""Classes of ordered condition from a few measured numbers: with probability, honestly counted.

A Gaussian class model with one covariance for all classes (linear discriminant analysis): few numbers to learn,
probabilities that mean something, and a distance that tells a unit unlike any class. Beside it, thresholds on one
number, as the EFC thesis classifies. Both are evaluated by leaving out the unit that is judged.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil.errors import InputError
from hil.record.recording import Array

Labels = NDArray[np.int64]

_UNLIKE = 1e-3  # share of units of a class that lie farther from its mean than an outlier


@dataclass(frozen=True, slots=True)
class GaussianClasses:
    """What was learnt of k classes from their f features.

    Attributes:
        names: of the classes, in order.
        means: shape (k, f). `covariance`: of every class, shape (f, f).
        priors: share of each class that is expected, shape (k,).
    """

    names: tuple[str, ...]
    means: Array
    covariance: Array
    priors: Array

    def distances(self, features: Array, measured: Array | None = None) -> Array:
        """Squared Mahalanobis distances of features, shape (n, f), to each class, shape (n, k).

        `measured`: covariance of the features by measurement, shape (f, f), beyond that of those learnt from.
        """
        covariance = self.covariance if measured is None else self.covariance + measured
        away = np.atleast_2d(features)[:, None, :] - self.means
        made: Array = np.einsum("nkf,fg,nkg->nk", away, np.linalg.inv(covariance), away)
        return made

    def probabilities(self, features: Array, measured: Array | None = None) -> Array:
        """Probability of each class, shape (n, k)."""
        score = np.log(self.priors) - 0.5 * self.distances(features, measured)
        score -= score.max(axis=1, keepdims=True)
        share = np.exp(score)
        made: Array = share / share.sum(axis=1, keepdims=True)
        return made

    def is_unlike(self, features: Array, measured: Array | None = None) -> NDArray[np.bool_]:
        """Whether features lie farther from every class than all but one in a thousand of its units."""
        from scipy.stats import chi2

        nearest = self.distances(features, measured).min(axis=1)
        return np.asarray(nearest > chi2.ppf(1.0 - _UNLIKE, self.means.shape[1]), dtype=np.bool_)


@dataclass(frozen=True, slots=True)
class Accuracy:
    """Share of right verdicts with its 95 % interval after Wilson."""

    right: int
    of: int
    low: float
    high: float

    @property
    def share(self) -> float:
        """Right over all."""
        return self.right / self.of

    def __str__(self) -> str:
        return f"{self.right} of {self.of}, {100 * self.share:.1f} % ({100 * self.low:.1f} … {100 * self.high:.1f} %)"


def accuracy(found: Labels, truth: Labels) -> Accuracy:
    """Of verdicts."""
    right = int(np.count_nonzero(found == truth))
    return Accuracy(right, len(truth), *wilson(right, len(truth)))


def wilson(right: int, of: int, z: float = 1.959964) -> tuple[float, float]:
    """Wilson's interval of a share; it does not leave 0…1 and is right for shares near them."""
    if not 0 <= right <= of or of == 0:
        raise InputError(f"share {right} of {of}: a count out of a larger one is needed")
    share, square = right / of, z * z
    middle = (share + square / (2 * of)) / (1 + square / of)
    half = z / (1 + square / of) * math.sqrt(share * (1 - share) / of + square / (4 * of * of))
    return max(0.0, middle - half), min(1.0, middle + half)


def learn(features: Array, labels: Labels, names: Sequence[str], priors: Array | None = None) -> GaussianClasses:
    """Means and common covariance of classes.

    Args:
        features: shape (n, f).
        labels: place in `names` of each row's class, shape (n,).
        names: of the classes, in order.
        priors: share of each class that is expected; alike when None, whatever the rows' shares are.

    Raises:
        InputError: a class with fewer than two rows, or fewer rows than classes and features.
    """
    count = np.bincount(labels, minlength=len(names))
    if count.min() < 2 or len(features) <= len(names) + features.shape[1]:
        few = ", ".join(f"{name} {n}" for name, n in zip(names, count, strict=True))
        raise InputError(f"classes: {few} units with {features.shape[1]} features; each class needs more")
    means = np.array([features[labels == k].mean(axis=0) for k in range(len(names))])
    left = features - means[labels]
    covariance = left.T @ left / (len(features) - len(names))
    return GaussianClasses(
        tuple(names), means, covariance, np.full(len(names), 1.0 / len(names)) if priors is None else priors
    )


def leave_one_out(features: Array, labels: Labels, names: Sequence[str]) -> Array:
    """Probabilities of each row's classes, learnt from all other rows; shape (n, k)."""
    keep = ~np.eye(len(features), dtype=bool)
    return np.concatenate(
        [learn(features[k], labels[k], names).probabilities(row) for k, row in zip(keep, features, strict=True)]
    )


def ordered_thresholds(values: Array, labels: Labels, classes: int) -> Array:
    """The thresholds on one number that get most rows right, classes rising with it; shape (classes − 1,).

    Each lies in the middle between two neighbours.
    """
    order = np.argsort(values, kind="stable")
    sorted_values, sorted_labels = values[order], labels[order]
    below = np.array([np.concatenate(([0], np.cumsum(sorted_labels == k))) for k in range(classes)])
    best = below[0].astype(np.float64)
    choices = []
    for k in range(1, classes):
        # rows up to a belong to the classes before k, the rest to k: best[a] counts the former
        gain = best - below[k]
        at = np.maximum.accumulate(gain)
        where = np.zeros(len(gain), dtype=np.int64)
        for i in range(1, len(gain)):
            where[i] = i if gain[i] > gain[where[i - 1]] else where[i - 1]
        choices.append(where)
        best = at + below[k]
    cuts, end = [], len(values)
    for where in reversed(choices):
        end = int(where[end])
        cuts.append(end)
    padded = np.concatenate(([-np.inf], sorted_values, [np.inf]))
    return np.array([_between(padded[cut], padded[cut + 1]) for cut in reversed(cuts)])


def by_thresholds(values: Array, thresholds: Array) -> Labels:
    """Class of each value: how many thresholds it reaches."""
    made: Labels = np.searchsorted(thresholds, values, side="right").astype(np.int64)
    return made


def leave_one_out_thresholds(values: Array, labels: Labels, classes: int) -> Labels:
    """Class of each row by the thresholds that all other rows ask for."""
    keep = ~np.eye(len(values), dtype=bool)
    return np.array([
        by_thresholds(np.array([value]), ordered_thresholds(values[k], labels[k], classes))[0]
        for k, value in zip(keep, values, strict=True)
    ])  # fmt: skip


def _between(low: float, high: float) -> float:
    if math.isinf(low) or math.isinf(high):
        return high if math.isinf(low) else math.inf
    return (low + high) / 2.0
