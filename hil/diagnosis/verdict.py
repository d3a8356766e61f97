"""One score for hypotheses of one kind: nothing, changed parameters, effects, events, unknown, and sets of them.

Schwarz's criterion of a fit whose residuals have an unknown variance, for laws of a library are not those of nature:

    S = n·ln(max(χ², χ₀²)/χ₀²) + k·ln n − 2·ln(prior)

χ₀² is what noise alone leaves, n how many independent samples the residuals are worth by the colour of what the best
explanation leaves, k the number of unknowns. A hypothesis weighs exp(−S/2).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from hil.diagnosis.diagnosis import Verdict
from hil.diagnosis.measures import CONSISTENT_EXCESS, NEARLY_ALL
from hil.identification.evidence import bic, odds

Kind = Literal["nothing", "parameters", "effects", "events", "unknown"]


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """What may be so.

    Attributes:
        kinds: what it says; several where it is a set.
        names: of effects and events that it says are there. `changed`: names of parameters.
        chi2: sum of squared whitened residuals. `unknowns`: how many numbers were fitted.
        causes: how many causes it brings that the nominal model lacks.
    """

    kinds: frozenset[Kind]
    names: tuple[str, ...]
    chi2: float
    unknowns: int
    causes: int
    changed: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """As a table says it."""
        extra = ("something unknown",) if "unknown" in self.kinds else ()
        return " + ".join((*self.names, *self.changed, *extra)) or "nothing"

    def beside(self, events: Sequence[tuple[str, str]]) -> Hypothesis:
        """The same where these events, with what each shows as, were taken out of the recordings before."""
        if not events:
            return self
        told = {name for each in events for name in each}
        names = (*dict.fromkeys(name for name, _ in events), *(name for name in self.names if name not in told))
        return replace(self, kinds=(self.kinds - {"nothing"}) | {"events"}, names=names)


@dataclass(frozen=True, slots=True)
class Weighed:
    """A hypothesis with its score and its probability among all that were weighed."""

    hypothesis: Hypothesis
    score: float
    probability: float


@dataclass(frozen=True, slots=True)
class Question:
    """What scores need of the data.

    Attributes:
        count: χ² that noise alone leaves. `nominal_chi2`: of the unit as it was. `terms`: number of causes looked for.
        samples: how many independent ones the residuals are worth. `unknowns`: the most that a cause has.
    """

    count: float
    nominal_chi2: float
    terms: int
    samples: float
    unknowns: int


def question(
    samples: int, nominal_chi2: float, least_chi2: float, causes: Mapping[str, int], colour: float = 1.0
) -> Question:
    """The question of so many residuals, of which the best explanation leaves `least_chi2`.

    Where that is no more than what is consistent leaves, it is the noise. `causes`: that were looked for, each with its
    number of unknowns. `colour`: so many neighbouring samples of what is left say the same.
    """
    count = float(np.clip(least_chi2, samples, (1.0 + CONSISTENT_EXCESS) * samples))
    return Question(count, nominal_chi2, len(causes), count / colour, max(causes.values(), default=1))


def score(asked: Question, h: Hypothesis) -> float:
    """S of a hypothesis; the least is the best."""
    return bic(max(h.chi2 / asked.count, 1.0), asked.samples, h.unknowns) - 2.0 * _log_prior(asked, h)


def _log_prior(asked: Question, h: Hypothesis) -> float:
    """Every cause of the library is as likely as any other, and as one that is not in it."""
    return -h.causes * math.log(max(asked.terms, 1))


def anything(asked: Question) -> Hypothesis:
    """Something that nobody has written down: it bends as any cause does, and leaves as much as one told may."""
    left = asked.count + NEARLY_ALL * max(asked.nominal_chi2 - asked.count, 0.0)
    return Hypothesis(frozenset({"unknown"}), (), left, asked.unknowns, 1)


def weighed(asked: Question, hypotheses: Sequence[Hypothesis]) -> list[Weighed]:
    """All hypotheses with their probabilities, the best first; of those that say the same only the best."""
    best: dict[tuple[frozenset[Kind], frozenset[str]], tuple[float, Hypothesis]] = {}
    for h in hypotheses:
        key, own = (h.kinds, frozenset((*h.names, *h.changed))), score(asked, h)
        if key not in best or own < best[key][0]:
            best[key] = own, h
    ranked = sorted(best.values(), key=lambda pair: pair[0])
    shares = odds([s for s, _ in ranked])
    return [Weighed(h, s, float(p)) for (s, h), p in zip(ranked, shares, strict=True)]


def verdict_of(best: Hypothesis) -> Verdict:
    """What the best hypothesis is told as."""
    if best.kinds == {"nothing"}:
        return "consistent"
    if best.kinds == {"unknown"}:
        return "unexplained"
    if "unknown" in best.kinds:
        return "partly_explained"
    return "parameter_change" if best.kinds == {"parameters"} else "explained"


def marginal(weights: Sequence[Weighed], name: str) -> float:
    """How probable it is that an effect is there, whatever else is."""
    return sum(w.probability for w in weights if name in w.hypothesis.names)
