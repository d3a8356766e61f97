"""A smooth curve through noisy samples, as stiff as the samples themselves ask for.

Penalised B-splines (Eilers, Marx: Flexible smoothing with B-splines and penalties, Statist. Sci. 11, 1996). How much
roughness is paid for is chosen by evidence: the restricted likelihood of the samples, in which the curve's coefficients
and the noise's size have been integrated out (Wood: Generalized Additive Models, 2nd ed., 2017, ch. 6.2). Noise that is
not white is made so first: samples and basis pass the same filter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hil.arrays import LEAST, Array
from hil.signals.autoregression import whitened

_DEGREE = 3
_ROUGHNESS = 3  # order of the differences that are penalised: straight lines and parabolas cost nothing
_STIFFNESSES = 10.0 ** np.arange(-8.0, 12.01, 0.25)
_LEAST_HEARD = 1e-10  # of the best heard coefficient: less is given by its neighbours


@dataclass(frozen=True, slots=True)
class Curves:
    """Smooth curves.

    Attributes:
        coefficients: of each, shape (m, k).
        noise_std: of the whitened samples about each, shape (m,).
    """

    coefficients: Array
    noise_std: Array


@dataclass(frozen=True, slots=True)
class Smoother:
    """Everything about a smooth curve on given places but the samples; makes many curves at little cost.

    Attributes:
        basis: of the curve at the places, shape (n, k).
        whitener: what makes the noise white (see `hil.signals.autoregression`).
        weights: of the samples, one over the relative size of their noise, shape (n,); None where all are alike.
        knots: of the splines. `places`: of the samples, shape (n,).
    """

    basis: Array
    whitener: Array
    weights: Array | None
    knots: Array
    places: Array
    _heard: Array
    _turn: Array
    _cost: Array
    _twice: bool

    @classmethod
    def on(
        cls, places: Array, count: int, whitener: Array | None = None, weights: Array | None = None,
        twice: bool = False,
    ) -> Smoother:  # fmt: skip
        """For places, shape (n,), with `count` coefficients evenly spread over them; a whitener asks for rising ones.

        A whitener takes what was before the first sample for 0. `twice` smooths what the first curve leaves once more
        and adds it: corners stay sharper, noise counts more.
        """
        from scipy.linalg import cholesky, eigh, solve_triangular

        knots = _knots(float(np.min(places)), float(np.max(places)), count)
        basis = _basis(places, knots)
        filter_ = np.ones(1) if whitener is None else whitener
        heard = whitened((basis if weights is None else basis * weights[:, None]).T, filter_).T
        normal = heard.T @ heard
        rough = np.diff(np.eye(count), _ROUGHNESS, axis=0)
        penalty = rough.T @ rough
        scale = float(np.trace(normal)) / count
        # a coefficient that no sample hears is held by its neighbours alone
        root = cholesky(normal / scale + _LEAST_HEARD * (penalty + np.eye(count)), lower=True)
        half = solve_triangular(root, penalty, lower=True)
        cost, vectors = eigh(solve_triangular(root, half.T, lower=True))
        turn = solve_triangular(root.T, vectors) / scale**0.5
        return cls(basis, filter_, weights, knots, places, heard, turn, np.maximum(cost, 0.0), twice)

    def curves(self, samples: Array) -> Curves:
        """One curve for each row of samples, shape (m, n), each as stiff as it asks for."""
        (made,) = self.curves_each(samples, (1.0,))
        return made

    def curves_each(self, samples: Array, looser: tuple[float, ...]) -> tuple[Curves, ...]:
        """For each of `looser` one curve for each row of samples, so many times less stiff than the row asks for."""
        rows = np.atleast_2d(samples)
        white = whitened(rows if self.weights is None else rows * self.weights, self.whitener)
        loads = (white @ self._heard) @ self._turn
        power = np.einsum("mn,mn->m", white, white)
        bent = len(self._cost) - _ROUGHNESS
        dof = white.shape[1] - _ROUGHNESS
        paid = _STIFFNESSES[:, None] * self._cost
        left = np.maximum(power[:, None] - loads**2 @ (1.0 / (1.0 + paid)).T, 1e-12 * power[:, None] + LEAST)
        price = np.sum(np.log1p(paid), axis=1) - bent * np.log(_STIFFNESSES)
        chosen = paid[np.argmin(dof * np.log(left) + price, axis=1)]
        return tuple(self._kept(loads, power, white.shape[1], chosen / one) for one in looser)

    def _kept(self, loads: Array, power: Array, count: int, paid: Array) -> Curves:
        kept = 1.0 / (1.0 + paid)
        if self._twice:
            kept = kept * (2.0 - kept)
        rest = power - np.sum(loads**2 * (2.0 * kept - kept**2), axis=1)
        noise_std = np.sqrt(np.maximum(rest, 0.0) / (count - np.sum(kept, axis=1)))
        return Curves((loads * kept) @ self._turn.T, noise_std)

    def at(self, curves: Curves) -> Array:
        """The curves at the places, shape (m, n)."""
        return curves.coefficients @ self.basis.T

    def slopes(self, curves: Curves) -> Array:
        """Slopes of the curves at the places, shape (m, n)."""
        return self.beside(curves, self.places)[1]

    def beside(self, curves: Curves, places: Array) -> tuple[Array, Array]:
        """(the curves, their slopes) at other places, each of shape (m, places); beyond the samples they go on."""
        values = curves.coefficients @ _basis(places, self.knots).T
        steps = np.diff(curves.coefficients, axis=1) / (self.knots[1] - self.knots[0])
        slopes = steps @ _basis(places, self.knots[1:-1], _DEGREE - 1).T
        return values, slopes


def _knots(low: float, high: float, count: int) -> Array:
    """Even knots for cubic splines with so many coefficients from low to high."""
    step = (high - low) / (count - _DEGREE)
    return low + step * np.arange(-_DEGREE, count + 1, dtype=np.float64)


def _basis(places: Array, knots: Array, degree: int = _DEGREE) -> Array:
    """B-splines at places, shape (n, k)."""
    from scipy.interpolate import BSpline

    found = BSpline.design_matrix(places, knots, degree, extrapolate=True).toarray()
    return np.asarray(found, dtype=np.float64)
