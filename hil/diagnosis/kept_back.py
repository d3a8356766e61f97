"""Data that an explanation was not fitted to: other recordings, or stretches beyond the memory of the plant."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil.cores import spread
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.problem import Problem
from hil.diagnosis.search.effort import EFFORT
from hil.diagnosis.search.fits import fit
from hil.diagnosis.search.fitted import Fitted
from hil.diagnosis.thresholds import FEW
from hil.identification.preparation.time_constant import time_constant_s
from hil.language.note import Note
from hil.record.recording import Array, Mask

# After so many time constants a plant has forgotten nineteen twentieths of where it was.
FORGOTTEN = 3.0
Folds = NDArray[np.int64]
OTHER_RECORDINGS = Note("other recordings than those fitted")
OTHER_HALVES = Note("the half of each recording that was not fitted, but for what the plant remembers of the other")
SECOND_HALF = Note("the second half, fitted on the first")
NOTHING = Note("nothing: one recording, shorter than the plant's memory of itself")


@dataclass(frozen=True, slots=True)
class KeptBack:
    """Which residuals are predicted by fits without them.

    Attributes:
        fold: of every residual the fold that it is in, shape (n,): it is predicted by a fit of the others.
        scored: which are judged, shape (n,).
        basis: what they are.
    """

    fold: Folds
    scored: Mask
    basis: Note


def kept_back(problem: Problem, f: Fitted) -> KeptBack:
    """How the recordings are dealt: by recording where there are several, else in halves beyond the plant's memory.

    Halves too where an explanation changes the recordings of one fold alone: no fit of the others can foretell it.
    """
    recordings = problem.experiments
    everything = np.ones(len(problem.nominal_residuals), dtype=np.bool_)
    by_recording = KeptBack(_by_recording(problem), everything, OTHER_RECORDINGS)
    if len(recordings) > 1 and not (f.terms and _shows_in_one(problem, f, by_recording.fold)):
        return by_recording
    since = [e.time_s - e.time_s[0] for e in recordings]
    second = [t > 0.5 * e.duration_s for t, e in zip(since, recordings, strict=True)]
    fold = _tiled(problem, second).astype(np.int64)
    if not problem.plant.forgets(problem.model.values):
        return KeptBack(fold, _tiled(problem, second), SECOND_HALF)
    forgotten = [t > 0.5 * e.duration_s + FORGOTTEN * time_constant_s(problem.model, e)
                 for t, e in zip(since, recordings, strict=True)]  # fmt: skip
    if any(map(np.any, forgotten)):
        return KeptBack(fold, _tiled(problem, [~s | f for s, f in zip(second, forgotten, strict=True)]), OTHER_HALVES)
    return KeptBack(fold, everything, NOTHING) if len(recordings) == 1 else by_recording


def predicted(problem: Problem, f: Fitted, kept: KeptBack, refit: Callable[[Mask], Fitted] | None = None) -> Array:
    """Residuals of an explanation, each by a refit without its fold; as they are where nothing is kept back.

    `refit`: the explanation fitted to some of the residuals, where not as the search does.
    """
    if kept.basis == NOTHING or f.estimate is None:
        return f.residuals
    folds = [k for k in np.unique(kept.fold) if np.any(kept.scored[kept.fold == k])]
    refit = refit or (lambda keep: fit(problem, f, keep=keep, steps=EFFORT.rough))
    parts = spread(lambda k: np.where(kept.fold == k, refit(kept.fold != k).residuals, 0.0), folds)
    return np.sum(parts, axis=0)


def _by_recording(problem: Problem) -> Folds:
    """Every other recording together; in a few folds where recordings are short, and fits affordable."""
    sizes = [sum(part.stop - part.start for part in parts) for parts in problem.channel_slices()]
    return np.repeat(np.arange(len(sizes)) % (FEW if problem.is_short else 2), sizes)


def _shows_in_one(problem: Problem, f: Fitted, fold: Folds) -> bool:
    """Whether an explanation changes nothing of consequence in the recordings that are left without some fold."""
    change = (f.residuals - problem.nominal_residuals) ** 2
    expected = problem.size / len(change)
    return any(float(np.mean(change[fold != k])) < CRITERIA.scale * expected for k in np.unique(fold))


def _tiled(problem: Problem, values: Sequence[Mask]) -> Mask:
    """The same for the output and every inner signal of each recording."""
    return np.concatenate(
        [np.tile(own, len(parts)) for own, parts in zip(values, problem.channel_slices(), strict=True)]
    )
