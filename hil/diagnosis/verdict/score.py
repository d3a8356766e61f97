"""One score for all hypotheses, less is better, and the table that the verdict is read from.

    S = m·ln(1 + E/m) + c·(γ·m + 2·ln T) + k·ln n,  E = max(0, χ² − χ₀²)·N/χ₀²

χ₀² is the least χ² of any hypothesis, held within what is known of the noise; N says how much noise leaves, n how many
independent samples that is; c causes, k unknowns, T names searched. Laws of a library are not those of nature: beyond m
what is left counts by its logarithm. Something unknown stands beside every set of causes, also beside none. One name
beside it must divide what any other name leaves by what a cause costs: laws that come nearly as near only resemble it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hil.diagnosis.criteria import CRITERIA, Criteria
from hil.diagnosis.diagnosis import DiagnosisVerdict

UNKNOWN = "something unknown"


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """What may be so.

    Attributes:
        names: of effects and events. `changed`: of parameters. Neither: the unit as it was.
        chi2: sum of squared whitened residuals, the prior of the base parameters included.
        causes, unknowns: c and k.
        moved: base parameters among the causes that had to move; something unknown beside a set may have bent them.
        is_open: whether something beside them is only described: it is something unknown, which leaves as much.
    """

    names: tuple[str, ...]
    chi2: float
    causes: int = 0
    unknowns: int = 0
    changed: tuple[str, ...] = ()
    is_open: bool = False
    moved: int = 0

    @property
    def named(self) -> tuple[str, ...]:
        """Effects, events and changed parameters."""
        return (*self.names, *self.changed)


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

    def chi2(self, least: float) -> float:
        """χ₀², from the least χ² of any hypothesis."""
        return float(np.clip(least, self.least * self.count, self.most * self.count))

    def left(self, chi2: float, least: float) -> float:
        """E of what leaves χ²."""
        noise = self.chi2(least)
        return max(chi2 - noise, 0.0) * self.count / noise


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
        return " + ".join((*self.hypothesis.named, *((UNKNOWN,) if self.is_open else ()))) or "nothing"

    @property
    def reported(self) -> tuple[str, ...]:
        """Its names; that parameters have changed is one."""
        h = self.hypothesis
        return (*h.names, *(("parameter_change",) if h.changed else ()))

    @property
    def verdict(self) -> DiagnosisVerdict:
        """The name that is reported."""
        h = self.hypothesis
        if self.is_open:
            return "partly_explained" if h.named else "unexplained"
        return "explained" if h.names else "parameter_change" if h.changed else "consistent"


@dataclass(frozen=True, slots=True)
class Table:
    """All rows, the best first; something unknown where it looks like several names.

    Attributes:
        noise: what it leaves alone. `chi2`: χ₀².
        rows: the first one is the verdict.
        ambiguous: the first, those within the stated odds of the best, and those that resemble it.
    """

    noise: Noise
    chi2: float
    rows: tuple[Row, ...]
    ambiguous: tuple[Row, ...]

    @property
    def first(self) -> Row:
        """The verdict."""
        return self.rows[0]

    def without(self, excluded: DiagnosisVerdict) -> Table:
        """The same without rows that are told so, where something else has refuted them."""
        return _ranked(self.noise, self.chi2, (r for r in self.rows if r.verdict != excluded))

    @property
    def alternatives(self) -> tuple[tuple[str, str], ...]:
        """Pairs of names, one of the first row and one of another that data do not separate from it."""
        ours = self.first.reported
        found: dict[tuple[str, str], None] = {}
        for row in self.ambiguous:
            mine = [name for name in ours if name not in row.reported]
            other = [name for name in row.reported if name not in ours]
            if mine and other:
                found[mine[0], other[0]] = None
        return tuple(sorted(found))

    @property
    def alike(self) -> tuple[str, ...]:
        """Names of sets that data do not separate from the first row."""
        sets = (" + ".join(row.reported) for row in self.ambiguous if row.reported)
        return tuple(dict.fromkeys(sets))

    def chance(self, name: str) -> float:
        """How probable it is that a name is there, whatever else is."""
        return sum(r.probability for r in self.rows if name in r.hypothesis.named)

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
        hypotheses: those that were fitted, the unit as it was among them; of equal ones the earlier goes first.
    """
    found = list(hypotheses)
    least = min(h.chi2 for h in found)
    best: dict[tuple[frozenset[str], bool], Row] = {}
    for h in found:
        for row in _rows(noise, h, noise.left(h.chi2, least)):
            key = frozenset(h.named), row.is_open
            if key not in best or row.score < best[key].score:
                best[key] = row
    return _ranked(noise, noise.chi2(least), best.values())


def _rows(noise: Noise, h: Hypothesis, left: float) -> tuple[Row, ...]:
    bent = max(h.moved - 1, 0) if left > CRITERIA.parts else 0  # by one thing that is unknown
    causes, unknowns, less = h.causes - bent + 1, h.unknowns + CRITERIA.unknowns, CRITERIA.unknown * left
    own = Row(h, h.is_open, h.causes, h.unknowns, left, score(noise, left, h.causes, h.unknowns))
    return (own,) if h.is_open else (own, Row(h, True, causes, unknowns, less, score(noise, less, causes, unknowns)))


def _ranked(noise: Noise, chi2: float, rows: Iterable[Row]) -> Table:
    ranked = sorted(rows, key=lambda r: r.score)
    weights = np.exp(-np.array([r.score - ranked[0].score for r in ranked]) / (2.0 * CRITERIA.temper))
    found = [replace(r, probability=float(w)) for r, w in zip(ranked, weights / weights.sum(), strict=True)]
    best = found[0]
    resembling = [r for r in found if _resembles(noise, chi2, r, best)]
    near = [r for r in found if r.probability * CRITERIA.odds >= best.probability]
    if resembling:
        found.sort(key=lambda r: bool(r.hypothesis.named) or not r.is_open)
        near = [found[0], *(r for r in found[1:] if r in near or r in resembling)]
    return Table(noise, chi2, tuple(found), tuple(near))


def _resembles(noise: Noise, chi2: float, row: Row, best: Row) -> bool:
    """Whether something unknown may look like this as well as like the one name that is best beside it."""
    names, others = set(best.hypothesis.named), set(row.hypothesis.named)
    if not (best.is_open and row.is_open and others) or len(names) != 1 or names <= others:
        return False
    left = noise.left(row.hypothesis.chi2, chi2), noise.left(best.hypothesis.chi2, chi2)
    return score(noise, left[0], max(row.causes - best.causes, 0), 0) < score(noise, left[1], 1, 0)
