"""The corrected model, and how uncertain its values are."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hil.diagnosis.diagnosis import DiagnosisVerdict
from hil.diagnosis.intake.problem import Problem
from hil.diagnosis.search.fitted import Fitted
from hil.identification.preparation.experiment import sample_intervals_s
from hil.physics.compose import effect as installed_effect
from hil.physics.model import Covariance, Model, ModelEffect, Value

# Nothing is known better than the recorder keeps time: 50 ppm of the sample rate (NI 6361, timing accuracy), anywhere
# within (GUM 4.3.7).
_TIME_BASE = 50e-6 / math.sqrt(3.0)


def corrected(problem: Problem, f: Fitted, verdict: DiagnosisVerdict) -> Model:
    """The nominal model with what was fitted beside it."""
    model, stds = problem.model, standard_uncertainties(f)
    values = {
        name: Value(f.parameters.get(name, v.value), v.unit, stds.get((name, ""), v.std))
        for name, v in model.parameters.items()
    }
    found = [
        ModelEffect(
            term.name, term.hook,
            {u.name: Value(float(v), u.unit, stds.get((f"{term.name}.{u.name}", term.hook)))
             for u, v in zip(term.unknowns, own, strict=True)},
        )
        for term, own in f.pairs
        if term.kind == "effect"
    ]  # fmt: skip
    origin = {
        "nominal": dict(model.origin),
        "resolution": model.origin.get("resolution", 0.0),
        "intervals_s": sorted({*model.origin.get("intervals_s", ()), *sample_intervals_s(problem.experiments)}),
        "longest_s": max(model.origin.get("longest_s", 0.0), *(e.duration_s for e in problem.experiments)),
        "diagnosed": [e.name for e in problem.experiments],
        "verdict": verdict,
    }
    return replace(
        model,
        parameters=values,
        effects=_with(model, found),
        covariance=_covariance(f, model),
        origin=origin,
        skeleton=None if f.terms or values != dict(model.parameters) else model.skeleton,
    )


def _with(model: Model, found: Sequence[ModelEffect]) -> tuple[ModelEffect, ...]:
    """The effects of a model and those found; one that it has already keeps its place and what was not estimated."""
    held = {e.key: e for e in model.effects}
    for e in found:
        known = held[e.key].parameters if e.key in held else {}
        held[e.key] = replace(e, parameters={**known, **e.parameters})
    return tuple(held.values())


def standard_uncertainties(f: Fitted) -> dict[tuple[str, str], float | None]:
    """By (name, hook): base parameters by their name, effects' as `effect.parameter`; see `beyond_noise`."""
    if f.estimate is None:
        return {}
    stds = [float(s) if np.isfinite(s) else None for s in f.estimate.std]
    at = len(stds) - f.unknowns
    found = {
        (u.name, ""): beyond_noise(std, float(value))
        for u, value, std in zip(f.estimate.unknowns[:at], f.estimate.values[:at], stds[:at], strict=True)
    }
    for term, values in f.pairs:
        by_law = {p.name: p.by_law for p in installed_effect(term.name).parameters} if term.kind == "effect" else {}
        for u, value in zip(term.unknowns, values, strict=True):
            key = (term.name, "") if term.kind == "parameter" else (f"{term.name}.{u.name}", term.hook)
            found[key] = beyond_noise(stds[at], value, by_law.get(u.name, 0.0))
            at += 1
    return found


def beyond_noise(std: float | None, value: float, by_law: float = 0.0) -> float | None:
    """A standard uncertainty from noise with that of the recorder's time base, and of a law not quite nature's."""
    return None if std is None else math.hypot(std, _TIME_BASE * value, by_law * value)


def _covariance(f: Fitted, nominal: Model) -> Covariance | None:
    """Of the base parameters as refitted; what no sample can tell keeps what the nominal model knew."""
    if f.estimate is None or not np.all(np.isfinite(f.estimate.covariance)):
        return nominal.covariance
    keep = [k for k, u in enumerate(f.estimate.unknowns) if u.name in nominal.parameters]
    known = () if nominal.covariance is None else nominal.covariance.names
    if not set(known) <= {u.name for u in f.estimate.unknowns}:  # base parameters were held
        return nominal.covariance
    names = tuple(f.estimate.unknowns[k].name for k in keep)
    if len(set(names)) < len(names):
        return nominal.covariance
    matrix = f.estimate.covariance[np.ix_(keep, keep)]
    return Covariance(names, tuple(tuple(row) for row in matrix.tolist()))
