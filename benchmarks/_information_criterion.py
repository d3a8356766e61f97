"""A peer of the diagnosis: every effect of the library fitted to all recordings, the lowest BIC taken for the truth.

n·ln(RSS/n) + k·ln n, white noise of unknown size, all data pooled: nothing is held out, nothing is whitened, and
nobody asks whether the winner explains the data. Its settings are kind: it gets our library, our starts and our
optimiser, and all base parameters are fitted with every effect. Starts are ranked with the base parameters adapting
linearly, the 12 best effects are fitted a little, the 3 best of those to the end. Beside the effects it may choose
the nominal model as it is, one changed base parameter, or all of them. A second effect is added while that lowers the
BIC further.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from _concealed import Answer, Case

from hil.cores import parallel_map
from hil.diagnosis.intake.problem import Problem, pose
from hil.diagnosis.search.terms import Term, all_terms
from hil.identification.grey_box.estimate import Unknown, estimate
from hil.identification.grey_box.free import moved, unknown_of
from hil.identification.preparation.experiment import Experiment
from hil.physics.model import Noise
from hil.physics.simulate import ActiveEffect
from hil.record.recording import Array

_LOOKED_AT, _FIRST_LOOK, _SEEN_TO_THE_END, _TO_THE_END = 12, 6, 3, 30
_MOST_EFFECTS = 2
_MOVED = 3.0  # standard uncertainties from the nominal value, as for the diagnosis


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """Effects and base parameters with values, and the BIC of it."""

    terms: tuple[Term, ...]
    values: tuple[tuple[float, ...], ...]
    base: dict[str, float]
    bic: float

    @property
    def effects(self) -> list[ActiveEffect]:
        found: list[ActiveEffect] = []
        for term, own in zip(self.terms, self.values, strict=True):
            term.apply(own, {}, found)
        return found


def white_problem(case: Case) -> Problem:
    """The case with white noise of one size."""
    problem = pose(case.nominal, case.changed)
    std = float(np.median([noise.std for noise in problem.noises]))
    return replace(problem, noises=(Noise(std),) * len(problem.experiments))


def answer(case: Case) -> Answer:
    problem = white_problem(case)
    nominal = case.nominal.values
    names = tuple(p.name for p in problem.base)
    nothing = Hypothesis((), (), dict(nominal), _bic(problem.nominal_residuals, 0))
    refitted = _fitted(problem, names, nothing, _TO_THE_END)
    terms = all_terms(problem, problem.residuals(refitted.base, []))
    one_changed = [_fitted(problem, (t.name,), nothing, _TO_THE_END) for t in terms if t.kind == "parameter"]
    best = min([nothing, refitted, *one_changed], key=lambda h: h.bic)
    effects = [t for t in terms if t.kind == "effect"]
    around = refitted
    for _ in range(_MOST_EFFECTS):
        grown = _with_one_more(problem, names, around, effects)
        if grown.bic >= best.bic:
            break
        best = around = grown
    return _said(case, problem, best, terms)


def _said(case: Case, problem: Problem, best: Hypothesis, terms: Sequence[Term]) -> Answer:
    """The effects, then what the base parameters that changed with them are known as (more dead time *is* one)."""
    nominal = case.nominal.values
    least = {p.name: _MOVED * std for p, std in zip(problem.base, problem.prior.std, strict=True)}
    moved = [t for t in terms if t.kind == "parameter" and best.base[t.name] != nominal[t.name]]
    far = [t for t in moved if abs(best.base[t.name] - nominal[t.name]) > least[t.name]]
    known = [t.effect_name([best.base[t.name]]) for t in far] if best.terms or len(moved) == 1 else []
    effects = [t.effect_name(own) for t, own in zip(best.terms, best.values, strict=True)]
    named = tuple(dict.fromkeys(name for name in (*effects, *known) if name))

    def predict(e: Experiment) -> Array:
        output: Array = e.respond(case.nominal.definition, best.base, best.effects)[0]
        return output

    return Answer("explained" if named else "parameter_change" if moved else "consistent", named, predict)


def _with_one_more(problem: Problem, names: Sequence[str], at: Hypothesis, effects: Sequence[Term]) -> Hypothesis:
    """The best hypothesis with one effect more, each from its best start; the best few are fitted to the end."""
    taken = {(t.name, t.hook) for t in at.terms}
    basis = tangent(problem, at.base, at.effects)
    started = []
    for term in (t for t in effects if (t.name, t.hook) not in taken):
        start, left = best_start(problem, at.base, at.effects, term, basis)
        started.append((left, Hypothesis((*at.terms, term), (*at.values, start), at.base, np.inf)))
    hopeful = [h for _, h in sorted(started, key=lambda pair: pair[0])[:_LOOKED_AT]]
    looked = sorted((_fitted(problem, names, h, _FIRST_LOOK) for h in hopeful), key=lambda h: h.bic)
    return min((_fitted(problem, names, h, _TO_THE_END) for h in looked[:_SEEN_TO_THE_END]), key=lambda h: h.bic)


def tangent(problem: Problem, base: dict[str, float], effects: Sequence[ActiveEffect]) -> Array:
    """An orthonormal basis of what base parameters can do to the residuals, to first order."""
    slopes = problem.base_jacobian(base, effects, problem.residuals(base, effects))
    scaled = slopes / np.maximum(np.linalg.norm(slopes, axis=0), 1e-300)
    basis, sizes, _ = np.linalg.svd(scaled, full_matrices=False)
    independent: Array = basis[:, sizes > 1e-9 * sizes[0]]
    return independent


def best_start(
    problem: Problem, base: dict[str, float], effects: Sequence[ActiveEffect], term: Term, basis: Array
) -> tuple[tuple[float, ...], float]:
    """The start of an effect that fits best while base parameters adapt linearly, and the misfit that it leaves."""

    def moved(start: tuple[float, ...]) -> Array:
        added = list(effects)
        term.apply(start, {}, added)
        return problem.residuals(base, added)

    found: list[Array] = parallel_map(moved, term.starts)
    left = np.nan_to_num([f @ f - np.sum((basis.T @ f) ** 2) for f in found], nan=np.inf)
    k = int(np.argmin(left))
    return term.starts[k], float(left[k])


def _fitted(problem: Problem, names: Sequence[str], start: Hypothesis, evaluations: int) -> Hypothesis:
    """The base parameters of these names, and the effects, fitted together."""
    base = [p for p in problem.base if p.name in names]
    at = moved(problem.model, start.base)
    unknowns = [unknown_of(at, p.name) for p in base]
    for term, own in zip(start.terms, start.values, strict=True):
        unknowns += [Unknown(u.name, u.unit, v, u.low, u.high, u.scale)
                     for u, v in zip(term.unknowns, own, strict=True)]  # fmt: skip

    def split(values: Array) -> Hypothesis:
        own, at = [], len(base)
        for term in start.terms:
            own.append(tuple(values[at : at + len(term.unknowns)].tolist()))
            at += len(term.unknowns)
        moved = start.base | dict(zip((p.name for p in base), values.tolist(), strict=False))
        return Hypothesis(start.terms, tuple(own), moved, np.inf)

    def residuals(values: Array) -> Array:
        h = split(values)
        return problem.residuals(h.base, h.effects)

    found = estimate(residuals, unknowns, max_evaluations=evaluations, tolerance=1e-5)
    return replace(split(found.values), bic=_bic(found.residuals, len(unknowns)))


def _bic(residuals: Array, unknowns: int) -> float:
    n = len(residuals)
    return float(n * np.log(residuals @ residuals / n) + (unknowns + 1) * np.log(n))
