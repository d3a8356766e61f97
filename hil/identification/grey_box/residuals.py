"""What a fit of a plant minimises: simulated less measured, of all recordings, in units of the noise."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from itertools import chain

import numpy as np

from hil.identification.grey_box.estimate import side_by_side
from hil.identification.preparation.averaged import means
from hil.identification.preparation.experiment import Experiment
from hil.identification.preparation.initial_condition import start_slope, with_free_start
from hil.identification.uncertainty.noise import channel_floors
from hil.physics.plant import Parameters, Plant
from hil.physics.simulate import ActiveEffect, simulate
from hil.record.recording import Array


@dataclass(frozen=True)
class Residuals:
    """Of a plant on recordings.

    Attributes:
        plant: what is simulated.
        experiments: the recordings.
        about: parameters near which it is asked. `effects`: switched on there.
    """

    plant: Plant
    experiments: Sequence[Experiment]
    about: Parameters
    effects: Sequence[ActiveEffect]

    @cached_property
    def _starts(self) -> list[Array | None]:
        return [start_slope(e, self.plant, self.about, self.effects, 1.0 / e.weight) for e in self.experiments]

    @cached_property
    def _dithers(self) -> list[list[Array]]:
        """By recording, of its output and its inner signals: what the phase of a dither does to them, shape (k, n)."""
        made = []
        for e, inner in zip(self.experiments, self._inner, strict=True):
            places = {name: 1 + k for k, name in enumerate(s.name for s in self.plant.observed)}
            each = e.by_dither(self.plant, self.about, self.effects)
            channels = [
                (0, e.weight, e.valid),
                *((places[n], 1.0 / noise, e.valid_in(n)) for n, noise in inner.items()),
            ]
            made.append([_orthogonal([w * rows[k] * tells for rows in each]) for k, w, tells in channels])
        return made

    @cached_property
    def _inner(self) -> tuple[dict[str, float], ...]:
        return channel_floors([(e.whole or e).valid_observed for e in self.experiments])

    def at(
        self,
        parameters: Parameters,
        effects: Sequence[ActiveEffect],
        *,
        factor: float = 1.0,
        inject: Callable[[int], tuple[str, Array]] | None = None,
    ) -> Array:
        """Of the output and the inner signals of one recording after another, shape (n,).

        `factor` and `inject` as in `hil.physics.simulate.simulate`, `inject` by the number of the recording.
        """

        def errors_of(i: int) -> list[Array]:
            e = self.experiments[i]
            given = inject(i) if inject else None
            rows = e.respond(self.plant, parameters, effects, factor=factor, inject=given)
            output = rows[0]  # made for this alone: of a long recording every copy takes megabytes
            output -= e.output
            output *= e.weight
            inner = e.observed_errors(self.plant, rows, self._inner[i])
            errors = chain((with_free_start(e.telling(output), self._starts[i]),), inner)
            pairs = zip(self._dithers[i], errors, strict=True)
            return [_means(e, reduce(with_free_start, dither, error)) for dither, error in pairs]

        return side_by_side(errors_of, len(self.experiments))

    def stated_gains(self) -> list[tuple[str, float]]:
        """Channels whose calibration states an uncertainty, and that as a share of the largest reading.

        `""` is the command, `"output"` the output.
        """
        shares: dict[str, float] = {}
        for e in self.experiments:
            for name, share in e.gain_stds.items():
                shares[name] = min(share, shares.get(name, share))
        return sorted(shares.items())

    def driven_by(self, factor: float) -> Residuals:
        """The same with commands so many times as large."""
        driven = [e.driven(factor * e.drive.inputs) for e in self.experiments]
        return replace(self, experiments=driven)

    def readings(self, names: Sequence[str | None]) -> Array:
        """What was read, in units of the noise, of channels with these names, None being the output; else 0; (n,)."""

        def readings_of(i: int) -> list[Array]:
            e = self.experiments[i]
            output = e.telling(e.output * e.weight) if None in names else np.zeros(len(e.output))
            inner = [
                (e.observed[s.name] / self._inner[i][s.name] if s.name in names else np.zeros(len(e.output)))
                for s in self.plant.observed
                if s.name in self._inner[i]
            ]
            return [_means(e, errors) for errors in (with_free_start(output, self._starts[i]), *inner)]

        return side_by_side(readings_of, len(self.experiments))

    def passing(self, parameters: Parameters) -> list[Array]:
        """What arrives at each hook in each recording, shape (hooks, n) each, on the grid of its command."""
        made = []
        for e in self.experiments:
            trace = np.empty((len(self.plant.hooks), e.drive.inputs.shape[1]))
            simulate(self.plant, parameters, e.drive, self.effects, trace=trace)
            made.append(trace)
        return made


def _means(e: Experiment, errors: Array) -> Array:
    """Errors as they are compared, in units of the noise of what they are means of."""
    return means(errors if e.root_counts is None else errors * e.root_counts, e.averaged)


def _orthogonal(additions: list[Array]) -> Array:
    """Additions of independent unknown sizes as orthogonal ones of the same sum: one after another is all together."""
    if not additions:
        return np.empty((0, 0))
    left, sizes, _ = np.linalg.svd(np.array(additions).T, full_matrices=False)
    return np.ascontiguousarray((left * sizes).T[sizes > 0.0])
