"""The solver-error gate: a diagnosis must never name the error of its own integrator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hil.diagnose.problem import Problem

# A finer step may change the simulation by this share of the noise before the step counts as too coarse.
_HARMLESS = 0.1
_FINER = (4.0, 16.0)


def settled(problem: Problem) -> tuple[Problem, tuple[str, ...]]:
    """The problem with sub-steps so fine that finer ones change nothing, and what had to be done about it."""
    coarse = problem.nominal_residuals
    for finer in _FINER:
        change = problem.residuals(problem.model.values, problem.model.active_effects, factor=finer) - coarse
        error = float(np.sqrt(np.mean(change**2)))
        if error <= _HARMLESS:
            return problem, ()
        problem = replace(problem, factor=finer)
        coarse = problem.nominal_residuals
    text = f"with steps {_FINER[-1]:g} times finer the simulation still changes by {error:.2g} times the noise"
    return problem, (f"{text}; small effects cannot be told from the integrator",)
