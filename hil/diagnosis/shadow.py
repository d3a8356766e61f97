"""The criterion of `hil.diagnosis.verdict` beside today's decision, from the fits that its search has made."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from hil.diagnosis.events.event import Events
from hil.diagnosis.happened import Happened
from hil.diagnosis.locate import StageShare
from hil.diagnosis.search.fitted import Fitted
from hil.diagnosis.verdict import Hypothesis, Kind, Question, Weighed, anything, marginal, question, verdict_of, weighed
from hil.diagnosis.yardsticks import LISTED
from hil.signals.colour import colour_factor

_UNKNOWN: frozenset[Kind] = frozenset({"unknown"})


def shadow(found: Happened, nominal_stages: Sequence[StageShare], left_stages: Sequence[StageShare]) -> dict[str, Any]:
    """The verdict by one score, as `diagnosis.json` holds it.

    `nominal_stages`, `left_stages`: what a free curve at each stage explains beside the nominal and the chosen model.
    Events that were taken out of the recordings before are no part of the question; they stand beside every answer.
    """
    choice, problem = found.choice, found.problem
    fits = [there(f) for f in (choice.chosen, *choice.candidates, *choice.descriptions, *choice.pairs)]
    least = min((choice.baseline, *fits), key=lambda f: f.chi2)
    causes = len({t.told for t in choice.terms if t.kind == "effect"})
    colour = colour_factor(least.residuals)
    asked = question(problem.size, choice.baseline.chi2, least.chi2, causes, colour)
    taken_out = [e.told for e in found.events if e is not choice.events]
    ranked = weighed(asked, [h.beside(taken_out) for h in (
        Hypothesis(frozenset({"nothing"}), (), choice.baseline.chi2, 0, 0),
        anything(asked),
        *(_law(f) for f in fits if f.terms),
        *(_events(e) for e in (choice.events, choice.part) if e is not None),
        *_curves(asked, choice.baseline, nominal_stages),
        *(_curves(asked, choice.chosen, left_stages) if choice.chosen.terms else ()),
    )])  # fmt: skip
    return {**as_dict(ranked), "noise_chi2": round(asked.count, 1), "nominal_chi2": round(asked.nominal_chi2, 1),
            "causes": asked.terms}  # fmt: skip


def as_dict(ranked: Sequence[Weighed]) -> dict[str, Any]:
    """The verdict, names with their marginal probabilities, and the table that it comes from."""
    best = ranked[0].hypothesis
    names = [] if verdict_of(best) == "parameter_change" else list(best.names)
    return {
        "verdict": verdict_of(best),
        "names": names,
        "probabilities": [round(marginal(ranked, name), 4) for name in names],
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


def _law(f: Fitted) -> Hypothesis:
    kinds: frozenset[Kind] = frozenset({"effects"} if f.names else {"parameters"})
    names = [t.effect_name(v) or t.name for t, v in zip(f.terms, f.values, strict=True)]
    added = sum(term.kind == "effect" for term in f.terms)
    return Hypothesis(kinds, tuple(dict.fromkeys(names)), f.chi2, f.unknowns, added)


def _events(events: Events) -> Hypothesis:
    return Hypothesis(frozenset({"events"}), (events.name,), events.chi2, events.unknowns, 1)


def _curves(asked: Question, beside: Fitted, stages: Sequence[StageShare]) -> Iterable[Hypothesis]:
    """Something unknown at the stage where a free curve takes most of what a model leaves."""
    law = _law(beside) if beside.terms else None
    for stage in stages[:1]:
        left = beside.chi2 - stage.share * max(beside.chi2 - asked.count, 0.0)
        knots = len(stage.rising) + len(stage.falling)
        kinds: frozenset[Kind] = _UNKNOWN | (law.kinds if law else frozenset())
        yield Hypothesis(kinds, law.names if law else (), left, knots + beside.unknowns, law.causes if law else 0)
