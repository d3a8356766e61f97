"""One score for hypotheses of one kind: nothing, changed parameters, effects, events, unknown, and sets of them.

A hypothesis is worth what it leaves of the misfit, on a logarithmic scale, and what its unknowns cost:

    S = m·ln(1 + (E + ρ²·explained)/m) + k·ln n_eff − 2·ln(prior)

with E = (χ² − n)/c, at least 0, and `explained` what the nominal model leaves more than it, over c: where the best
explanation leaves noise, c neighbouring samples of it say the same. Laws of a library are true to a
share ρ of what they explain, and what they leave has about m independent pieces, however many samples there are. A
hypothesis weighs exp(−S/2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from hil.diagnosis.diagnosis import Verdict
from hil.diagnosis.measures import CONSISTENT_EXCESS, LAW_TOLERANCE
from hil.identification.evidence import odds

# How true the library's laws are to nature's, as a share of the rms that they explain.
LAW_ERROR = 0.03
# So many independent pieces has what laws leave.
PIECES = 100.0
# A law that is not written down yet would leave no more of a misfit than laws may, with so many unknowns; so many
# units with a misfit have one, before anything is seen.
UNKNOWN_UNKNOWNS, PRIOR_UNKNOWN = 4, 0.05

Kind = Literal["nothing", "parameters", "effects", "events", "unknown"]


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """What may be so.

    Attributes:
        kinds: what it says; several where it is a set.
        names: of effects and events that it says are there; of parameters that have changed.
        chi2: sum of squared whitened residuals. `unknowns`: how many numbers were fitted.
        causes: how many causes it brings that the nominal model lacks.
    """

    kinds: frozenset[Kind]
    names: tuple[str, ...]
    chi2: float
    unknowns: int
    causes: int

    @property
    def label(self) -> str:
        """As a table says it."""
        extra = ("something unknown",) if "unknown" in self.kinds else ()
        return " + ".join((*self.names, *extra)) or "nothing"

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
        alike: so many neighbouring samples of the noise say the same.
    """

    count: float
    nominal_chi2: float
    terms: int
    alike: float = 1.0


def question(samples: int, nominal_chi2: float, least_chi2: float, terms: int, colour: float = 1.0) -> Question:
    """The question of so many residuals, of which the best explanation leaves `least_chi2`.

    Where that is no more than what is consistent leaves, it is the noise, and `colour` says how many samples of it say
    the same.
    """
    most = (1.0 + CONSISTENT_EXCESS) * samples
    alike = colour if least_chi2 <= most else 1.0
    return Question(float(np.clip(least_chi2, samples, most)), nominal_chi2, terms, alike)


def score(asked: Question, h: Hypothesis) -> float:
    """S of a hypothesis; the least is the best."""
    beyond = max(h.chi2 - asked.count, 0.0)
    explained = max(asked.nominal_chi2 - h.chi2, 0.0)
    off = (beyond + LAW_ERROR**2 * explained) / (asked.alike * PIECES)
    return (
        PIECES * math.log1p(off)
        + h.unknowns * _log_samples(asked.count / asked.alike, off)
        - 2.0 * _log_prior(asked, h)
    )


def _log_samples(count: float, off: float) -> float:
    """Of the number of samples that unknowns are told by: all of them in noise, the pieces where laws leave much."""
    share = 1.0 / (1.0 + off)
    return share * math.log(max(count, PIECES)) + (1.0 - share) * math.log(PIECES)


def _log_prior(asked: Question, h: Hypothesis) -> float:
    """Every cause of the library is as likely as any other."""
    own = -h.causes * math.log(max(asked.terms, 1))
    return own + (math.log(PRIOR_UNKNOWN) if "unknown" in h.kinds else 0.0)


def anything(asked: Question) -> Hypothesis:
    """Something that nobody has written down, which would leave as little as a law of nature does."""
    left = asked.count + LAW_TOLERANCE * max(asked.nominal_chi2 - asked.count, 0.0)
    return Hypothesis(frozenset({"unknown"}), (), left, UNKNOWN_UNKNOWNS, 1)


def weighed(asked: Question, hypotheses: Sequence[Hypothesis]) -> list[Weighed]:
    """All hypotheses with their probabilities, the best first; of those that say the same only the best."""
    best: dict[tuple[frozenset[Kind], frozenset[str]], tuple[float, Hypothesis]] = {}
    for h in hypotheses:
        key, own = (h.kinds, frozenset(h.names)), score(asked, h)
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
