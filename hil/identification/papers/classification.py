"""Classes of ordered condition from a few measured numbers: with probability, honestly counted.

A Gaussian model of each class with its own covariance (quadratic discriminant analysis), so that the scatter of worn
units does not excuse a unit that lies far from the good ones. It gives the probability of each class among them, and
how usual the unit would be in each: probabilities alone are relative, and call a unit that is like no class by the
nearest one. Beside it, thresholds on one number, as the EFC thesis classifies. Both are evaluated by leaving out the
unit that is judged.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc, softmax

from hil.errors import InputError
from hil.record.recording import Array, Integers, Mask

_UNLIKE = 1e-3  # share of the units of a class that lie farther from its mean than one that is unlike it


@dataclass(frozen=True, slots=True)
class GaussianClasses:
    """What was learnt of k classes from their f features.

    Attributes:
        names: of the classes, in order.
        means: shape (k, f). `covariances`: of each class, shape (k, f, f).
        counts: units that each class was learnt from, shape (k,).
    """

    names: tuple[str, ...]
    means: Array
    covariances: Array
    counts: Integers

    def distances(self, features: Array) -> Array:
        """Squared Mahalanobis distances of features, shape (n, f), to each class, shape (n, k)."""
        away = np.atleast_2d(features)[:, None, :] - self.means
        return np.einsum("nkf,kfg,nkg->nk", away, np.linalg.inv(self.covariances), away)

    def probabilities(self, features: Array) -> Array:
        """Probability of each class if the unit is of one of them, all as likely before, shape (n, k)."""
        size = np.linalg.slogdet(self.covariances)[1]
        return softmax(-0.5 * (self.distances(features) + size), axis=1)

    def usual(self, features: Array) -> Array:
        """Share of each class's units that lie farther from its middle than these features, shape (n, k).

        By Hotelling's T² of a new unit: means and covariances are known from `counts` units only.
        """
        n, features_known = self.counts, self.means.shape[1]
        scale = n * (n - features_known) / ((n**2 - 1.0) * features_known)
        return fdtrc(features_known, n - features_known, scale * self.distances(features))

    def is_unlike(self, features: Array) -> Mask:
        """Whether features lie farther from every class than all but one in a thousand of its units."""
        return np.asarray(self.usual(features).max(axis=1) < _UNLIKE, dtype=np.bool_)


def learn(features: Array, labels: Integers, names: Sequence[str]) -> GaussianClasses:
    """Mean and covariance of each class.

    Args:
        features: shape (n, f).
        labels: place in `names` of each row's class, shape (n,).
        names: of the classes, in order.

    Raises:
        InputError: a class with no more rows than features and one, or one in which a feature follows from others.
    """
    count = np.bincount(labels, minlength=len(names))
    if count.min() <= features.shape[1] + 1:
        few = ", ".join(f"{name} {n}" for name, n in zip(names, count, strict=True))
        raise InputError(f"classes: {few} units with {features.shape[1]} features; each class needs more")
    rows = [features[labels == k] for k in range(len(names))]
    for name, row in zip(names, rows, strict=True):
        spread = row.std(axis=0)
        if not spread.all() or np.linalg.matrix_rank((row - row.mean(axis=0)) / spread) < row.shape[1]:
            raise InputError(
                f"classes: of the {name} units a feature stays as it is, or follows exactly from others; leave it out"
            )
    return GaussianClasses(
        tuple(names),
        np.array([row.mean(axis=0) for row in rows]),
        np.array([np.atleast_2d(np.cov(row, rowvar=False)) for row in rows]),
        count,
    )


def leave_one_out(features: Array, labels: Integers, names: Sequence[str]) -> Array:
    """Probabilities of each row's classes, learnt from all other rows; shape (n, k)."""
    keep = ~np.eye(len(features), dtype=bool)
    return np.concatenate(
        [learn(features[k], labels[k], names).probabilities(row) for k, row in zip(keep, features, strict=True)]
    )


def ordered_thresholds(values: Array, labels: Integers, classes: int) -> Array:
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


def by_thresholds(values: Array, thresholds: Array) -> Integers:
    """Class of each value: how many thresholds it reaches."""
    return np.searchsorted(thresholds, values, side="right").astype(np.int64)


def _between(low: float, high: float) -> float:
    if math.isinf(low) or math.isinf(high):
        return high if math.isinf(low) else math.inf
    return (low + high) / 2.0
