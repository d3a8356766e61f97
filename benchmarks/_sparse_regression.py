"""A peer of the diagnosis: sparse regression (pysindy), with the right terms in its library.

Discrepancy models as Kaheman et al. (2019) and Ebers et al. (2024) find them: what the nominal model leaves of the
output is regressed on candidate terms, as few as possible. The states of a valve are not recorded, so terms written
in y and its derivatives cannot be the right ones. Here a term is what an effect of our library does to the output,
simulated at the best of our starts for it: whatever was concealed, its own response (by our law for it) stands among
the candidates. The slopes in all base parameters are always in the regression and cost nothing.

Two forms. `by_derivative` is SINDy as published: dr/dt of the residual r, by a smoothed finite difference, on 1, r
and the rates of the responses, small coefficients dropped again and again (STLSQ). `by_response` regresses r itself,
which needs no derivative of noisy data, and picks terms one after another (FROLS), which suits candidates that look
alike: the kinder form.

Settings: derivatives after a Savitzky-Golay filter of third order over 25 samples (0.1 s); normalised columns; STLSQ
with pysindy's own ridge and thresholds from 0.01 to 0.6 of the target, FROLS with up to 8 terms; every other 4 s is
held out to choose: the sparsest model within one standard error of the best one is taken, and refitted to all data.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pysindy
from _concealed import Answer, Case
from _information_criterion import best_start, tangent, white_problem
from numpy.typing import NDArray
from scipy.signal import lfilter

from hil.diagnosis.search.terms import all_terms
from hil.identification.preparation.experiment import Experiment
from hil.physics.simulate import ActiveEffect
from hil.record.recording import Array

_STRETCH_S = 4.0
_THRESHOLDS = (0.01, 0.02, 0.04, 0.07, 0.1, 0.15, 0.2, 0.3, 0.45, 0.6)
_MOST_TERMS = 8
_RIDGE = 0.05  # pysindy's own
_REST = 1e-6  # what is left of it in the refit
_BLOCKS = 40  # samples nearby are not independent; stretches are
_SMOOTH = 25
_SLOPE = 1e-3

Mask = NDArray[np.bool_]
Path = Callable[[Array, Array], list[list[int]]]
"""From columns and a target, both normalised, to choices of columns, of more and less terms."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A term of the library: the name it stands for, and what it does to the output of a recording."""

    name: str
    response: Callable[[Experiment], Array]


def candidates(case: Case) -> list[Candidate]:
    """The slope in every base parameter (no name), and the response of every effect at every place it can have."""
    problem, values = white_problem(case), case.nominal.values
    found = [_slope(case, p.name, _SLOPE * p.scale) for p in problem.base]
    basis = tangent(problem, values, [])
    for term in all_terms(problem, problem.nominal_residuals):
        if term.kind == "effect":
            start, _ = best_start(problem, values, [], term, basis)
            added: list[ActiveEffect] = []
            term.apply(start, {}, added)
            found.append(_response(case, term.effect_name(start), tuple(added)))
    return found


def _slope(case: Case, parameter: str, step: float) -> Candidate:
    values = case.nominal.values
    plant = case.nominal.definition

    def response(e: Experiment) -> Array:
        moved = e.respond(plant, values | {parameter: values[parameter] + step})[0]
        slope: Array = (moved - e.respond(plant, values)[0]) / step
        return slope

    return Candidate("", response)


def _response(case: Case, name: str, effects: Sequence[ActiveEffect]) -> Candidate:
    values, plant = case.nominal.values, case.nominal.definition

    def response(e: Experiment) -> Array:
        change: Array = e.respond(plant, values, effects)[0] - e.respond(plant, values)[0]
        return change

    return Candidate(name, response)


def by_response(case: Case) -> Answer:
    terms = candidates(case)
    columns = np.concatenate([_columns(terms, e) for e in case.changed])
    target = np.concatenate([_left(case, e) for e in case.changed])
    names = [term.name for term in terms]
    found = _sparse(columns, target, names, _training(case), _by_frols)

    def predict(e: Experiment) -> Array:
        output: Array = _nominal(case, e) + _columns(terms, e) @ found
        return output

    return _said(names, columns, found, predict)


def by_derivative(case: Case) -> Answer:
    terms = candidates(case)
    names = ["", "", *(term.name for term in terms)]
    differentiate = pysindy.SmoothedFiniteDifference(smoother_kws={"window_length": _SMOOTH, "polyorder": 3})
    rows, targets = [], []
    for e in case.changed:
        r = _left(case, e)
        targets.append(differentiate(r[:, None], e.time_s)[:, 0])
        rows.append(np.column_stack((np.ones(len(r)), r, _rates(terms, e))))
    columns = np.concatenate(rows)
    target, train = np.concatenate(targets), _training(case)
    found = _sparse(columns, target, names, train, _by_stlsq)
    if found[1] > 0.0:  # a residual that feeds on itself predicts nothing: nobody would accept that model
        without = np.delete(np.arange(len(names)), 1)
        found = np.zeros(len(names))
        found[without] = _sparse(columns[:, without], target, [names[k] for k in without], train, _by_stlsq)

    def predict(e: Experiment) -> Array:
        drive = found[0] + _rates(terms, e) @ found[2:]
        output: Array = _nominal(case, e) + _integrated(found[1], drive, e.drive.interval_s)
        return output

    return _said(names, columns, found, predict)


def _nominal(case: Case, e: Experiment) -> Array:
    output: Array = e.respond(case.nominal.definition, case.nominal.values)[0]
    return output


def _left(case: Case, e: Experiment) -> Array:
    return e.output - _nominal(case, e)


def _columns(terms: Sequence[Candidate], e: Experiment) -> Array:
    return np.column_stack([term.response(e) for term in terms])


def _rates(terms: Sequence[Candidate], e: Experiment) -> Array:
    rates: Array = np.gradient(_columns(terms, e), e.drive.interval_s, axis=0)
    return rates


def _integrated(feedback: float, drive: Array, step_s: float) -> Array:
    """r of dr/dt = feedback·r + drive from r = 0, by the trapezoidal rule."""
    half = 0.5 * step_s
    result: Array = lfilter((half, half), (1.0 - half * feedback, -1.0 - half * feedback), drive)
    return result


def _training(case: Case) -> Mask:
    return np.concatenate([(e.time_s // _STRETCH_S).astype(int) % 2 == 0 for e in case.changed])


def _sparse(columns: Array, target: Array, names: Sequence[str], train: Mask, path: Path) -> Array:
    """Coefficients of the sparsest model within a standard error of the best on the half held out.

    What has no name is in all models but the empty one.
    """
    always = [k for k, name in enumerate(names) if not name]
    scaled = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    own, free = _beyond(scaled[train], target[train], always)
    supports = [[], always, *([*always, *(free[k] for k in chosen)] for chosen in path(*own))]
    errors = [
        (target[~train] - scaled[~train] @ _regressed(scaled[train], target[train], support)) ** 2
        for support in supports
    ]
    means = np.array([error.mean() for error in errors])
    best = int(np.argmin(means))
    blocks = [block.mean() for block in np.array_split(errors[best], _BLOCKS)]
    allowed = means[best] + np.std(blocks) / np.sqrt(_BLOCKS)
    sparsest = min((s for s, mean in zip(supports, means, strict=True) if mean <= allowed), key=len)
    found: Array = _regressed(columns, target, sparsest)
    return found


def _beyond(columns: Array, target: Array, always: list[int]) -> tuple[tuple[Array, Array], list[int]]:
    """Columns and target beyond what the terms that are always there explain; the columns that are left."""
    basis, sizes, _ = np.linalg.svd(columns[:, always], full_matrices=False)
    basis = basis[:, sizes > 1e-9 * sizes[0]]
    target = target - basis @ (basis.T @ target)
    kept: list[Array] = []
    free: list[int] = []
    for k in sorted(set(range(columns.shape[1])) - set(always)):
        left = columns[:, k] - basis @ (basis.T @ columns[:, k])
        size = float(np.linalg.norm(left))
        if size > 1e-6 and all(abs(left @ other) < (1.0 - 1e-6) * size for other in kept):  # news, and no double
            kept.append(left / size)
            free.append(k)
    return (np.column_stack(kept), target / np.linalg.norm(target)), free


def _regressed(columns: Array, target: Array, support: list[int]) -> Array:
    found = np.zeros(columns.shape[1])
    sizes = np.maximum(np.linalg.norm(columns[:, support], axis=0), 1e-300)
    scaled = columns[:, support] / sizes
    information = scaled.T @ scaled + _REST * np.eye(len(support))
    found[support] = np.linalg.solve(information, scaled.T @ target) / sizes
    return found


def _by_stlsq(columns: Array, target: Array) -> list[list[int]]:
    """The terms that survive each threshold."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that a threshold drops every term is an answer
        fits = [pysindy.STLSQ(threshold, alpha=_RIDGE).fit(columns, target[:, None]) for threshold in _THRESHOLDS]
    return [np.flatnonzero(fit.coef_[0]).tolist() for fit in fits]


def _by_frols(columns: Array, target: Array) -> list[list[int]]:
    """The first term, the first two, and so on."""
    fit = pysindy.FROLS(max_iter=min(_MOST_TERMS, columns.shape[1] - 1), alpha=1e-9).fit(columns, target[:, None])
    return [np.flatnonzero(coefficients[0]).tolist() for coefficients in fit.history_[1:]]


def _said(names: Sequence[str], columns: Array, found: Array, predict: Callable[[Experiment], Array]) -> Answer:
    """The names that are left, the one that moves the most first."""
    order = np.argsort(-np.linalg.norm(columns * found, axis=0))
    named = tuple(dict.fromkeys(names[k] for k in order if names[k] and found[k] != 0.0))
    verdict = "explained" if named else "parameter_change" if np.any(found) else "consistent"
    return Answer(verdict, named, predict)
