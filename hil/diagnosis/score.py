"""One score for all hypotheses, less is better, and the table that the verdict is read from.

    S = m·ln(1 + E/m) + c·(γ·m + 2·ln T) + k·ln n,  E = max(0, χ² − χ₀²)·N/χ₀²

χ₀² is the least χ² of any hypothesis, held within what is known of the noise; N says how much noise leaves, n how many
independent samples that is; c causes, k unknowns, T names searched. Laws of a library are not those of nature: beyond m
what is left counts by its logarithm. Something unknown stands beside every set of causes, also beside none.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hil.diagnosis.diagnosis import Verdict

UNKNOWN = "something unknown"


@dataclass(frozen=True, slots=True)
class Criteria:
    """Everything that decides between hypotheses.

    Attributes:
        parts: m, from where on what is left counts by its logarithm. `cause`: γ, what a cause costs, in parts.
        unknown: what something unknown leaves of what its partner leaves, and its `unknowns`.
        temper: τ; odds of two rows are exp(ΔS/2τ). `odds`: rows within these odds of the first are not told apart.
    """

    parts: float = 100.0
    cause: float = 1.1
    unknown: float = 0.1
    unknowns: int = 3
    temper: float = 10.0
    odds: float = 20.0


CRITERIA = Criteria()


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """What may be so.

    Attributes:
        names: of effects and events. `changed`: of parameters. Neither: the unit as it was.
        chi2: sum of squared whitened residuals, the prior of the base parameters included.
        causes, unknowns: c and k.
    """

    names: tuple[str, ...]
    chi2: float
    causes: int = 0
    unknowns: int = 0
    changed: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Noise:
    """What noise alone leaves.

    Attributes:
        count: N, its expected χ². `least`, `most`: as many times that it may be, within 95 %.
        samples: n, how many independent samples the residuals are worth. `names`: T.
    """

    count: float
    least: float
    most: float
    samples: float
    names: int


@dataclass(frozen=True, slots=True)
class Row:
    """A hypothesis by itself or with something unknown beside it; `left`: its E. `probability`: among all rows."""

    hypothesis: Hypothesis
    is_open: bool
    causes: int
    unknowns: int
    left: float
    score: float
    probability: float = 0.0

    @property
    def label(self) -> str:
        """As a table says it: `friction + something unknown`."""
        h = self.hypothesis
        return " + ".join((*h.names, *h.changed, *((UNKNOWN,) if self.is_open else ()))) or "nothing"

    @property
    def verdict(self) -> Verdict:
        """What it is told as."""
        h = self.hypothesis
        if self.is_open:
            return "partly_explained" if h.names or h.changed else "unexplained"
        return "explained" if h.names else "parameter_change" if h.changed else "consistent"


@dataclass(frozen=True, slots=True)
class Table:
    """All rows, the best first: the first one is the verdict."""

    noise: Noise
    chi2: float
    rows: tuple[Row, ...]

    @property
    def first(self) -> Row:
        """The best row."""
        return self.rows[0]

    @property
    def ambiguous(self) -> tuple[Row, ...]:
        """All rows within the stated odds of the first, that one included."""
        return tuple(r for r in self.rows if r.probability * CRITERIA.odds >= self.first.probability)

    def without(self, told: Verdict) -> Table:
        """The same without rows that are told so, where something else has refuted them."""
        return replace(self, rows=_with_odds([r for r in self.rows if r.verdict != told]))

    def chance(self, name: str) -> float:
        """How probable it is that a name is there, whatever else is."""
        return sum(r.probability for r in self.rows if name in (*r.hypothesis.names, *r.hypothesis.changed))

    def as_dict(self, most: int) -> dict[str, Any]:
        """As `diagnosis.json` has it; so many rows at most."""
        return {
            "noise_chi2": round(self.chi2, 1),
            "count": round(self.noise.count, 1),
            "samples": round(self.noise.samples, 1),
            "searched": self.noise.names,
            "criteria": {name: getattr(CRITERIA, name) for name in Criteria.__slots__},
            "rows": [
                {"name": r.label, "causes": r.causes, "unknowns": r.unknowns, "left": round(r.left, 1),
                 "score": round(r.score, 2), "probability": round(r.probability, 4)}
                for r in self.rows[:most]
            ],
        }  # fmt: skip


def score(noise: Noise, left: float, causes: int, unknowns: int) -> float:
    """S of what leaves E."""
    m = CRITERIA.parts
    price = CRITERIA.cause * m + 2.0 * math.log(max(noise.names, 1))
    return m * math.log1p(left / m) + causes * price + unknowns * math.log(max(noise.samples, 1.0))


def table(noise: Noise, hypotheses: Iterable[Hypothesis]) -> Table:
    """Every hypothesis, and each with something unknown beside it; of those that say the same only the best.

    Args:
        noise: what it leaves alone.
        hypotheses: those that were fitted, the unit as it was among them.
    """
    found = list(hypotheses)
    chi2 = float(np.clip(min(h.chi2 for h in found), noise.least * noise.count, noise.most * noise.count))
    best: dict[str, Row] = {}
    for h in found:
        for row in _rows(noise, h, max(h.chi2 - chi2, 0.0) * noise.count / chi2):
            if row.label not in best or row.score < best[row.label].score:
                best[row.label] = row
    return Table(noise, chi2, _with_odds(sorted(best.values(), key=lambda r: r.score)))


def _rows(noise: Noise, h: Hypothesis, left: float) -> tuple[Row, Row]:
    causes, unknowns, less = h.causes + 1, h.unknowns + CRITERIA.unknowns, CRITERIA.unknown * left
    return (
        Row(h, False, h.causes, h.unknowns, left, score(noise, left, h.causes, h.unknowns)),
        Row(h, True, causes, unknowns, less, score(noise, less, causes, unknowns)),
    )


def _with_odds(rows: Sequence[Row]) -> tuple[Row, ...]:
    weights = np.exp(-np.array([r.score - rows[0].score for r in rows]) / (2.0 * CRITERIA.temper))
    return tuple(replace(r, probability=float(w)) for r, w in zip(rows, weights / weights.sum(), strict=True))


def verdict(of: Table, *, is_alarm: bool | None = None) -> Verdict:
    """The verdict that a table says.

    Args:
        of: the table.
        is_alarm: whether the gate before any name says that the unit has changed; None where there is none.
    """
    if is_alarm is False:
        return "consistent"
    told = of.first.verdict
    return "unexplained" if is_alarm and told == "consistent" else told
