"""The criterion of `hil.diagnosis.verdict` beside today's decision, from the fits that its search has made."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hil.diagnosis.events.event import Events
from hil.diagnosis.happened import Happened
from hil.diagnosis.measures import is_another
from hil.diagnosis.search.fitted import Fitted
from hil.diagnosis.verdict import Hypothesis, Kind, Weighed, anything, marginal, question, verdict_of, weighed
from hil.diagnosis.yardsticks import LISTED
from hil.signals.colour import colour_factor


def shadow(found: Happened) -> dict[str, Any]:
    """The verdict by one score, as `diagnosis.json` holds it.

    Events that were taken out of the recordings before are no part of the question; they stand beside every answer.
    """
    choice, problem = found.choice, found.problem
    fits = [there(f) for f in (choice.chosen, *choice.candidates, *choice.descriptions, *choice.pairs)]
    least = min((choice.baseline, *fits), key=lambda f: f.chi2)
    causes = {t.told: len(t.unknowns) for t in choice.terms if t.kind == "effect"}
    asked = question(problem.size, choice.baseline.chi2, least.chi2, causes, colour_factor(least.residuals))
    taken_out = [e.told for e in found.events if e is not choice.events]
    ranked = weighed(asked, [h.beside(taken_out) for h in (
        Hypothesis(frozenset({"nothing"}), (), choice.baseline.chi2, 0, 0),
        anything(asked),
        *(as_hypothesis(f) for f in fits if f.terms),
        *(_events(e) for e in (choice.events, choice.part) if e is not None),
    )])  # fmt: skip
    return {**as_dict(ranked), "noise_chi2": round(asked.count, 1), "nominal_chi2": round(asked.nominal_chi2, 1),
            "samples": round(asked.samples, 1), "causes": asked.terms}  # fmt: skip


def as_dict(ranked: Sequence[Weighed]) -> dict[str, Any]:
    """The verdict, names with their marginal probabilities, and the table that it comes from."""
    best = ranked[0].hypothesis
    return {
        "verdict": verdict_of(best),
        "names": list(best.names),
        "probabilities": [round(marginal(ranked, name), 4) for name in best.names],
        "hypotheses": [
            {
                "name": w.hypothesis.label, "unknowns": w.hypothesis.unknowns, "chi2": round(w.hypothesis.chi2, 1),
                "causes": w.hypothesis.causes, "evidence": round(w.score, 2), "probability": round(w.probability, 4),
            }
            for w in ranked[:LISTED]
        ],
    }  # fmt: skip


def there(f: Fitted) -> Fitted:
    """An explanation without the effects that have ended at nothing: it leaves the same."""
    return f.only([k for k, (t, v) in enumerate(zip(f.terms, f.values, strict=True)) if not t.is_nothing(v)])


def as_hypothesis(f: Fitted) -> Hypothesis:
    """An explanation; something unknown where it fits only with a shape that its name does not have."""
    added = sum(term.kind == "effect" for term in f.terms)
    if is_another(f):
        return Hypothesis(frozenset({"unknown"}), (), f.chi2, f.unknowns, added)
    kinds: frozenset[Kind] = frozenset({"effects"} if f.names else {"parameters"})
    changed = [t.name for t, v in zip(f.terms, f.values, strict=True) if not t.effect_name(v)]
    return Hypothesis(kinds, tuple(dict.fromkeys(f.names)), f.chi2, f.unknowns, added, tuple(changed))


def _events(events: Events) -> Hypothesis:
    return Hypothesis(frozenset({"events"}), (events.name,), events.chi2, events.unknowns, 1)
