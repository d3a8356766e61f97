"""What the data could have shown: for each effect that is not named, an upper limit on its size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.cores import parallel_map
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.intake.problem import Problem
from hil.diagnosis.search.fitted import Fitted
from hil.diagnosis.search.linearization import Linearization, adapted_residuals
from hil.diagnosis.search.terms import Term
from hil.diagnosis.thresholds import CERTAIN
from hil.record.recording import Array
from hil.signals.interval import ONE_SIDED


@dataclass(frozen=True, slots=True)
class Limit:
    """The upper limit (95 %) on the first parameter of an effect that was not found.

    What is itself a limit (saturation, a rate) does nothing at infinity: `upper` is then the typical value where that
    would have been seen, infinity where not. `visible`: whether an effect of typical size would stand out for
    certain; if not, nothing can be said of it. Sizes are distances from the value at which the effect does nothing.
    Where what is accepted leaves more than noise, an effect may be as large as makes all that is left. Of an effect
    that the nominal model has, `about` is its size there, and sizes are changes of it.
    """

    effect: str
    stage: str
    parameter: str
    unit: str
    upper: float
    typical: float
    visible: bool
    about: float = 0.0

    @property
    def is_place(self) -> bool:
        """Whether it belongs to an effect that is itself a limit: `upper` is where it would have been seen."""
        return self.upper == self.typical


def limits(linear: Linearization, terms: Sequence[Term], twins: Sequence[Fitted] = ()) -> tuple[Limit, ...]:
    """Upper limits for effects beside what is accepted; one for each effect, at its most visible linear.

    `twins`: explanations that may be so instead: what is accepted gives way to them, and their effects may be as large
    as they are there.
    """
    found: dict[str, Limit] = {}
    asked = [term for term in terms if term.kind == "effect"]
    without = linear.residuals_without
    for term, limit in zip(asked, parallel_map(lambda term: _limit(linear, term, without), asked), strict=True):
        known = found.get(term.reported_name)
        if known is None or (limit.visible, -limit.upper) > (known.visible, -known.upper):
            found[term.reported_name] = limit
    for f in twins:
        for term, values in f.pairs:
            if term.kind == "effect" and term.reported_name in found:
                found[term.reported_name] = _as_large_as(found[term.reported_name], term, values, _std(f, term))
    return tuple(found[name] for name in sorted(found))


def _std(f: Fitted, term: Term) -> float:
    """Standard uncertainty of the first unknown of a term; 0 where an explanation was not fitted to its end."""
    return 0.0 if f.estimate is None else float(f.estimate.std[f.estimate_index(term)])


def _as_large_as(limit: Limit, term: Term, values: Sequence[float], std: float) -> Limit:
    """A limit that does not exclude what an explanation says: of a limit itself, elsewhere, or where it is not told, it
    excludes nothing.
    """
    if not np.isfinite(term.null + std) or term.unknowns[0].name != limit.parameter or term.stage != limit.stage:
        return replace(limit, upper=float("inf"), visible=False)
    return replace(limit, upper=max(limit.upper, abs(values[0] - term.null) + ONE_SIDED * std))


def _limit(linear: Linearization, term: Term, without: Array) -> Limit:
    """From one small step in the effect's strength, all else adapting."""
    first, hidden = term.unknowns[0], _left(linear.problem, without)
    if not np.isfinite(term.null):
        change = adapted_residuals(linear, term, [u.start for u in term.unknowns]) - without
        seen = bool(np.linalg.norm(change) > max(CERTAIN, hidden))
        upper = first.start if seen else float("inf")
        return Limit(term.reported_name, term.stage, first.name, first.unit, upper, first.start, seen)
    start = min(term.starts, key=lambda s: abs(s[0] - term.null))
    about = term.null if term.held else 0.0
    size, typical = abs(start[0] - term.null), abs(about or first.start - term.null)
    step = adapted_residuals(linear, term, start) - without
    power = float(step @ step)
    if power < 1e-12 or size == 0.0:
        return Limit(term.reported_name, term.stage, first.name, first.unit, float("inf"), typical, False, about)
    strength = -float(step @ without) / power
    likely = abs(strength) if term.held else max(strength, 0.0)  # what is there already may have grown or shrunk
    upper = max(likely + ONE_SIDED / np.sqrt(power), hidden / np.sqrt(power)) * size
    visible = np.sqrt(power) * typical / size > max(CERTAIN, hidden)
    return Limit(term.reported_name, term.stage, first.name, first.unit, float(upper), typical, bool(visible), about)


def _left(problem: Problem, without: Array) -> float:
    """What is left beyond the noise, as a length of residuals; nothing where that is no more than noise."""
    beyond = problem.excess(float(without @ without))
    return float(np.sqrt(beyond * problem.size)) if beyond >= CRITERIA.scale else 0.0
