"""The solver-error gate: a diagnosis must never name the error of its own integrator, nor pay for steps that it can
do without.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hil.diagnosis.problem import COARSER, Problem
from hil.diagnosis.thresholds import FAR, NEXT_TO_NOTHING
from hil.identification.uncertainty.evidence import VERY_STRONG
from hil.language.note import Note

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
        "cannot be told from the integrator",
        finer=_FINER[-1], error=error,
    )  # fmt: skip
    return problem, (sizeable,)
