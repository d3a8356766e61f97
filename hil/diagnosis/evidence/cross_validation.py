"""Cross-validation: data that an explanation was not fitted to, and what they say of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from hil.cores import parallel_map
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.intake.problem import Problem
from hil.diagnosis.search.effort import EFFORT
from hil.diagnosis.search.fits import fit
from hil.diagnosis.search.fitted import Fitted
from hil.diagnosis.thresholds import FEW
from hil.identification.preparation.time_constant import time_constant_s
from hil.language.note import Note
from hil.record.recording import Array, Integers, Mask
from hil.signals.colour import colour_factor
from hil.signals.products import in_parts, triangular

# Every other stretch of this length is kept back. Long against the memory of a valve, or of a plant that is sampled as
# slowly as it moves, so that the stretches are news; short against a recording, so that both halves see every kind of
# excitation.
_BLOCK_S, _BLOCK_SAMPLES = 4.0, 100


@dataclass(frozen=True, slots=True)
class Judged:
    """An explanation refitted on one half of the data and judged on the other.

    Attributes:
        fitted: the explanation, with values from all data.
        fit_held_out: in %, of the output, over all recordings.
        chi2_held_out: of the whitened residuals kept back.
    """

    fitted: Fitted
    fit_held_out: float
    chi2_held_out: float


def training_half(problem: Problem) -> Mask:
    """Which residuals are fitted; the others are for judging. Shape (n,), True and False."""
    blocks = problem.block_labels(max(_BLOCK_S, _BLOCK_SAMPLES * max(problem.intervals_s)))
    return blocks % 2 == 0


def judge(problem: Problem, fitted: Fitted) -> Judged:
    """Refit on the training half, starting from the values that all data gave, and judge on the other half."""
    train = training_half(problem)
    refitted = fit(problem, fitted, keep=train, steps=EFFORT.rough) if fitted.terms else fitted
    r, held_out = refitted.residuals, ~train
    return Judged(fitted, held_out_fit(problem, r, held_out), float(r[held_out] @ r[held_out]))


def held_out_fit(problem: Problem, residuals: Array, held_out: Mask) -> float:
    """Fit % of the output over the samples kept back, every recording's mean taken off by itself."""
    errors, spreads = 0.0, 0.0
    for i, (e, part) in enumerate(zip(problem.experiments, problem.output_slices(), strict=True)):
        kept = held_out[part] & e.valid
        if not kept.any():
            continue
        errors += float(np.sum(problem.errors(i, residuals[part])[kept] ** 2))
        measured = e.output[kept]
        spreads += float(np.sum((measured - measured.mean()) ** 2))
    return 100.0 * (1.0 - float(np.sqrt(errors / spreads))) if spreads else float("nan")


# After so many time constants a plant has forgotten nineteen twentieths of where it was.
FORGOTTEN = 3.0
OTHER_RECORDINGS = Note("other recordings than those fitted")
OTHER_HALVES = Note(
    "the half of each recording that was not fitted, less the time in which the plant remembers the other"
)
SECOND_HALF = Note("the second half, fitted on the first")
NOTHING = Note("nothing: one recording, shorter than the plant's memory of itself")


@dataclass(frozen=True, slots=True)
class Folds:
    """Which residuals are predicted by fits without them.

    Attributes:
        fold: of every residual the fold that it is in, shape (n,): it is predicted by a fit of the others.
        scored: which are judged, shape (n,).
        basis: what they are.
        settles_s: after so long the explained plant has forgotten where it was; 0 where it does not settle.
    """

    fold: Integers
    scored: Mask
    basis: Note
    settles_s: float


def folds_of(problem: Problem, f: Fitted, of_fit: Callable[[Integers], Integers] | None = None) -> Folds:
    """How the recordings are dealt: by recording where there are several, else in halves beyond the plant's memory.

    Halves too where no fit of the others can foretell a fold: an explanation changes it alone, or the others leave its
    values open, as two laws of pressure at one pressure.

    Args:
        problem: the question.
        f: its explanation.
        of_fit: the folds of the rows that it was fitted to, from those of the residuals, where it was not these.
    """
    recordings = problem.experiments
    everything = np.ones(len(problem.nominal_residuals), dtype=np.bool_)
    settle_s = [FORGOTTEN * time_constant_s(problem.model, e, f.parameters, f.effects) for e in recordings]
    by_recording = Folds(_by_recording(problem), everything, OTHER_RECORDINGS, max(settle_s))
    fold = by_recording.fold
    fitted = fold if of_fit is None else of_fit(fold)
    if len(recordings) > 1 and not (f.terms and (_shows_in_one(problem, f, fold) or _is_left_open(f, fitted))):
        return by_recording
    since = [e.time_s - e.time_s[0] for e in recordings]
    second = [t > 0.5 * e.duration_s for t, e in zip(since, recordings, strict=True)]
    fold = _tiled(problem, second).astype(np.int64)
    if not problem.plant.forgets(problem.model.values | f.parameters):
        return replace(by_recording, fold=fold, scored=_tiled(problem, second), basis=SECOND_HALF)
    forgotten = [t > 0.5 * e.duration_s + own for t, e, own in zip(since, recordings, settle_s, strict=True)]
    if any(map(np.any, forgotten)):
        scored = _tiled(problem, [~s | f for s, f in zip(second, forgotten, strict=True)])
        return replace(by_recording, fold=fold, scored=scored, basis=OTHER_HALVES)
    return replace(by_recording, fold=fold, basis=NOTHING) if len(recordings) == 1 else by_recording


def predicted(problem: Problem, f: Fitted, folds: Folds, refit: Callable[[Mask], Fitted] | None = None) -> Array:
    """Residuals of an explanation, each by a refit without its fold; as they are where nothing is kept back.

    `refit`: the explanation fitted to some of the residuals, where not as the search does.
    """
    if folds.basis == NOTHING or f.estimate is None:
        return f.residuals
    dealt = [k for k in np.unique(folds.fold) if np.any(folds.scored[folds.fold == k])]
    refit = refit or (lambda keep: fit(problem, f, keep=keep, steps=EFFORT.rough))
    parts = parallel_map(lambda k: np.where(folds.fold == k, refit(folds.fold != k).residuals, 0.0), dealt)
    return np.sum(parts, axis=0)


def _by_recording(problem: Problem) -> Integers:
    """Every other recording together; in a few folds where recordings are short, and fits affordable."""
    sizes = [sum(part.stop - part.start for part in parts) for parts in problem.channel_slices()]
    return np.repeat(np.arange(len(sizes)) % (FEW if problem.is_short else 2), sizes)


def _shows_in_one(problem: Problem, f: Fitted, fold: Integers) -> bool:
    """Whether an explanation changes nothing of consequence in the recordings that are left without some fold."""
    change = (f.residuals - problem.nominal_residuals) ** 2
    expected = problem.size / len(change)
    return any(float(np.mean(change[fold != k])) < CRITERIA.scale * expected for k in np.unique(fold))


def _is_left_open(f: Fitted, fold: Integers) -> bool:
    """Whether the values of an explanation are so open without some fold of its fit that it is no prediction there.

    That is what leverage says: the variance of a prediction over that of a sample, here of independent ones.
    """
    if f.estimate is None:
        return False
    slopes, prior = np.split(f.estimate.jacobian, [len(fold)])
    bounds = np.diag([1.0 / (u.high - u.low) for u in f.estimate.unknowns])
    colour = colour_factor(f.estimate.residuals[: len(fold)])
    parts = list(in_parts(len(fold)))
    for k in np.unique(fold):
        known = triangular(chain([np.vstack([prior, bounds])], (slopes[part][fold[part] != k] for part in parts)))
        held = (slopes[part][fold[part] == k] for part in parts)
        leverage = sum(float(np.sum(np.linalg.solve(known.T, rows.T) ** 2)) for rows in held)
        if leverage / np.count_nonzero(fold == k) * colour > 1.0:
            return True
    return False


def _tiled(problem: Problem, values: Sequence[Mask]) -> Mask:
    """The same for the output and every inner signal of each recording."""
    return np.concatenate(
        [np.tile(own, len(parts)) for own, parts in zip(values, problem.channel_slices(), strict=True)]
    )


# So few blocks say nothing; and the risk of being wrong.
_FEWEST, _RISK = 6, 0.05
# Blocks of a recording whose plant does not settle, and at most as many as are worth telling apart.
_MOST = 40
# Sign changes that are tried where there are too many to try all.
_ALL, _DRAWN = 12, 4095


def why_not_better(problem: Problem, nominal: Array, predicted: Array, folds: Folds) -> Note | None:
    """Why a prediction is not held for better than the nominal model, in words; None where it is better.

    Args:
        problem: the question.
        nominal: whitened residuals of the nominal model, shape (n,).
        predicted: those of the corrected model, each by a fit without it, shape (n,).
        folds: which of them no fit has seen.
    """
    if folds.basis == NOTHING:
        return Note("every part of the recordings was used in a fit")
    # by how much the squared error falls in each block that has something to judge
    lasting_s = sum(e.duration_s for e in problem.experiments)
    blocks = problem.block_labels(max(folds.settles_s, lasting_s / _MOST))[folds.scored]
    gain = nominal[folds.scored] ** 2 - predicted[folds.scored] ** 2
    gains = np.bincount(blocks, gain).astype(np.float64)[np.bincount(blocks) > 0]
    if len(gains) < _FEWEST:
        return Note(
            "only {count} blocks that no fit has seen outlast the settling of the plant; {least} are needed",
            count=len(gains), least=_FEWEST,
        )  # fmt: skip
    risk = by_sign_changes(gains)
    if risk > _RISK:
        return Note("on parts that no fit has seen it is not better beyond chance (p = {risk:.2g})", risk=risk)
    return None


def by_sign_changes(gains: Array) -> float:
    """How probable gains as large in all are, were each as likely to be a loss (one-sided)."""
    count = len(gains)
    if count <= _ALL:
        signs = 1.0 - 2.0 * ((np.arange(2**count)[:, None] >> np.arange(count)) & 1)
    else:
        drawn = np.random.default_rng(count).integers(0, 2, (_DRAWN, count))
        signs = np.vstack([np.ones(count), 1.0 - 2.0 * drawn])
    return float(np.mean(signs @ gains >= gains.sum() * (1.0 - 1e-12)))
