"""Judge explanations on data that they were not fitted to."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil.diagnosis.measures import is_strained
from hil.diagnosis.problem import Problem
from hil.diagnosis.search.fitted import Fitted
from hil.diagnosis.search.polish import fit
from hil.diagnosis.yardsticks import AT_A_GLANCE, SELDOM_BY_CHANCE
from hil.record.recording import Array

Mask = NDArray[np.bool_]

# Every other stretch of this length is kept back. Long against the memory of a valve, or of a plant that is sampled as
# slowly as it moves, so that the stretches are news; short against a recording, so that both halves see every kind of
# excitation.
_STRETCH_S, _STRETCH_SAMPLES = 4.0, 100
_WORTH = 4.0
# How often names of sealed cases were right, by what had been said of them: log odds from log odds (Platt), fitted once
# to the 414 names of `tests/proof/published.json`; on names of other seeds in docs/explanation/proof.md.
_CALIBRATED = (1.75, 0.52)


@dataclass(frozen=True, slots=True)
class Judged:
    """An explanation refitted on one half of the data and judged on the other.

    Attributes:
        fitted: the explanation, with values from all data.
        fit_held_out: in %, of the output, over all recordings.
        chi2_held_out: of the whitened residuals kept back; `count`: their number.
        prior_cost: of base parameters that had to move for it.
    """

    fitted: Fitted
    fit_held_out: float
    chi2_held_out: float
    count: int
    prior_cost: float


def training_half(problem: Problem) -> Mask:
    """Which residuals are fitted; the others are for judging. Shape (n,), True and False."""
    stretches = problem.block_labels(max(_STRETCH_S, _STRETCH_SAMPLES * max(problem.intervals_s)))
    half: Mask = stretches % 2 == 0
    return half


def judge(problem: Problem, fitted: Fitted) -> Judged:
    """Refit on the training half, starting from the values that all data gave, and judge on the other half."""
    train = training_half(problem)
    refitted = fit(problem, fitted, keep=train, effort=AT_A_GLANCE) if fitted.terms else fitted
    r, held_out = refitted.residuals, ~train
    prior_cost = refitted.chi2 - float(r[train] @ r[train]) if fitted.terms else 0.0
    chi2 = float(r[held_out] @ r[held_out])
    return Judged(fitted, held_out_fit(problem, r, held_out), chi2, int(held_out.sum()), prior_cost)


def held_out_fit(problem: Problem, residuals: Array, held_out: Mask) -> float:
    """Fit % of the output over the samples kept back, every recording's mean taken off by itself."""
    errors, spreads = 0.0, 0.0
    for i, (e, part) in enumerate(zip(problem.experiments, problem.output_slices(), strict=True)):
        kept = held_out[part] & e.told
        if not kept.any():
            continue
        errors += float(np.sum(problem.errors(i, residuals[part])[kept] ** 2))
        measured = e.output[kept]
        spreads += float(np.sum((measured - measured.mean()) ** 2))
    return 100.0 * (1.0 - float(np.sqrt(errors / spreads))) if spreads else float("nan")


def probabilities(judged: Sequence[Judged], unexplained: float) -> list[float]:
    """How probable each explanation is, given that one of them or none of the library is true.

    The laws of the library are not the laws of nature, so likelihoods are tempered: by what even the best explanation
    leaves on data it was not fitted to, and so that a difference of `indistinguishable` is worth a factor of seven at
    most. What all the data cannot tell from the first one, which was chosen, or is strained to the end of what is
    physical, is no more probable than that. `unexplained` is the probability of none.
    """
    if not judged:
        return []
    costs = [j.chi2_held_out + j.prior_cost for j in judged]
    least = min(j.chi2_held_out for j in judged)
    temper = max(least / max(judged[0].count, 1), indistinguishable(least) / _WORTH)
    logs = np.array([-c / (2.0 * temper) - 0.5 * j.fitted.unknowns for c, j in zip(costs, judged, strict=True)])
    bound = [_no_better(j.fitted, judged[0].fitted) for j in judged]
    logs = np.where(bound, np.minimum(logs, logs[0]), logs)
    weights = np.exp(np.maximum(logs - logs.max(), -700.0))
    shares = (1.0 - unexplained) * weights / weights.sum()
    return [float(share) for share in shares]


def calibrated(said: float) -> float:
    """How often a name that is said to be so likely is right; rises with it."""
    offset, slope = _CALIBRATED
    return round(1.0 / (1.0 + math.exp(-offset) * (1.0 / said - 1.0) ** slope), 3) if said > 0.0 else 0.0


def _no_better(f: Fitted, chosen: Fitted) -> bool:
    """Whether nothing speaks for an explanation against the one that was chosen."""
    return is_strained(f) or abs(f.chi2 - chosen.chi2) < indistinguishable(chosen.chi2)


def indistinguishable(chi2: float) -> float:
    """How far above the least χ² an explanation is as good: chance, and laws that are not exact."""
    return SELDOM_BY_CHANCE**2 + 0.01 * chi2
