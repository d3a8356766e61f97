"""Whether a corrected model is better than the nominal one where no fit has looked."""

from __future__ import annotations

import numpy as np

from hil.diagnosis.kept_back import FORGOTTEN, NOTHING, KeptBack
from hil.diagnosis.problem import Problem
from hil.identification.preparation.time_constant import time_constant_s
from hil.language.note import Note
from hil.record.recording import Array

# So few blocks say nothing; and the risk of being wrong.
_FEWEST, _RISK = 6, 0.05
# Blocks of a recording whose plant does not settle, and at most as many as are worth telling apart.
_MOST = 40
# Sign changes that are tried where there are too many to try all.
_ALL, _DRAWN = 12, 4095


def why_not_better(problem: Problem, nominal: Array, predicted: Array, kept: KeptBack) -> Note | None:
    """Why a prediction is not held for better than the nominal model, in words; None where it is better.

    Args:
        problem: the question.
        nominal: whitened residuals of the nominal model, shape (n,).
        predicted: those of the corrected model, each by a fit without it, shape (n,).
        kept: which of them no fit has seen.
    """
    if kept.basis == NOTHING:
        return Note("there is no part of the recordings that no fit has seen")
    # by how much the squared error falls in each block that has something to judge
    settles_s = max(time_constant_s(problem.model, e) for e in problem.experiments)
    lasting_s = sum(e.duration_s for e in problem.experiments)
    blocks = problem.block_labels(max(FORGOTTEN * settles_s, lasting_s / _MOST))[kept.scored]
    gain = nominal[kept.scored] ** 2 - predicted[kept.scored] ** 2
    gains = np.bincount(blocks, gain).astype(np.float64)[np.bincount(blocks) > 0]
    if len(gains) < _FEWEST:
        return Note(
            "the parts that no fit has seen make {count} blocks longer than the plant settles in; {least} are needed",
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
