"""The one score beside today's decision, from the fits that its search has made."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hil.diagnosis.events.event import Events
from hil.diagnosis.happened import Happened
from hil.diagnosis.measures import CONSISTENT_EXCESS, is_another
from hil.diagnosis.score import Hypothesis, Noise, Table, table
from hil.diagnosis.search.fitted import Fitted
from hil.diagnosis.yardsticks import LISTED
from hil.signals.colour import colour_factor


def shadow(found: Happened) -> dict[str, Any]:
    """The verdict by the score, as `diagnosis.json` holds it.

    Events that were taken out of the recordings before are no part of the question; they stand beside every answer. A
    law whose shape tells it from another one, and has ended there, is none.
    """
    choice, problem = found.choice, found.problem
    fits = [there(f) for f in (choice.chosen, *choice.candidates, *choice.descriptions, *choice.pairs)]
    least = min((choice.baseline, *fits), key=lambda f: f.chi2)
    names = {t.told for t in choice.terms if t.kind == "effect"}
    samples = problem.size / colour_factor(least.residuals)
    noise = Noise(problem.size, 1.0, 1.0 + CONSISTENT_EXCESS, samples, len(names))
    taken_out = [e for e in found.events if e is not choice.events]
    hypotheses = [
        Hypothesis((), choice.baseline.chi2),
        *(as_hypothesis(f) for f in fits if f.terms and not is_another(f)),
        *(Hypothesis((e.name,), e.chi2, 1, e.unknowns) for e in (choice.events, choice.part) if e is not None),
    ]
    return as_dict(table(noise, [beside(h, taken_out) for h in hypotheses]))


def as_dict(printed: Table) -> dict[str, Any]:
    """The verdict, names with their probabilities, and the table that it comes from."""
    names = printed.first.hypothesis.names
    return {
        "verdict": printed.first.verdict, "names": list(names),
        "probabilities": [round(printed.chance(name), 4) for name in names], **printed.as_dict(LISTED),
    }  # fmt: skip


def there(f: Fitted) -> Fitted:
    """An explanation without the effects that have ended at nothing: it leaves the same."""
    return f.only([k for k, (t, v) in enumerate(zip(f.terms, f.values, strict=True)) if not t.is_nothing(v)])


def as_hypothesis(f: Fitted) -> Hypothesis:
    """An explanation; a freed parameter is a cause too."""
    changed = tuple(t.name for t, v in zip(f.terms, f.values, strict=True) if not t.effect_name(v))
    names = tuple(dict.fromkeys(f.names))
    return Hypothesis(names, f.chi2, len(names) + len(changed), f.unknowns, changed)


def beside(h: Hypothesis, events: Sequence[Events]) -> Hypothesis:
    """The same where these events, with what each shows as, were taken out of the recordings before."""
    hidden = {name for e in events for name in e.told}
    names = (*dict.fromkeys(e.name for e in events), *(name for name in h.names if name not in hidden))
    return Hypothesis(names, h.chi2, h.causes, h.unknowns, h.changed)
