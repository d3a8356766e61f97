"""Settled sines compared as one mean period: more periods tell the same again, with less noise.

Whole periods are left out of command and readings. The command goes on as if the sine had been played for fewer of
them, and a settled plant stands after one period where it stood before it: what is simulated becomes shorter too.
The mean of P periods times √P has the variance of one sample, whatever the colour of the noise within a period.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hil.arrays import ROUNDING
from hil.identification.preparation.averaged import means
from hil.identification.preparation.criteria import CRITERIA
from hil.identification.preparation.experiment import OUTPUT, Experiment, Sine
from hil.identification.uncertainty.noise import channel_floor
from hil.language.note import Note
from hil.physics.model import Model
from hil.record.recording import Array


def with_mean_periods(model: Model, experiments: Sequence[Experiment]) -> tuple[list[Experiment], tuple[Note, ...]]:
    """Long experiments with one mean period of every sine that has settled, and that in words.

    A sine has settled where its procedure and its readings say so: periods of no channel differ by more than noise. Of
    a plant that remembers its start no period is left out: what it drifts in all of them tells something.
    """
    if not model.definition.forgets(model.values):
        return list(experiments), ()
    each = [(e, list(_folds(e)) if _is_worth(e) else []) for e in experiments]
    made = [_folded(e, folds) if folds else e for e, folds in each]
    notes = (
        Note(
            "{sines} settled sines are compared as one mean period each: {share:.0f} % of the samples are simulated",
            sines=len(folds), share=100.0 * len(short.output) / len(e.output),
        ).of(e.name)
        for (e, folds), short in zip(each, made, strict=True)
        if folds
    )  # fmt: skip
    return made, tuple(notes)


def _is_worth(e: Experiment) -> bool:
    """Whether it is long, and read on the even grid of its command."""
    return e.averaged > 1 and e.grid_s is None and e.ripples is None


@dataclass(frozen=True)
class _Fold:
    """Whole periods, in samples, that follow the first of a sine and are added to it."""

    first: int
    period: float
    more: int

    @property
    def kept(self) -> slice:
        """The first period."""
        return slice(self.first, self.first + round(self.period))

    @property
    def left_out(self) -> slice:
        """Those that follow; the sine goes on after them where it would have gone on without them."""
        return slice(self.kept.stop, self.kept.stop + round(self.more * self.period))

    @property
    def slip(self) -> float:
        """By how much it does not, in samples."""
        return abs(self.more * self.period - round(self.more * self.period))

    @cached_property
    def _places(self) -> tuple[Array, Array]:
        """The instants of the first period, and of the others, between samples; those before them, and how far."""
        at = self.first + np.arange(round(self.period)) + self.period * np.arange(1 + self.more)[:, None]
        before = np.floor(at + ROUNDING)
        return before, at - before

    def periods(self, values: Array) -> Array:
        """All of them at the instants of the first, by cubics through four samples, shape (1 + more, samples)."""
        before, s = self._places
        shares = (
            -s * (s - 1.0) * (s - 2.0) / 6.0, (s + 1.0) * (s - 1.0) * (s - 2.0) / 2.0,
            -(s + 1.0) * s * (s - 2.0) / 2.0, (s + 1.0) * s * (s - 1.0) / 6.0,
        )  # fmt: skip
        k = before.astype(np.int64)
        samples = (values[np.clip(k + i, 0, len(values) - 1)] for i in (-1, 0, 1, 2))
        return np.sum([share * own for share, own in zip(shares, samples, strict=True)], axis=0)


def _folds(e: Experiment) -> Iterator[_Fold]:
    """Of each sine that has settled, as many periods as leave its command in step."""
    floors = {name: channel_floor(values) for name, values in e.valid_observed.items()}
    weighted = [(e.output, e.weight), *((e.observed[name], 1.0 / floor) for name, floor in floors.items() if floor)]
    tells = np.all([e.valid_in(name) for name in (OUTPUT, *e.observed)], axis=0)
    whole = (sine for sine in e.sines if tells[sine.first : sine.first + sine.count].all())
    for fold in (_in_step(e, sine) for sine in whole):
        if fold and all(_is_noise(fold.periods(values), weight, e.averaged) for values, weight in weighted):
            yield fold


def _in_step(e: Experiment, sine: Sine) -> _Fold | None:
    period = 1.0 / (sine.frequency_hz * e.drive.interval_s)
    steepest = np.pi / period * float(np.ptp(e.output[sine.first : sine.first + sine.count])) * e.weight
    folds = (_Fold(sine.first, period, more) for more in range(int(sine.count / period) - 1, 0, -1))
    return next((fold for fold in folds if fold.slip * steepest <= CRITERIA.slip), None)


def _is_noise(periods: Array, weight: float, count: int) -> bool:
    """Whether periods differ from their mean by white noise of unit weight, seen in means of so many neighbours."""
    off = weight * np.concatenate([means(row, count) for row in periods - periods.mean(axis=0)])
    freedom = len(off) * (1.0 - 1.0 / len(periods))
    return float(off @ off) <= freedom + CRITERIA.significant * np.sqrt(2.0 * freedom)


def _folded(e: Experiment, folds: Sequence[_Fold]) -> Experiment:
    stays, root_counts = np.ones(len(e.output), dtype=np.bool_), np.ones(len(e.output))
    for fold in folds:
        stays[fold.left_out] = False
        root_counts[fold.kept] = np.sqrt(1 + fold.more)

    def folded(values: Array) -> Array:
        made = values.copy()
        for fold in folds:
            made[fold.kept] = fold.periods(values).mean(axis=0)
        return made[stays]

    return replace(
        e, time_s=e.time_s[: np.count_nonzero(stays)], drive=replace(e.drive, inputs=e.drive.inputs[:, stays]),
        output=folded(e.output), observed={name: folded(values) for name, values in e.observed.items()},
        invalid={name: lost[stays] for name, lost in e.invalid.items()}, sines=(),
        root_counts=root_counts[stays], whole=e,
    )  # fmt: skip
