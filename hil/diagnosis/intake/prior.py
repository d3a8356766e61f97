"""What is known of the base parameters before the recordings: how far they may be from where the model has them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hil.diagnosis.thresholds import SELDOM_BY_CHANCE
from hil.physics.model import Model
from hil.physics.plant import Parameter, Parameters
from hil.record.recording import Array, Mask

# A unit that was identified once drifts a little without anything being wrong with it: this share of each
# parameter's size, or what its plant says, beside its standard uncertainty, is not news.
_DRIFT_SHARE = 0.005
# A parameter has a part in a direction that leads along it by more than this share of what it does along any.
_HAS_A_PART = 0.03
# A number in a file that is less than this share of another one was not rounded from it.
_LESS = 0.999


@dataclass(frozen=True)
class Prior:
    """How far the base parameters of a model may wander without being called changed.

    Attributes:
        model: the nominal model, with what was known of its parameters when it was identified.
        base: the parameters, those that its plant lets free; k of them.
        is_own: whether the recordings in question are those that the model was identified from: what these tell of its
            parameters is not known beside them, and would count twice.
    """

    model: Model
    base: tuple[Parameter, ...]
    is_own: bool = False

    @cached_property
    def covariance(self) -> Array:
        """Shape (k, k)."""
        usual = [_DRIFT_SHARE * max(abs(self.model.values[p.name]), p.scale) for p in self.base]
        drift = [share if p.drift is None else p.drift for p, share in zip(self.base, usual, strict=True)]
        return self._known + np.diag(np.square(drift))

    @cached_property
    def std(self) -> Array:
        """How far each may wander by itself, shape (k,)."""
        return np.sqrt(np.diag(self.covariance))

    @cached_property
    def _known(self) -> Array:
        """How well they were known before the recordings in question, shape (k, k)."""
        known = self.model.covariance
        if self.is_own:
            return np.diag(np.square([self._typed(p) or p.high - p.low for p in self.base]))
        if known is None:
            stds = [self.model.parameters[name].std or 0.0 for name in self._names]
            return np.diag(np.square(np.nan_to_num(stds, posinf=0.0)))
        at = [k for k, name in enumerate(self._names) if name in known.names]
        places = [known.names.index(self._names[k]) for k in at]
        covariance = np.zeros((len(self.base), len(self.base)))
        covariance[np.ix_(at, at)] = np.array(known.matrix)[np.ix_(places, places)]
        for k, name in enumerate(self._names):
            if self._is_typed(name, math.sqrt(covariance[k, k])):
                covariance[k, :] = covariance[:, k] = 0.0
                covariance[k, k] = (self.model.parameters[name].std or 0.0) ** 2
        return covariance

    def _typed(self, p: Parameter) -> float | None:
        """The standard uncertainty that somebody typed into the model file."""
        std = self.model.parameters[p.name].std
        return std if self._is_typed(p.name, 0.0) else None

    def _is_typed(self, name: str, known: float) -> bool:
        """Whether somebody typed a standard uncertainty into the model file: identification stated another one.

        Where the file does not keep what it stated, one that is less than the covariance's: it never states less.
        """
        std, stated = self.model.parameters[name].std, self.model.origin.get("std")
        if std is None or not math.isfinite(std):
            return False
        if not isinstance(stated, Mapping):
            return std < _LESS * known
        return not math.isclose(std, stated.get(name) or 0.0, rel_tol=1.0 - _LESS)

    @cached_property
    def _names(self) -> list[str]:
        return [p.name for p in self.base]

    @cached_property
    def _sizes(self) -> Array:
        return np.array([p.scale for p in self.base])

    @cached_property
    def _unidentifiable(self) -> Array:
        """Directions in which the recordings that the model was identified from do not tell the parameters to within
        their own size, as far as they may wander there; shape (m, k).
        """
        variances, directions = np.linalg.eigh(self._known / np.outer(self._sizes, self._sizes))
        far = variances > 1.0
        return np.sqrt(variances[far])[:, None] * directions[:, far].T * self._sizes

    @cached_property
    def _has_part(self) -> Mask:
        """Which parameters have a part in each direction that is not identifiable, shape (m, k)."""
        parts = np.abs(self._unidentifiable) / self._sizes
        return np.asarray(parts > _HAS_A_PART * parts.max(axis=1, keepdims=True, initial=0.0))

    def confounded_with(self, name: str) -> list[str]:
        """The parameters that were confounded with this one."""
        shared = np.any(self._has_part[self._has_part[:, self._names.index(name)]], axis=0)
        return [other for other, is_shared in zip(self._names, shared, strict=True) if is_shared and other != name]

    def was(self, name: str, parameters: Parameters) -> float:
        """What a parameter was in the unit that the model was identified from, if those that were confounded
        with it were what they are now.
        """
        own, others = self._names.index(name), [self._names.index(other) for other in self.confounded_with(name)]
        moves = self.covariance[own, others] @ np.linalg.solve(
            self.covariance[np.ix_(others, others)], self._away(parameters)[others]
        )
        return float(self.model.values[name] + moves)

    def of(self, free: Sequence[int]) -> Array:
        """The covariance of some parameters, by their places, the others given; shape (free, free).

        Of confounded parameters, one that is given fixes the others: they stand where they were put
        when the model was identified, as only what all of them are together can be seen to change.
        """
        is_given = np.ones(len(self.base), dtype=bool)
        is_given[list(free)] = False
        given = self._unidentifiable[np.any(self._has_part & is_given, axis=1)]
        return (self.covariance - given.T @ given)[np.ix_(free, free)]

    def root(self, free: Sequence[int]) -> Array:
        """R with Rᵀ·R the precision of these parameters, the others given; shape (free, free)."""
        return np.linalg.inv(np.linalg.cholesky(self.of(free)))

    def moved(self, parameters: Parameters) -> list[str]:
        """The parameters that are further from their nominal values than they may wander.

        Of confounded ones all that have moved, if they have done so together.
        """
        away = self._away(parameters)
        far = np.abs(away) > SELDOM_BY_CHANCE * self.std
        rest = np.flatnonzero(~far)
        together = away[rest] @ np.linalg.solve(self.of(rest.tolist()), away[rest])
        if len(self._unidentifiable) and together > len(rest) * SELDOM_BY_CHANCE**2:
            stds = np.sqrt(np.diag(self.covariance - self._unidentifiable.T @ self._unidentifiable))
            far |= np.any(self._has_part, axis=0) & (np.abs(away) > SELDOM_BY_CHANCE * stds)
        return [name for name, moved in zip(self._names, far, strict=True) if moved]

    def _away(self, parameters: Parameters) -> Array:
        return np.array([parameters[name] - self.model.values[name] for name in self._names])
