"""How many poles and zeros, and a dead time? Chosen by evidence, simplest first where the data cannot tell."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import compress

import numpy as np

from hil.identification.frequency.criteria import CRITERIA, EFFORT
from hil.identification.frequency.dead_time import with_disagreement, with_other_forms
from hil.identification.frequency.frequency_response import FrequencyResponse, joined
from hil.identification.frequency.held_out import held_out
from hil.identification.frequency.linear_evidence import unresolved
from hil.identification.frequency.rational import Form
from hil.identification.frequency.right_half_plane import with_alternative
from hil.identification.frequency.transfer_function import Candidate, TransferFunctionFit, Weights, check_form, fit_form
from hil.identification.uncertainty.evidence import VERY_STRONG, bic_of_known_noise, simplest_good
from hil.language.note import Note
from hil.signals.information_criterion import bic
from hil.signals.interval import COVERED


def fit_transfer_function(
    response: FrequencyResponse,
    *,
    poles: int | None = None,
    zeros: int | None = None,
    dead_time: bool | float | None = None,
    stable: bool = True,
    minimum_phase: bool = False,
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
        weights: see `fit_form`.

    Raises:
        InputError: fewer lines than the smallest form has unknowns, or an impossible form.
    """
    base = Form(1, 0, False, 0.0, stable, minimum_phase)
    asked = _forms(poles, zeros, dead_time, base)
    forms = _possible(asked, response)
    if len(asked) == 1 or not forms:
        check_form(response, asked[0])
    return _fitted([response], forms, weights)[0]


def fit_together(
    responses: Sequence[FrequencyResponse],
    *,
    poles: int | None = None,
    zeros: int | None = None,
    dead_time: bool | None = None,
) -> tuple[TransferFunctionFit | None, ...]:
    """Fit a transfer function to each response of one plant, all in one form; what is None is chosen by evidence.

    The form is the one that all lines above their noise ask for together, each response over its gain at the first
    line, each line with the same relative error. What moves with amplitude and side is noise there: a nonlinear valve
    does not buy poles and zeros by it. Parameters and their uncertainty are those of each response.

    Args:
        responses: of one plant, at several amplitudes, biases or sides.
        poles: 1…5, None to choose.
        zeros: None to choose among fewer zeros than poles.
        dead_time: None to choose whether.

    Returns:
        One fit for each; None of a response with too few lines above noise for a form that the longest can have.
    """
    forms = _possible(_forms(poles, zeros, dead_time, Form(1, 0)), max(responses, key=len))
    clear = [one.select(~(COVERED * one.gain_std >= np.abs(one.response))) for one in responses]
    able = [bool(forms) and _possible(forms, one) == forms for one in clear]
    fits = iter(_fitted(list(compress(responses, able)), forms, None, list(compress(clear, able))) if any(able) else [])
    return tuple(next(fits) if one else None for one in able)


def _forms(poles: int | None, zeros: int | None, dead_time: bool | float | None, base: Form) -> list[Form]:
    delays = [False, True] if dead_time is None else [dead_time]
    counts = range(1, EFFORT.poles + 1) if poles is None else [poles]
    late = [(delay is True, 0.0 if isinstance(delay, bool) else float(delay)) for delay in delays]
    return [
        replace(base, poles=n, zeros=m, dead_time=free, dead_time_s=fixed_s)
        for n in counts
        for m in (range(n) if zeros is None else [zeros])
        for free, fixed_s in late
    ]


def _possible(forms: Sequence[Form], response: FrequencyResponse) -> list[Form]:
    return [form for form in forms if form.zeros <= form.poles and form.unknowns < 2 * len(response)]


def _fitted(
    responses: Sequence[FrequencyResponse],
    forms: Sequence[Form],
    weights: Weights | None,
    clear: Sequence[FrequencyResponse] = (),
) -> list[TransferFunctionFit]:
    """Fits in one form, of several responses by their `clear` lines."""
    each = [[fit_form(one, form, weights) for form in forms] for one in responses]
    lines, together = responses[0], each[0]
    if len(responses) > 1 and len(forms) > 1:
        lines = joined([one.scaled(1.0 / abs(one.response[0])) for one in clear])
        together = [fit_form(lines, form, "relative") for form in forms]
    k, candidates = _choose(lines, together, each) if len(forms) > 1 else (0, ())
    criteria = _bic(together)
    fits = with_disagreement([with_other_forms(own[k], own, criteria) for own in each])
    return [
        replace(with_alternative(_noted(fit, _refuted(k, own)), one), candidates=candidates)
        for fit, own, one in zip(fits, each, responses, strict=True)
    ]


def _refuted(k: int, fits: Sequence[TransferFunctionFit]) -> Iterator[Note]:
    """Where lines alone have very strong evidence for another form that they bear out."""
    criteria = _bic(fits)
    best = min(range(len(fits)), key=lambda i: (bool(unresolved(fits[i])), criteria[i]))
    if criteria[k] > criteria[best] + VERY_STRONG:
        form = fits[best].form
        yield Note(
            "fit {fit:.1f} % in the form that all responses have; these lines alone ask for another: poles {poles}, "
            "zeros {zeros}, {late}, fit {own:.1f} %",
            fit=fits[k].fit_percent, poles=form.poles, zeros=form.zeros,
            late=Note("a dead time") if form.dead_time else Note("no dead time"), own=fits[best].fit_percent,
        )  # fmt: skip


def _choose(
    lines: FrequencyResponse, fits: list[TransferFunctionFit], each: Sequence[list[TransferFunctionFit]]
) -> tuple[int, tuple[Candidate, ...]]:
    """Which of the forms of `fits`, which are to all lines; `each` are those to the lines of one response."""
    criteria = _bic(fits)
    sound = [i for i in range(len(fits)) if any(not unresolved(own[i]) for own in each)] or list(range(len(fits)))
    first = min(sound, key=lambda i: criteria[i])
    errors = {i: held_out(lines, fits[i]) for i in sound if criteria[i] <= criteria[first] + VERY_STRONG}
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
        return first, tuple(candidates)
    complexity = [(fits[i].form.unknowns, len(fits[i].model.right_half_plane_zeros), criteria[i]) for i in judged]
    return judged[simplest_good([errors[i] for i in judged], complexity)], tuple(candidates)


def _bic(fits: Sequence[TransferFunctionFit]) -> list[float]:
    count = len(fits[0].residuals)
    sums = [float(fit.residuals @ fit.residuals) for fit in fits]
    if fits[0].weights == "covariance":
        spread = max(1.0, min(fit.misfit for fit in fits))
        return [bic_of_known_noise(s / spread, count, fit.form.unknowns) for s, fit in zip(sums, fits, strict=True)]
    return [bic(s / count, count, fit.form.unknowns) for s, fit in zip(sums, fits, strict=True)]


def _noted(fit: TransferFunctionFit, more: Iterable[Note] = ()) -> TransferFunctionFit:
    notes = [*fit.notes, *more]
    if fit.misfit > CRITERIA.misfit:
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
