"""The question: a nominal model, recordings on which it may fail, and noise that says when it does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hil.identify.estimate import jacobian, side_by_side
from hil.identify.experiment import Experiment
from hil.identify.first_reading import start_slope, with_free_start
from hil.identify.lines import line_at
from hil.identify.noise import channel_floors, white_floor, whiten
from hil.physics.model import Model, Noise
from hil.physics.plant import Parameter, Plant
from hil.physics.simulate import ActiveEffect, simulate, sub_steps
from hil.record.recording import Array

# A unit that was identified once drifts a little without anything being wrong with it: this share of each
# parameter's size, or what its plant says, beside its standard uncertainty, is not news.
_DRIFT_SHARE = 0.005
# A channel's own floor stands in for the model's noise when they differ by more than this factor.
_SAME_NOISE = 1.25
# A base parameter this many standard uncertainties (of its prior) from its nominal value may have changed.
_MOVED_SIGMAS = 3.0
# A parameter has a part in a direction that leads along it by more than this share of what it does along any.
_HAS_A_PART = 0.03
# A first look takes sub-steps this much coarser.
_COARSE = 0.5
# Sub-steps of all recordings together, at the plant's own.
_SHORT = 40_000
# A hum is known up to this multiple of what it was.
_SAME_HUM = 1.5


@dataclass(frozen=True)
class Problem:
    """A nominal model against experiments; all residuals are whitened to unit variance by the noise.

    Attributes:
        model: the nominal model.
        experiments: the recordings, bound to its plant.
        noises: of the output, per experiment; `observed_noise`: of each recorded inner signal.
        factor: how much finer than the plant's own the sub-steps are.
        following: whether the plant's observer leads every simulation back to its recording.
        beyond: by how much what laws leave is greater than noise (rms); a start is then known so much better than
            anything that they say.
        step: in which the output is read, where only when it passes from step to step is to count: errors are what
            rounding cannot have done, over the noise that the model was identified with. 0 otherwise.
    """

    model: Model
    experiments: tuple[Experiment, ...]
    noises: tuple[Noise, ...]
    observed_noise: tuple[Mapping[str, float], ...]
    factor: float = 1.0
    following: bool = False
    beyond: float = 1.0
    step: float = 0.0

    @property
    def plant(self) -> Plant:
        """The model's plant."""
        return self.model.definition

    @cached_property
    def base(self) -> tuple[Parameter, ...]:
        """Base parameters that the plant lets free."""
        return tuple(p for p in self.plant.parameters if not p.fixed)

    @cached_property
    def prior_covariance(self) -> Array:
        """How far the base parameters may wander together without being called changed, shape (k, k)."""
        usual = [_DRIFT_SHARE * max(abs(self.model.values[p.name]), p.scale) for p in self.base]
        drift = [share if p.drift is None else p.drift for p, share in zip(self.base, usual, strict=True)]
        covariance: Array = self._known + np.diag(np.square(drift))
        return covariance

    @cached_property
    def _known(self) -> Array:
        """How well the base parameters were known when the model was identified, shape (k, k)."""
        names, known = [p.name for p in self.base], self.model.covariance
        if known is None:
            stds = [self.model.parameters[name].std or 0.0 for name in names]
            return np.diag(np.square(np.nan_to_num(stds, posinf=0.0)))
        at = [k for k, name in enumerate(names) if name in known.names]
        told = [known.names.index(names[k]) for k in at]
        covariance = np.zeros((len(names), len(names)))
        covariance[np.ix_(at, at)] = np.array(known.matrix)[np.ix_(told, told)]
        return covariance

    @cached_property
    def _untold(self) -> Array:
        """Directions in which the recordings that the model was identified from do not tell the base parameters to
        within their own size, as far as they may wander there; shape (m, k).
        """
        size = np.array([p.scale for p in self.base])
        variances, directions = np.linalg.eigh(self._known / np.outer(size, size))
        far = variances > 1.0
        reaches: Array = np.sqrt(variances[far])[:, None] * directions[:, far].T * size
        return reaches

    @cached_property
    def _has_part(self) -> NDArray[np.bool_]:
        """Which base parameters have a part in each direction that is untold, shape (m, k)."""
        parts = np.abs(self._untold) / np.array([p.scale for p in self.base])
        return np.asarray(parts > _HAS_A_PART * parts.max(axis=1, keepdims=True, initial=0.0))

    def told_only_with(self, name: str) -> list[str]:
        """Other base parameters that have a part in an untold direction beside this one."""
        names = [p.name for p in self.base]
        shared = np.any(self._has_part[self._has_part[:, names.index(name)]], axis=0)
        return [other for other, is_shared in zip(names, shared, strict=True) if is_shared and other != name]

    def was(self, name: str, parameters: Mapping[str, float]) -> float:
        """What a base parameter was in the unit that the model was identified from, if those that were told only
        together with it were what they are now.
        """
        names = [p.name for p in self.base]
        own, others = names.index(name), [names.index(other) for other in self.told_only_with(name)]
        moved = np.array([parameters[names[k]] - self.model.values[names[k]] for k in others])
        of_others = self.prior_covariance[np.ix_(others, others)]
        return float(self.model.values[name] + self.prior_covariance[own, others] @ np.linalg.solve(of_others, moved))

    def prior_of(self, free: Sequence[int]) -> Array:
        """How far some base parameters may wander together while the others are given, shape (free, free).

        Of parameters that were told only together, one that is given tells the others: they stand where they were put
        when the model was identified, as only what all of them are together can be seen to change.
        """
        is_given = np.ones(len(self.base), dtype=bool)
        is_given[list(free)] = False
        given = self._untold[np.any(self._has_part & is_given, axis=1)]
        covariance: Array = (self.prior_covariance - given.T @ given)[np.ix_(free, free)]
        return covariance

    @cached_property
    def prior_std(self) -> Array:
        """How far each base parameter may wander by itself."""
        return np.sqrt(np.diag(self.prior_covariance))

    def moved(self, parameters: Mapping[str, float]) -> list[str]:
        """The base parameters that are further from their nominal values than they may wander.

        Of those that were told only together all that have moved, if they have done so together.
        """
        away = np.array([parameters[p.name] - self.model.values[p.name] for p in self.base])
        far = np.abs(away) > _MOVED_SIGMAS * self.prior_std
        rest = np.flatnonzero(~far)
        together = away[rest] @ np.linalg.solve(self.prior_of(rest.tolist()), away[rest])
        if len(self._untold) and together > len(rest) * _MOVED_SIGMAS**2:
            given = self.prior_covariance - self._untold.T @ self._untold
            far |= np.any(self._has_part, axis=0) & (np.abs(away) > _MOVED_SIGMAS * np.sqrt(np.diag(given)))
        return [p.name for p, moved in zip(self.base, far, strict=True) if moved]

    @property
    def coarse_factor(self) -> float:
        """How fine sub-steps are for a first look, and for slopes on the way of a fit."""
        return _COARSE * self.factor

    @cached_property
    def size(self) -> int:
        """Number of residuals that count."""
        silent = sum(
            int(np.count_nonzero(~e.told)) + e.count_lost * len(noise)
            for e, noise in zip(self.experiments, self.observed_noise, strict=True)
        )
        return len(self.nominal_residuals) - silent

    @cached_property
    def is_short(self) -> bool:
        """Whether fits are so quick that hundreds of them are affordable."""
        steps = sum(e.drive.inputs.shape[1] * sub_steps(self.plant, e.drive.interval_s) for e in self.experiments)
        return bool(steps <= _SHORT)

    @cached_property
    def intervals_s(self) -> tuple[float, ...]:
        """Of every experiment; simulations ask for them thousands of times."""
        return tuple(e.interval_s for e in self.experiments)

    @cached_property
    def start_slopes(self) -> tuple[Array | None, ...]:
        """Of each whitened output in what its first reading got wrong (see `hil.identify.first_reading`)."""
        if self.following:  # the start is forgotten
            return (None,) * len(self.experiments)
        model, found = self.model, []
        for e, noise, interval_s in zip(self.experiments, self.noises, self.intervals_s, strict=True):
            slope = start_slope(e, self.plant, model.values, model.active_effects, noise.std, self.factor)
            found.append(None if slope is None else white(e, noise.std / self.beyond * slope, noise, interval_s))
        return tuple(found)

    @cached_property
    def nominal_residuals(self) -> Array:
        """Whitened residuals of the nominal model, shape (n,)."""
        return self.residuals(self.model.values, self.model.active_effects)

    def residuals(
        self,
        parameters: Mapping[str, float],
        effects: Sequence[ActiveEffect],
        *,
        factor: float | None = None,
        inject: tuple[str, Sequence[Array]] | None = None,
        experiments: Sequence[Experiment] | None = None,
    ) -> Array:
        """Whitened residuals (simulated − measured) of all experiments and recorded inner signals, shape (n,).

        `factor`: other sub-steps than the problem's; `inject`: a disturbance at a hook, one array for each experiment;
        `experiments`: the same, driven by other commands.
        """
        driven, starts = self.experiments if experiments is None else experiments, self.start_slopes

        def errors_of(i: int) -> list[Array]:
            e = driven[i]
            rows = e.respond(
                self.plant, parameters, effects,
                factor=factor or self.factor, inject=(inject[0], inject[1][i]) if inject else None,
                following=self.following,
            )  # fmt: skip
            output = with_free_start(self._weighted(i, e, rows[0] - e.output), starts[i])
            return [output, *e.observed_errors(self.plant, rows, self.observed_noise[i])]

        return side_by_side(errors_of, len(driven))

    def _weighted(self, i: int, e: Experiment, error: Array) -> Array:
        """Errors of the output of experiment i over what noise makes of them, or rounding and noise, shape (n,)."""
        noise = self.noises[i]
        if self.step <= 0.0:
            return white(e, error, noise, self.intervals_s[i])
        return e.telling(beyond_rounding(error, self.step) / (self.model.noise or noise).std)

    def traces(self, parameters: Mapping[str, float], effects: Sequence[ActiveEffect]) -> list[Array]:
        """What passes every hook in each experiment, on the grid of its drive, shape (hooks, n)."""
        found = []
        for e in self.experiments:
            rows = np.zeros((len(self.plant.hooks), e.drive.inputs.shape[1]))
            measured = e.to_follow if self.following else None
            simulate(self.plant, parameters, e.drive, effects, trace=rows, measured=measured)
            found.append(rows)
        return found

    def channel_slices(self) -> list[list[slice]]:
        """Where each experiment's output and then its recorded inner signals stand in the residuals."""
        found, at = [], 0
        for e, inner in zip(self.experiments, self.observed_noise, strict=True):
            n = len(e.output)
            found.append([slice(at + k * n, at + (k + 1) * n) for k in range(1 + len(inner))])
            at = found[-1][-1].stop
        return found

    def output_slices(self) -> list[slice]:
        """Where each experiment's output stands in the residuals."""
        return [parts[0] for parts in self.channel_slices()]

    def outputs_of(self, residuals: Array) -> list[Array]:
        """What of the residuals is each experiment's output; views of them."""
        return [residuals[part] for part in self.output_slices()]

    def base_jacobian(self, parameters: Mapping[str, float], effects: Sequence[ActiveEffect], base: Array) -> Array:
        """Slopes of the residuals in the base parameters, shape (n, k)."""
        names = [p.name for p in self.base]
        values = np.array([parameters[name] for name in names])

        def moved(at: Array) -> Array:
            return self.residuals({**parameters, **dict(zip(names, at.tolist(), strict=True))}, effects)

        high = np.array([p.high for p in self.base])
        scale = np.array([p.scale for p in self.base])
        return jacobian(moved, values, high, scale, base)

    def block_labels(self, seconds: float) -> Array:
        """A number for every residual: the stretch of time of its recording that it lies in, shape (n,)."""
        labels, first = [], 0
        for e, inner in zip(self.experiments, self.observed_noise, strict=True):
            own = first + ((e.time_s - e.time_s[0]) / seconds).astype(np.int64)
            labels += [own] * (1 + len(inner))
            first = int(own[-1]) + 1
        return np.concatenate(labels)


def white(e: Experiment, error: Array, noise: Noise, interval_s: float) -> Array:
    """Errors of an experiment's output, whitened as this noise; 0 where it says nothing, which is felt nowhere else."""
    return e.telling(whiten(e.across_silence(error), noise, interval_s))


def beyond_rounding(error: Array, step: float) -> Array:
    """What of errors rounding to a step cannot have done, shape (n,)."""
    left: Array = error - np.clip(error, -0.5 * step, 0.5 * step)
    return left


def pose(model: Model, experiments: Sequence[Experiment]) -> Problem:
    """Bind a nominal model and experiments, of which at least one output moves, and settle what noise is.

    A hum that the model knows from the healthy unit is taken out of the recordings: it is no news.
    """
    experiments = [_without_hum(model, e) for e in experiments]
    noises = tuple(_noise(model, own["output"]) for own in channel_floors([{"output": e.output} for e in experiments]))
    return Problem(model, tuple(experiments), noises, channel_floors([e.observed for e in experiments]))


def _noise(model: Model, floor: float) -> Noise:
    """The noise the model was identified with, unless a recording's own floor contradicts it."""
    known = model.noise
    if known is None or known.std <= 0.0:
        return Noise(floor)
    expected = white_floor_of(known)
    if 1.0 / _SAME_NOISE < floor / expected < _SAME_NOISE:
        return known
    return replace(known, std=known.std * floor / expected)


def _without_hum(model: Model, e: Experiment) -> Experiment:
    """The recording without the tone that its model knows, as far as it is no larger than it was."""
    known = model.noise
    if known is None or known.hum_hz is None:
        return e
    error = e.output - e.respond(model.definition, model.values, model.active_effects)[0]
    tone, amplitude = line_at(e.time_s, error, known.hum_hz)
    share = min(1.0, _SAME_HUM * known.hum / max(amplitude, 1e-300))
    return replace(e, output=e.output - share * tone)


def white_floor_of(noise: Noise) -> float:
    """What `white_floor` would say of this noise: coloured noise hides most of itself from differences."""
    if not noise.colour:
        return noise.std
    generator = np.random.default_rng(0)
    from scipy.signal import lfilter

    sample = lfilter((1.0,), (1.0, *noise.colour), generator.standard_normal(20_000))[1000:]
    return noise.std * white_floor(sample) / float(np.std(sample))
