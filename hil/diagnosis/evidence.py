"""Judge explanations on data that they were not fitted to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hil.diagnosis.problem import Problem
from hil.diagnosis.search.effort import EFFORT
from hil.diagnosis.search.fits import fit
from hil.diagnosis.search.fitted import Fitted
from hil.record.recording import Array, Mask

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
