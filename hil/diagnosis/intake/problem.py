"""The question: a nominal model, recordings on which it may fail, and noise that says when it does."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np

from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.intake.prior import Prior
from hil.diagnosis.intake.work import Work
from hil.diagnosis.thresholds import FAR, NEXT_TO_NOTHING, PLAINLY, TINY
from hil.identification.grey_box.estimate import jacobian, side_by_side
from hil.identification.grey_box.lines import line_at
from hil.identification.preparation.experiment import Experiment
from hil.identification.preparation.initial_condition import start_slope, with_free_start
from hil.identification.uncertainty.evidence import VERY_STRONG
from hil.identification.uncertainty.fit import explains_little
from hil.identification.uncertainty.noise import channel_floors, noise_in, whiten
from hil.language.note import Note
from hil.physics.compose import kernel
from hil.physics.model import Model, Noise
from hil.physics.plant import Parameter, Parameters, Plant
from hil.physics.simulate import ActiveEffect, simulate, sub_steps
from hil.record.recording import Array
from hil.signals.interval import COVERED

# A first look takes sub-steps this much coarser.
COARSER = 0.5
# Recordings are short where one simulation of all of them works out no more than this: about a millisecond.
_SHORT = 24e6


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
        is_own: whether the model was identified from these recordings: its parameters were bent to what it lacks, and
            that a cause moves them back is no change of the unit.
        refuted: terms, by name and hook, that the recordings refute: they are not looked for.
        work: how far the diagnosis is, and how long it may go on.
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
    is_own: bool = False
    refuted: frozenset[tuple[str, str]] = frozenset()
    work: Work = field(default_factory=Work, compare=False)

    @property
    def plant(self) -> Plant:
        """The model's plant."""
        return self.model.definition

    @cached_property
    def base(self) -> tuple[Parameter, ...]:
        """Base parameters that the plant lets free, in the units of the model's channels."""
        resolved = self.model.resolved_unit
        return tuple(replace(p, unit=resolved(p.unit)) for p in self.plant.parameters if not p.fixed)

    @cached_property
    def prior(self) -> Prior:
        """How far the base parameters may wander without being called changed."""
        return Prior(self.model, self.base, self.is_own)

    @property
    def coarse_factor(self) -> float:
        """How fine sub-steps are for a first look, and for slopes on the way of a fit."""
        return COARSER * self.factor

    @cached_property
    def size(self) -> int:
        """Number of residuals that count."""
        silent = sum(
            int(np.count_nonzero(~e.valid)) + e.count_lost * len(noise)
            for e, noise in zip(self.experiments, self.observed_noise, strict=True)
        )
        return len(self.nominal_residuals) - silent

    @property
    def explains_little(self) -> bool:
        """Whether the nominal model leaves more than half of the outputs' variance."""
        left = [self.errors(i, r) for i, r in enumerate(self.outputs_of(self.nominal_residuals))]
        return explains_little([e.valid_output for e in self.experiments], left)

    @property
    def noise_uncertainty(self) -> float:
        """How far the noise's variance may be off within 95 %, as a share of it."""
        known = self.model.noise
        own = 0.0 if known is None or known.std <= 0.0 else 2.0 * COVERED * known.std_uncertainty / known.std
        return max(own, CRITERIA.scale)

    def excess(self, chi2: float) -> float:
        """Variance beyond the noise, as a share of it."""
        return max(chi2 / self.size - 1.0, 0.0)

    @cached_property
    def expected(self) -> float:
        """χ² that noise alone leaves.

        Of a sample at a distance d from the end of its level, where all distances are as likely, noise of variance σ²
        makes d² with the probability Φ(−d/σ): 2/q·∫d²Φ(−d/σ)dd = ⅔·√(2/π)·σ³/q.
        """
        known = self.model.noise
        if self.step <= 0.0 or known is None:
            return float(self.size)
        valid = sum(int(e.valid.sum()) for e in self.experiments)
        return self.size - valid + valid * 2.0 / 3.0 * math.sqrt(2.0 / math.pi) * known.std / self.step

    @cached_property
    def is_short(self) -> bool:
        """Whether fits are so quick that hundreds of them are affordable: by what one simulation has to work out.

        Not by the time that it takes: an answer must not depend on what else a machine is at.
        """
        steps = sum(e.drive.inputs.shape[1] * sub_steps(self.plant, e.drive.interval_s) for e in self.experiments)
        return bool(steps * kernel(self.plant.name).operations <= _SHORT)

    @cached_property
    def intervals_s(self) -> tuple[float, ...]:
        """Of every experiment; simulations ask for them thousands of times."""
        return tuple(e.interval_s for e in self.experiments)

    @cached_property
    def start_slopes(self) -> tuple[Array | None, ...]:
        """Of each whitened output in what its first reading got wrong (see `preparation.initial_condition`)."""
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
        parameters: Parameters,
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
        self.work.simulated(len(driven), sum(e.drive.inputs.shape[1] for e in driven))

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

    def errors(self, i: int, residuals: Array) -> Array:
        """Whitened residuals of the output of experiment i as simulated minus recorded, in its unit, shape (n,).

        Whitening keeps the size of white noise; coloured noise stays whitened.
        """
        return residuals * self.noises[i].std

    def traces(self, parameters: Parameters, effects: Sequence[ActiveEffect]) -> list[Array]:
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

    def base_jacobian(self, parameters: Parameters, effects: Sequence[ActiveEffect], base: Array) -> Array:
        """Slopes of the residuals in the base parameters, shape (n, k)."""
        names = [p.name for p in self.base]
        values = np.array([parameters[name] for name in names])

        def moved(at: Array) -> Array:
            return self.residuals({**parameters, **dict(zip(names, at.tolist(), strict=True))}, effects)

        return jacobian(moved, self.base, values, base)

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
    return error - np.clip(error, -0.5 * step, 0.5 * step)


def pose(model: Model, experiments: Sequence[Experiment]) -> Problem:
    """Bind a nominal model and experiments, of which at least one output moves, and settle what noise is.

    A hum that the model knows from the healthy unit is taken out of the recordings: it is no news unless it is plainly
    larger.
    """
    experiments = [_without_hum(model, e) for e in experiments]
    floors = channel_floors([{"output": e.valid_output} for e in experiments])
    noises = tuple(noise_in(model.noise, own["output"]) for own in floors)
    inner = channel_floors([e.valid_observed for e in experiments])
    return Problem(model, tuple(experiments), noises, tuple(map(partial(_with_dither, model), experiments, inner)))


def _with_dither(model: Model, e: Experiment, floors: dict[str, float]) -> dict[str, float]:
    """Noise of inner signals with the ripple of a dither, whose phase nobody recorded: no comparison can foresee it."""
    waves = e.by_dither(model.definition, model.values, model.active_effects)
    if not waves:
        return floors
    power = sum(np.mean(rows**2, axis=1) for rows in waves) / 2.0  # sine and cosine share each harmonic
    ripple = dict(zip((s.name for s in model.definition.observed), np.sqrt(power[1:]).tolist(), strict=True))
    return {name: math.hypot(floor, ripple[name]) for name, floor in floors.items()}


def _without_hum(model: Model, e: Experiment) -> Experiment:
    """The recording without the tone that its model knows, as far as it is no larger than it was."""
    known = model.noise
    if known is None or known.hum_hz is None:
        return e
    error = e.output - e.simulated(model)[0]
    tone, amplitude = line_at(e.time_s, error, known.hum_hz)
    share = min(1.0, PLAINLY * known.hum / max(amplitude, TINY))
    return replace(e, output=e.output - share * tone)


# A finer step may change the simulation by this share of the noise before the step counts as too coarse.
_HARMLESS = 0.1
_FINER = (FAR, FAR * FAR)


def settled(problem: Problem) -> tuple[Problem, tuple[Note, ...]]:
    """The problem with sub-steps no finer than needed, so that finer ones change nothing; what had to be done about it.

    Equations of second order, which most plants have, are so exact at the plant's own sub-steps that a search can do
    with half of them: where these change the simulation by next to nothing of the noise, and χ² by less than what would
    be very strong evidence.
    """
    if not problem.is_short:
        coarser = replace(problem, factor=COARSER)
        change = coarser.nominal_residuals - problem.nominal_residuals
        if float(change @ change) <= min(VERY_STRONG, NEXT_TO_NOTHING**2 * len(change)):
            return coarser, ()
    coarse = problem.nominal_residuals
    for finer in _FINER:
        change = problem.residuals(problem.model.values, problem.model.active_effects, factor=finer) - coarse
        error = float(np.sqrt(np.mean(change**2)))
        if error <= _HARMLESS:
            return problem, ()
        problem = replace(problem, factor=finer)
        coarse = problem.nominal_residuals
    sizeable = Note(
        "with steps {finer:g} times finer the simulation still changes by {error:.2g} times the noise; small effects "
        "may be numerical error",
        finer=_FINER[-1], error=error,
    )  # fmt: skip
    return problem, (sizeable,)
