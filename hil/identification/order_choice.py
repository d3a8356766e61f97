"""How many poles and zeros, and a dead time? Chosen by evidence, simplest first where the data cannot tell."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from hil.identification.dead_time import with_other_forms
from hil.identification.evidence import VERY_STRONG, bic, bic_of_known_noise, simplest_good
from hil.identification.frequency_response import FrequencyResponse
from hil.identification.held_out import held_out
from hil.identification.linear_evidence import unresolved
from hil.identification.rational import Form
from hil.identification.right_half_plane import with_alternative
from hil.identification.transfer_function import Candidate, TransferFunctionFit, Weights, check_form, fit_form
from hil.language.note import Note

_MOST_POLES = 5
_MISFIT_NOTE = 2.0


def fit_transfer_function(
    response: FrequencyResponse,
    *,
    poles: int | None = None,
    zeros: int | None = None,
    dead_time: bool | float | None = None,
    stable: bool = True,
    minimum_phase: bool = False,
    dc_gain: float | None = None,
    weights: Weights | None = None,
) -> TransferFunctionFit:
    """Fit a transfer function; what is None is chosen by evidence.

    The Bayesian criterion ranks the forms; it counts a χ² in units of what the best form leaves, so that a
    nonlinear valve with little noise does not buy poles. Among those that it does not rule out, the fewest
    unknowns win whose error on held-out lines is within one standard error of the least. A form that states what its
    lines say nothing of (`linear_evidence.unresolved`) is chosen only where every form does.

    Args:
        response: the lines.
        poles: 1…5, None to choose.
        zeros: 0…poles, None to choose among fewer zeros than poles.
        dead_time: True to estimate, False for none, a number of seconds to fix, None to choose whether.
        stable: keep poles out of the right half plane.
        minimum_phase: keep zeros out of it.
        dc_gain: gain at rest, if known.
        weights: see `fit_form`.

    Raises:
        InputError: fewer lines than the smallest form has unknowns, or an impossible form.
    """
    forms = _forms(response, poles, zeros, dead_time, Form(1, 0, False, 0.0, stable, minimum_phase, dc_gain))
    fits = [fit_form(response, form, weights) for form in forms]
    if len(fits) == 1:
        return with_alternative(_noted(fits[0]), response)
    chosen, candidates = _choose(response, fits)
    chosen = with_other_forms(chosen, fits, _bic(fits))
    return replace(with_alternative(_noted(chosen), response), candidates=candidates)


def _forms(
    response: FrequencyResponse, poles: int | None, zeros: int | None, dead_time: bool | float | None, base: Form
) -> list[Form]:
    delays = [False, True] if dead_time is None else [dead_time]
    counts = range(1, _MOST_POLES + 1) if poles is None else [poles]
    made = []
    for n in counts:
        for m in range(n) if zeros is None else [zeros]:
            for delay in delays:
                free = delay is True
                fixed = float(delay) if not isinstance(delay, bool) else 0.0
                made.append(replace(base, poles=n, zeros=m, dead_time=free, dead_time_s=fixed))
    possible = [form for form in made if form.zeros <= form.poles and form.unknowns < 2 * len(response)]
    if len(made) == 1 or not possible:
        check_form(response, made[0])
    return possible


def _choose(
    response: FrequencyResponse, fits: list[TransferFunctionFit]
) -> tuple[TransferFunctionFit, tuple[Candidate, ...]]:
    criteria = _bic(fits)
    sound = [i for i, fit in enumerate(fits) if not unresolved(fit)] or list(range(len(fits)))
    first = min(sound, key=lambda i: criteria[i])
    errors = {i: held_out(response, fits[i]) for i in sound if criteria[i] <= criteria[first] + VERY_STRONG}
    means = {i: float(np.mean(e)) if e.size else math.nan for i, e in errors.items()}
    unit = float(np.mean(fits[first].residuals ** 2)) * 2.0 or 1.0
    candidates = sorted(
        (
            Candidate(fit.form, criterion, fit.fit_percent, means.get(i, math.nan) / unit)
            for i, (fit, criterion) in enumerate(zip(fits, criteria, strict=True))
        ),
        key=lambda candidate: candidate.bic,
    )
    judged = [i for i, mean in means.items() if math.isfinite(mean)]
    if not judged:
        return fits[first], tuple(candidates)
    complexity = [(fits[i].form.unknowns, len(fits[i].model.right_half_plane_zeros), criteria[i]) for i in judged]
    return fits[judged[simplest_good([errors[i] for i in judged], complexity)]], tuple(candidates)


def _bic(fits: list[TransferFunctionFit]) -> list[float]:
    count = len(fits[0].residuals)
    sums = [float(fit.residuals @ fit.residuals) for fit in fits]
    if fits[0].weights == "covariance":
        spread = max(1.0, min(fit.misfit for fit in fits))
        return [bic_of_known_noise(s / spread, count, fit.form.unknowns) for s, fit in zip(sums, fits, strict=True)]
    return [bic(s / count, count, fit.form.unknowns) for s, fit in zip(sums, fits, strict=True)]


def _noted(fit: TransferFunctionFit) -> TransferFunctionFit:
    notes = list(fit.notes)
    if fit.misfit > _MISFIT_NOTE:
        notes.append(Note(
            "χ² is {misfit:.3g} per degree of freedom: a linear model of this form misses the lines by more than their "
            "noise; intervals are widened accordingly",
            misfit=fit.misfit,
        ))  # fmt: skip
    if not fit.converged:
        notes.append(Note("the optimiser stopped before its tolerance"))
    if not fit.model.is_stable:
        notes.append(Note("unstable: a pole lies in the right half plane"))
    return replace(fit, notes=tuple(notes))
