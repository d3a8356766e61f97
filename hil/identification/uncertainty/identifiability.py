"""What samples tell of several values together: which they tell, which only together, and how well."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil.arrays import ROUNDING
from hil.record.recording import Array, Mask
from hil.signals.interval import UNIFORM

# Slopes from differences over a thousandth of a value's scale are good to this share of themselves: the square of that
# step over the sixth part of the square of a scale that is a tenth as long, and what simulations round.
_SLOPES_GOOD_TO = 1e-4
_SHARE_OF_OWN = 0.5  # of a value's own uncertainty: less from another that is not identifiable is no confounding
# Where so little of a slope is left, a move is tried; it belies the slopes when it costs less than this share.
_DOUBTFUL, _FAR_LESS = 0.03, 0.25


@dataclass(frozen=True, slots=True)
class Curvature:
    """How a sum of squares depends on the values near a fit.

    Attributes:
        alike: products of the residuals' slopes, shape (k, k).
        bent: products of what the slopes bend over a step, shape (k, k); None if unknown.
        rise: by how much the sum of squares rises when the values move so far, in the directions (k,) that are tried;
            None if nobody can say.
    """

    alike: Array
    bent: Array | None = None
    rise: Callable[[Array], float] | None = None


@dataclass(frozen=True, slots=True)
class Identifiability:
    """What data tell of k values together.

    Attributes:
        covariance: with values held that are known no better than by their bounds once the others may be anything,
            shape (k, k).
        unidentifiable: directions in which the values give way to each other and the samples tell nothing, as far as
            one standard deviation of what lies anywhere within the bounds, shape (m, k).
        widths: from bound to bound, shape (k,).
        variance: of the residuals, with their colour.
    """

    covariance: Array
    unidentifiable: Array
    widths: Array
    variance: float

    @property
    def whole(self) -> Array:
        """The covariance with what the bounds alone say in the directions that are not identifiable, shape (k, k)."""
        return self.covariance + self.unidentifiable.T @ self.unidentifiable

    @property
    def inverse(self) -> Array:
        """The inverse information of residuals of unit variance, shape (k, k)."""
        return self.covariance / self.variance if self.variance else np.zeros_like(self.covariance)

    @property
    def is_unidentifiable(self) -> Mask:
        """Which values are known no better than by their bounds, shape (k,)."""
        return np.asarray(np.sqrt(np.diag(self.whole)) >= (1.0 - ROUNDING) * UNIFORM * self.widths)

    @property
    def is_shared_beyond_noise(self) -> Mask:
        """Which values others that are not identifiable leave less certain than noise does, shape (k,)."""
        own = np.sqrt(np.diag(self.covariance))
        return np.asarray(np.any(np.abs(self.unidentifiable) > _SHARE_OF_OWN * own, axis=0))


def identifiability(
    curvature: Curvature, variance: float, widths: Array, fixed_at_bound: Sequence[int] = ()
) -> Identifiability:
    """What residuals of a variance tell of values with these widths.

    A value is not identifiable when the others give way to it: what is left of its slope then is no more than what
    slopes from differences leave along a bent valley, or makes the value no more certain than its bounds do. Where
    little is left, a move of two standard deviations that way is tried; it may cost far less than the slopes promise.
    Values that are `fixed_at_bound` are not identifiable, whatever their slopes say.
    """
    sizes = np.sqrt(np.diag(curvature.alike))
    unit, rise = np.where(sizes > 0.0, sizes, 1.0), curvature.rise
    units = np.outer(unit, unit)
    valley = _Valley(
        curvature.alike / units, None if curvature.bent is None else curvature.bent / units,
        math.sqrt(variance), widths * unit, None if rise is None else (lambda move: rise(move / unit)),
    )  # fmt: skip
    kept, unidentifiable = list(range(len(unit))), []
    while (k := valley.least_identifiable(kept)) is not None:
        direction = valley.along(k, kept)
        kept.remove(k)
        unidentifiable.append(direction * valley.reach(direction))
    for place in (place for place in fixed_at_bound if place in kept):
        direction = valley.compensated_step(place, kept)
        kept.remove(place)
        unidentifiable.append(direction * 2.0 * UNIFORM * valley.widths[place])
    covariance = np.zeros((len(unit), len(unit)))
    covariance[np.ix_(kept, kept)] = variance * np.linalg.inv(valley.alike[np.ix_(kept, kept)])
    directions = np.array(unidentifiable).reshape(-1, len(unit)) / unit
    return Identifiability(covariance / units, directions, widths, variance)


def products(columns: NDArray[np.floating]) -> Array:
    """Of every two of them, shape (k, k) from (n, k)."""
    return np.asarray(columns.T @ columns, np.float64)


@dataclass(frozen=True, slots=True)
class _Valley:
    """Products of slopes of unit length, and of their bends; the noise; widths in what slopes of unit length leave."""

    alike: Array
    bent: Array | None
    std: float
    widths: Array
    rise: Callable[[Array], float] | None

    def least_identifiable(self, kept: Sequence[int]) -> int | None:
        """Of those that are not identifiable, the one of whose slope least is left; None where all are.

        Less than slopes are good to is nothing: rounding, which each processor does otherwise, decides no order. There
        the value goes first whose bounds let the residuals change least; those that are left give way the farthest.
        """
        directions = {k: self.compensated_step(k, kept) for k in kept}
        left = {k: self._left(direction) for k, direction in directions.items()}
        doubtful = [k for k in kept if left[k] < _DOUBTFUL]
        blind = [k for k in kept if self._is_blind(k, directions[k])]
        blind = blind or [k for k in doubtful if self._costs_less(k, left[k], doubtful)]
        return min(blind, key=lambda k: (max(left[k], _SLOPES_GOOD_TO), self.widths[k]), default=None)

    def along(self, k: int, kept: Sequence[int]) -> Array:
        """The way in which the others give way to a value that is not identifiable, with as few of them as will do."""
        others = [j for j in kept if j != k]
        direction = self.compensated_step(k, others)
        blind = self._is_blind(k, direction)
        for j in sorted(others, key=lambda j: (round(abs(float(direction[j])) / _SLOPES_GOOD_TO), self.widths[j])):
            fewer = self.compensated_step(k, [i for i in others if i != j])
            if self._is_blind(k, fewer) if blind else self._left(fewer) < _DOUBTFUL:
                others.remove(j)
                direction = fewer
        return direction

    def reach(self, direction: Array) -> float:
        """How far the bounds let it go, as a standard deviation."""
        parts = np.abs(direction)
        reach = float(np.min(self.widths[parts > 0.0] / parts[parts > 0.0]))
        return UNIFORM * reach if math.isfinite(reach) else 1e150

    def compensated_step(self, k: int, kept: Sequence[int]) -> Array:
        """A step of one value and those of the others that undo it best, shape (k,)."""
        others = [j for j in kept if j != k]
        direction = np.zeros(len(self.alike))
        direction[k] = 1.0
        if others:
            undo = np.linalg.lstsq(
                self.alike[np.ix_(others, others)], self.alike[others, k], rcond=_SLOPES_GOOD_TO**2 * 1e-4
            )[0]
            direction[others] = -undo
        return direction

    def _left(self, direction: Array) -> float:
        return math.sqrt(max(float(direction @ self.alike @ direction), 0.0))

    def _is_blind(self, k: int, direction: Array) -> bool:
        left = self._left(direction)
        bend = 0.0 if self.bent is None else math.sqrt(max(float(direction @ self.bent @ direction), 0.0))
        undone = max(1.0 - left**2, 0.0)
        return left <= max(undone * bend, _SLOPES_GOOD_TO) or self.std / left >= UNIFORM * float(self.widths[k])

    def _costs_less(self, k: int, left: float, others: Sequence[int]) -> bool:
        """Whether a move of two standard deviations, others giving way, costs far less than the slopes promise."""
        if self.rise is None or left == 0.0:
            return False
        move = 2.0 * self.std / left * self.compensated_step(k, others)
        return min(self.rise(move), self.rise(-move)) < _FAR_LESS * 4.0 * self.std**2
