"""A law fitted to the times at which nothing else happened (least trimmed squares: Rousseeuw, JASA 79, 1984)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from hil.cores import parallel_map
from hil.diagnosis.events.bursts import block_power, block_size
from hil.diagnosis.intake.problem import Problem
from hil.diagnosis.search.effort import EFFORT
from hil.diagnosis.search.fits import fit
from hil.diagnosis.search.fitted import Fitted
from hil.diagnosis.thresholds import A_GOOD_PART, FEW
from hil.record.recording import Array, Mask

# The best law is fitted again to what it leaves undisturbed, so often.
_ROUNDS = 3


def least_trimmed_squares(problem: Problem, laws: Sequence[Fitted]) -> Fitted | None:
    """Of laws, the best first, the one that explains best what is undisturbed, fitted to that; None without any.

    Fitted to all samples a law bends to what happens beside it, and what happened does not stand out any more.
    """
    distinct: dict[tuple[str, ...], Fitted] = {}
    for f in laws:
        if f.names:
            distinct.setdefault(f.names, f)
    tried = parallel_map(partial(_refitted, problem), list(distinct.values())[:FEW])
    if not tried:
        return None
    best = min(tried, key=lambda f: _misfit_when_quiet(problem, f))
    for _ in range(_ROUNDS):
        best = _refitted(problem, best)
    r = best.residuals
    return replace(best, chi2=float(r @ r), estimate=None)  # of all samples


def _refitted(problem: Problem, f: Fitted) -> Fitted:
    keep = quiet(problem, f.residuals)
    return fit(problem, f, keep=keep, steps=EFFORT.rough, from_here=True)


def _misfit_when_quiet(problem: Problem, f: Fitted) -> float:
    return float(np.mean(f.residuals[quiet(problem, f.residuals)] ** 2))


def quiet(problem: Problem, residuals: Array) -> Mask:
    """Which residuals lie in the quieter blocks of their recording, shape (n,): events take no good part of time."""
    keep = np.zeros(len(residuals), dtype=np.bool_)
    for e, channels in zip(problem.experiments, problem.channel_slices(), strict=True):
        power = np.sum([block_power(e, residuals[part]) for part in channels], axis=0)
        is_quiet = np.repeat(power <= np.quantile(power, 1.0 - A_GOOD_PART), block_size(e))
        for part in channels:
            keep[part.start : part.start + len(is_quiet)] = is_quiet
    return keep
