"""The search: every term alone, then sets that grow, drop and swap one term, the best few at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from hil.cores import parallel_map
from hil.diagnosis.intake.problem import Problem
from hil.diagnosis.search.effort import EFFORT
from hil.diagnosis.search.fits import finished, fit, fit_given
from hil.diagnosis.search.fitted import Fitted, nothing, simulated
from hil.diagnosis.search.linearization import Linearization, linearized
from hil.diagnosis.search.probes import Keys, Probe, Start, keys, pairs, predicted_probes, simulated_probes, sketch
from hil.diagnosis.search.terms import Term, all_terms
from hil.diagnosis.thresholds import TINY
from hil.identification.grey_box.estimate import Unknown
from hil.identification.grey_box.multistart import multistart
from hil.language.words import marked
from hil.record.recording import Array


class Scoring(Protocol):
    """What sets are worth."""

    def of(self, f: Fitted, least: float) -> float:
        """Of a set among those of which the best leaves `least`; less is better."""

    def is_enough(self, f: Fitted, size: int) -> bool:
        """Whether no set of so many causes could be worth more."""

    def is_within_noise(self, f: Fitted) -> bool:
        """Whether what it leaves may be noise alone."""


def labels(f: Fitted) -> Keys:
    """How a set is reported: effects by name, those that a parameter has grown into apart, parameters as such."""
    return frozenset((t.kind, t.effect_name(v) or t.name) for t, v in f.pairs)


def _distinct(sets: Iterable[Fitted], key: Callable[[Fitted], Keys]) -> list[Fitted]:
    """The first of those that have the same key."""
    found: dict[Keys, Fitted] = {}
    for f in sets:
        found.setdefault(key(f), f)
    return list(found.values())


class Search:
    """One search, by batches; it knows no other score than the one that it is given.

    `fits`: every set that was fitted to its end, the lowest of each.
    """

    def __init__(self, problem: Problem, scoring: Scoring) -> None:
        self.problem, self.scoring = problem, scoring
        self.fits: dict[Keys, Fitted] = {}
        self.probes: list[Probe] = []
        self._ended: set[Keys] = set()
        self.terms = all_terms(problem, problem.nominal_residuals)

    def also(self, sets: Sequence[Fitted]) -> None:
        """Sets from elsewhere, fitted; where a term of one ended at nothing, the others alone from there too."""
        found = parallel_map(lambda f: fit(self.problem, f, steps=EFFORT.fine), sets)
        for f in found:
            self.add(f)
            there = [k for k, (t, v) in enumerate(f.pairs) if not t.is_nothing(v)]
            if len(there) < len(f.terms):
                self.add(fit(self.problem, f.only(there), steps=EFFORT.fine))

    def add(self, f: Fitted) -> Fitted:
        """Keep a fit where it is the lowest of its set; the lowest."""
        known = self.fits.setdefault(keys(f), f)
        if f.chi2 < known.chi2:
            self.fits[keys(f)] = f
        return self.fits[keys(f)]

    def run(self) -> None:
        """Search from nothing on."""
        unit = self.add(fit(self.problem, nothing(self.problem), steps=EFFORT.fine))
        if self.scoring.is_enough(unit, 1):
            return
        linear = linearized(self.problem, nothing(self.problem))
        self.probes = simulated_probes(linear, [(t, start) for t in self.terms for start in t.starts])
        self._grow(linear, self.probes, EFFORT.alone, 2 * EFFORT.finished)
        self._parameters(unit)
        for size in range(1, EFFORT.causes):
            if self._is_done(size):
                break
            first = self.first
            # One law that leaves what may be noise imitates no other two: only a small cause more may hide beside it.
            is_alone = size == 1 and self.scoring.is_within_noise(first)
            if size == 1 and not is_alone:
                self._couples(linear)
            for parent in self._best(size)[: 1 if is_alone else EFFORT.beam - size + 1]:
                self._extend(parent)
            if is_alone and self.first is first:
                break
            self._drop_and_swap(size + 1)
        is_affordable = self.problem.is_short and not self.problem.following
        if is_affordable and not self._is_enough(1 + max(len(self.first.terms), 1)):
            self._not_linearised(unit)

    @property
    def first(self) -> Fitted:
        """The best set."""
        return self.ranked()[0]

    def ranked(self) -> list[Fitted]:
        """All sets, the best first."""
        least = self._least
        return sorted(self.fits.values(), key=lambda f: self.scoring.of(f, least))

    @property
    def _least(self) -> float:
        return min(f.chi2 for f in self.fits.values())

    def _not_linearised(self, unit: Fitted) -> None:
        """Sets that grow with nothing linearised, an effect at a time.

        Where the nominal model is far off, a cause shows only after all else has moved; the model may even have bent so
        far to what it lacks that no cause has a way on from there. In short recordings that is affordable.
        """
        level = [unit]
        for _ in range(EFFORT.causes):
            if self.problem.work.leaves_out(marked("fits with nothing linearised")):
                return
            grown = [child for parent in level for child in self._children(parent)]
            found = parallel_map(lambda f: fit(self.problem, f, from_here=True), grown)
            level = _distinct(sorted(map(self.add, found), key=lambda f: f.chi2), keys)[: EFFORT.beam]

    def _children(self, parent: Fitted) -> Iterator[Fitted]:
        """A set with each effect more that it does not have yet, to be fitted: one from all starts, more from the best.

        Beside a model that explains little, one effect stands with base parameters from anywhere too.
        """
        effects = [t for t in all_terms(self.problem, parent.residuals) if t.kind == "effect" and not t.by_clock]
        starts = [(t, start) for t in effects if t.key not in keys(parent) for start in t.starts]
        if parent.terms:
            probes = simulated_probes(linearized(self.problem, parent), starts)
            promising = _by_term(probes)[: EFFORT.tried]
            starts = [(x.term, x.at) for own in promising for x in own[: EFFORT.starts]]
        for term, start in starts:
            for at in (parent.parameters, *([] if parent.terms else self._units_from_afar(term, start))):
                yield Fitted((*parent.terms, term), (*parent.values, start), at, np.inf, parent.residuals)

    def _units_from_afar(self, term: Term, start: Start) -> list[dict[str, float]]:
        """Base parameters from anywhere beside an effect, the best few, where the nominal model explains little."""
        problem = self.problem
        if not problem.explains_little:
            return []
        names, nominal = [p.name for p in problem.base], problem.model.values
        usual = [Unknown(p.name, p.unit, p.typical, p.low, p.high, p.scale) for p in problem.base]

        def residuals(values: Array) -> Array:
            unit = nominal | dict(zip(names, values.tolist(), strict=True))
            return simulated(problem, unit, (term,), (start,), problem.coarse_factor)

        return [nominal | {u.name: u.start for u in unit} for unit in multistart(residuals, usual)]

    def _is_done(self, size: int) -> bool:
        """Whether larger sets than of this size are not looked for: the best is enough, or smaller already."""
        smaller = size > 1 and len(self.first.terms) < size
        return smaller or self._is_enough(size + 1) or self.problem.work.leaves_out(marked("larger sets of causes"))

    def _is_enough(self, size: int) -> bool:
        """Whether no set of so many causes could be worth more than the best, fitted with tight tolerances."""
        best = self.first
        if self.scoring.is_enough(best, size):
            return True
        if keys(best) in self._ended or self.problem.step > 0.0:
            return False
        self._ended.add(keys(best))
        return self.scoring.is_enough(self.add(finished(self.problem, best)), size)

    def _score(self, f: Fitted) -> float:
        return self.scoring.of(f, self._least)

    def _best(self, size: int) -> list[Fitted]:
        """The best sets of a size that are reported differently."""
        return _distinct((f for f in self.ranked() if len(f.terms) == size), labels)

    def _parameters(self, unit: Fitted) -> None:
        """Base parameters that moved farther than they may wander: freed, and put back one by one, dearest last."""
        free = fit(self.problem, unit, base_free=True, steps=EFFORT.fine)
        names = self.problem.prior.moved(free.parameters)
        effects = [f.chi2 for f in self.fits.values() if f.terms]
        at = free
        if free.chi2 > min(effects, default=np.inf):
            return
        while names:
            terms = tuple(t for t in self.terms if t.kind == "parameter" and t.name in names)
            values = tuple((at.parameters[t.name],) for t in terms)
            at = fit(self.problem, Fitted(terms, values, at.parameters, at.chi2, at.residuals), steps=EFFORT.fine)
            self.add(at)
            away = {t.name: _away(at, t, v[0]) for t, v in at.pairs}
            names = [n for n in names if n != min(away, key=lambda name: away[name])]

    def _extend(self, parent: Fitted) -> None:
        """One term more: predicted, simulated where promising, fitted given the rest, the best to its end."""
        linear = linearized(self.problem, parent)
        predicted = predicted_probes(linear, self.probes)[: 4 * EFFORT.tried]
        lines = [t for t in all_terms(self.problem, parent.residuals) if t.by_clock]
        jobs = [(probe.term, probe.at) for probe in predicted]
        jobs += [(t, s) for t in lines if t.key not in keys(parent) for s in t.starts[: EFFORT.starts]]
        self._grow(linear, simulated_probes(linear, jobs), EFFORT.tried, EFFORT.finished)

    def _grow(self, linear: Linearization, probes: Sequence[Probe], tried: int, finished: int) -> None:
        jobs = [
            probe
            for rank, own in enumerate(_by_term(probes)[:tried])
            for probe in own[: EFFORT.starts if rank < finished or own[0].term.multimodal else 1]
        ]
        self._to_the_end(parallel_map(lambda probe: fit_given(linear, probe.term, probe.at), jobs), finished)

    def _to_the_end(self, grown: Iterable[Fitted], most: int) -> None:
        """The best of different names, fitted to their end where they may turn out best."""
        new = (f for f in sorted(grown, key=self._score) if keys(f) not in self.fits)
        hopeful = _distinct(new, labels)[:most]
        self.also(hopeful[:1])
        self.also([f for f in hopeful[1:] if self._may_win(f)])

    def _may_win(self, f: Fitted) -> bool:
        """Whether a set may turn out best when its fit goes on; noise may then turn out to be less, too."""
        noise = self.problem.expected
        further = replace(f, chi2=min(f.chi2, noise + max(f.chi2 - noise, 0.0) / EFFORT.far))
        least = min(self._least, further.chi2)
        return self.scoring.of(further, least) < min(self.scoring.of(g, least) for g in self.fits.values())

    def _couples(self, linear: Linearization) -> None:
        """Pairs by the sum of what each changes alone: a third that is not there may imitate two that are."""
        found = pairs(self.probes, sketch(linear.residuals_without), 2 * EFFORT.finished)
        sets = [
            Fitted((a, b), (at, there), linear.accepted.parameters, np.inf, linear.accepted.residuals)
            for (a, at), (b, there) in found
        ]
        new = [f for f in sets if keys(f) not in self.fits]
        self._to_the_end(parallel_map(lambda f: fit(self.problem, f, steps=EFFORT.rough), new), EFFORT.finished)

    def _drop_and_swap(self, size: int) -> None:
        """From the best sets of a size all but each term; of the best one also what then comes in its linear."""
        best, tried = self._best(size)[: EFFORT.beam], set()
        for f in best:
            for k in range(size):
                rest = f.without(k)
                if keys(rest) in tried:
                    continue
                tried.add(keys(rest))
                smaller = fit(self.problem, rest, steps=EFFORT.rough)
                before = self.fits.get(keys(smaller))
                if before is not None and before.chi2 <= smaller.chi2:
                    continue
                found = self.add(fit(self.problem, smaller, steps=EFFORT.fine))
                if f is best[0] and (before is None or found.chi2 < EFFORT.again * before.chi2):
                    self._extend(found)


def _by_term(probes: Sequence[Probe]) -> list[list[Probe]]:
    """Those that may lead on, the terms and their starts best first."""
    found: dict[tuple[str, str], list[Probe]] = {}
    for probe in probes:
        if np.isfinite(probe.chi2):
            found.setdefault(probe.term.key, []).append(probe)
    return list(found.values())


def _away(f: Fitted, term: Term, value: float) -> float:
    """How many standard uncertainties a parameter is from its nominal value."""
    assert f.estimate is not None  # noqa: S101
    return abs(value - term.nominal) / max(float(f.estimate.std[f.estimate_index(term)]), TINY)
