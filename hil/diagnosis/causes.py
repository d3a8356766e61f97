"""Find explanations: changed parameters, one effect, a second beside a first, several one after another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from hil.cores import spread
from hil.diagnosis.evidence import indistinguishable
from hil.diagnosis.measures import SMALL_EXCESS, Measures, are_themselves, is_present, is_there
from hil.diagnosis.problem import Problem
from hil.diagnosis.search.around import Around, around
from hil.diagnosis.search.fitted import Fitted, evaluated, nothing
from hil.diagnosis.search.joint import joint
from hil.diagnosis.search.polish import fit, polish, roughly
from hil.diagnosis.search.refine import LEAN, refine_all
from hil.diagnosis.search.screen import Screened, screen
from hil.diagnosis.search.terms import Term, all_terms
from hil.diagnosis.yardsticks import A_GOOD_PART, AT_A_GLANCE, FAR, FEW, LEADING, MANY, MOST
from hil.identification.estimate import Unknown
from hil.identification.far_starts import far_places

# The χ² that chance may give back to the best of all terms, with a margin; `python -m tests.proof.alarms` counts what
# gets through.
ALARM_GAIN = 60.0
# So many causes may be named together; more of them describe, but anything can be described with enough of them. For
# one more see `_Judge.is_third_named`.
NAMEABLE = 2
# A second cause must leave no good part of what the first one leaves. Where the first one is not the library's law to
# the letter, what that leaves stays with any second cause: then this share suffices if both together explain what they
# should, and less is no cause beside the greater of the two.
SECOND_BESIDE_A_LAW = 0.4
# Where a first one leaves so little of a misfit, nature does not follow the library's law to the letter, and no more,
# unless a second cause takes this share of it.
_TO_THE_LETTER, _NEARLY_ALL = 1e-3, 0.95
# In short recordings every term is fitted, and more causes are tried while each takes this share of what is left.
_STEP_SHARE = 0.2
# A nominal model that leaves most of the output's variance is no place to start from: so many others are looked at.
_FAR_PLACES = 32


@dataclass(frozen=True, slots=True)
class Alone:
    """Everything that is looked for, looked at alone beside the nominal model.

    Attributes:
        place: the nominal model.
        screened: every term at its starts.
        fitted: the promising ones, all else adapting linearly; best first.
    """

    place: Around
    screened: tuple[Screened, ...]
    fitted: tuple[Fitted, ...]

    @property
    def least(self) -> float:
        """χ² of the best."""
        return self.fitted[0].chi2


@dataclass(slots=True)
class Causes:
    """The search for causes of one misfit.

    Attributes:
        m: what explanations are measured by.
        terms: everything that is looked for.
        second: pairs that were fitted roughly on the way, for what cannot be told from the chosen one.
        ended: pairs that were fitted to their end.
    """

    m: Measures
    terms: tuple[Term, ...]
    second: list[Fitted] = field(default_factory=list)
    ended: list[Fitted] = field(default_factory=list)

    def alone(self) -> Alone:
        """Look at every term alone: around the nominal model, as the baseline has bent to a misfit that is not its."""
        place = around(self.m.problem, nothing(self.m.problem))
        screened = screen(place, self.terms, remember=True)
        return Alone(place, tuple(screened), tuple(refine_all(place, screened)))

    def changed_parameters(self, free: Fitted, polished: Sequence[Fitted]) -> list[Fitted]:
        """The base parameters alone: which of them must have changed, and how well that explains.

        No answer where all of them together, `free`, leave more than an effect does.
        """
        if polished and free.chi2 > min(self.m.cost(f) for f in polished):
            return []
        names = self.m.problem.prior.moved(free.parameters)
        fitted = polish(self.m.problem, self._parameter_terms(free, names))
        while len(names) > 1 and (spare := self._dispensable(fitted)):
            names = [name for name in names if name != spare]
            fitted = polish(self.m.problem, self._parameter_terms(fitted, names))
        if any(self.m.cost(f) < self.m.cost(fitted) for f in polished):
            return [fitted]
        return [self._with_fewer(fitted)]

    def _with_fewer(self, fitted: Fitted) -> Fitted:
        """Changed parameters without those that cost less than their price to put back when the others move for it.

        Where several are far off, slopes lead into a valley in which one stands for what others are: there it looks
        indispensable, and without it the others find their own.
        """
        while len(fitted.terms) > 1:
            kept = [[i for i in range(len(fitted.terms)) if i != k] for k in range(len(fitted.terms))]
            fewer = min((polish(self.m.problem, fitted.only(keep)) for keep in kept), key=lambda f: f.chi2)
            if fewer.chi2 - fitted.chi2 >= ALARM_GAIN:
                break
            fitted = fewer
        return fitted

    def _dispensable(self, f: Fitted) -> str:
        """The changed parameter that costs least to put back, if that is less than its price."""
        assert f.estimate is not None  # noqa: S101
        prices = {}
        for term, values in zip(f.terms, f.values, strict=True):
            std = float(f.estimate.std[f.estimate_index(term)])
            prices[term.name] = ((values[0] - term.nominal) / std) ** 2 if std > 0.0 else np.inf
        name = min(prices, key=lambda name: prices[name])
        return name if prices[name] < ALARM_GAIN else ""

    def _parameter_terms(self, at: Fitted, names: Sequence[str]) -> Fitted:
        terms = tuple(t for t in self.terms if t.kind == "parameter" and t.name in names)
        values = tuple((at.parameters[t.name],) for t in terms)
        return Fitted(terms, values, at.parameters, at.chi2, at.residuals)

    def polished(self, singles: Sequence[Fitted]) -> list[Fitted]:
        """The best single explanations of different names, fitted with nothing linearised."""
        distinct: dict[str, Fitted] = {}
        for f in singles:
            distinct.setdefault(f.names[0] if f.names else f.terms[0].name, f)
        best_first = list(distinct.values())
        found = [polish(self.m.problem, f) for f in best_first[:LEADING]]
        if any(self.m.is_adequate(f) for f in found):
            near = self._within(best_first, FAR)
            found += [polish(self.m.problem, f) for f in near[LEADING:FEW]]
        return [f for f in found if is_present(f)]

    def seeds(self, best: Fitted, polished: Sequence[Fitted]) -> list[Fitted]:
        """First causes worth a second one: where an explanation is adequate, those that are not far behind it."""
        good = self.m.is_adequate(best) and are_themselves(best)
        far = FAR * self.m.excess(best) if good else np.inf
        return [f for f in polished if self.m.excess(f) <= far]

    def couples(self, alone: Alone, best: Fitted) -> list[Fitted]:
        """Two causes found at once, where they leave much less than the best single one does.

        What leaves more than the best may only be in another valley of a rugged term that both have.
        """
        found = joint(alone.place, alone.screened, alone.fitted, MANY)
        if not found or self._left(found[0]) > (1.0 - A_GOOD_PART) * self._left(alone.fitted[0]):
            return []
        rough = self._further([self._compared(f) for f in self._within(found, FAR)])
        self.second.extend(rough)
        by_cost = sorted(rough, key=self.m.cost)
        near = self._within(by_cost, 2.0)  # what leaves more hardly turns out best
        hopeful = [*near, *(f for f in by_cost[len(near) :] if self._in_valley_of(by_cost[0], f) != f.values)]
        both = self._to_the_end(hopeful[:FEW])
        return self._kept(both, best)

    def _to_the_end(self, pairs: Sequence[Fitted]) -> Fitted:
        """The most economical of pairs, fitted one after another, each from the valley of a rugged term that the best
        so far has in common with it, where that is lower. What then leaves twice as much is given up.
        """
        best = polish(self.m.problem, pairs[0])
        for f in (*pairs[1:], pairs[0]):
            if f.terms == best.terms:
                continue
            near = self._from_valley_of(best, f)
            if self._left(near) <= 2.0 * self._left(best):
                best = min(best, polish(self.m.problem, near), key=self.m.cost)
        return best

    def _from_valley_of(self, best: Fitted, f: Fitted) -> Fitted:
        """An explanation, or, where that is lower, the same fitted roughly from the valley of a rugged term that it has
        in common with another one.
        """
        moved = self._in_valley_of(best, f)
        if moved == f.values:
            return f
        return min(f, self._compared(replace(f, values=moved, parameters=best.parameters)), key=lambda f: f.chi2)

    def _in_valley_of(self, best: Fitted, f: Fitted) -> tuple[tuple[float, ...], ...]:
        """The values of an explanation with those of the rugged terms that it has in common with another one."""
        valleys = {(t.name, t.hook): v for t, v in zip(best.terms, best.values, strict=True) if t.rugged}
        return tuple(valleys.get((t.name, t.hook), v) for t, v in zip(f.terms, f.values, strict=True))

    def _within(self, best_first: Sequence[Fitted], times: float) -> list[Fitted]:
        """Those that leave no more than so many times what the best leaves."""
        return [f for f in best_first if self._left(f) <= times * self._left(best_first[0])]

    def _compared(self, both: Fitted) -> Fitted:
        """A pair fitted so far that it can be compared with others."""
        return fit(self.m.problem, both, effort=AT_A_GLANCE)

    def _further(self, rough: Sequence[Fitted]) -> list[Fitted]:
        """Those that were still falling and may turn out best are carried on; a delay beside a lag falls slowly."""
        most = FAR * min(self._left(f) for f in rough)
        falls = [f.estimate is not None and not f.estimate.converged and self._left(f) <= most for f in rough]
        return [self._compared(f) if is_falling else f for f, is_falling in zip(rough, falls, strict=True)]

    def _left(self, f: Fitted) -> float:
        """Variance beyond the noise that something leaves or costs, as far as it matters."""
        return max(self.m.burden(f), SMALL_EXCESS)

    def pairs(self, seeds: Sequence[Fitted]) -> list[Fitted]:
        """A second cause beside each of the best first ones, where it explains most of what they leave."""
        found: list[Fitted] = []
        for seed in seeds[:LEADING]:
            if any(self.m.is_all(both) for both in found):
                break
            place = around(self.m.problem, seed)
            screened = screen(place, self.others(seed))
            if self.m.gain(seed, screened[0].chi2) < A_GOOD_PART:
                continue
            near = self._near_best(seed, refine_all(place, screened, LEAN))
            rough = [self._compared(f) for f in near]
            self.second.extend(rough)
            best = self._most_economical(rough)
            if self.m.gain(seed, best.chi2) >= MOST * (1.0 - A_GOOD_PART):
                best = polish(self.m.problem, best)
                found += self._kept(best, seed)
        return found

    def needed(self, both: Fitted) -> Fitted:
        """The greater of two causes alone where that is enough: it may have found its valley only beside the other."""
        greater = min((self.without_the_other(both, k) for k in range(len(both.terms))), key=lambda f: f.chi2)
        alone = roughly(self.m.problem, greater)
        if not self.m.is_adequate(alone) and self.m.gain(alone, both.chi2) >= SECOND_BESIDE_A_LAW:
            return both
        alone = polish(self.m.problem, alone)
        return both if self._is_pair(both, alone) else alone

    def without_the_other(self, f: Fitted, k: int) -> Fitted:
        """One term of an explanation, as it is there."""
        return evaluated(self.m.problem, f.only([k]))

    def _most_economical(self, fits: Sequence[Fitted]) -> Fitted:
        """Of those as good as the best, the one with the fewest unknowns."""
        least = min(f.chi2 for f in fits)
        tied = [f for f in fits if f.chi2 - least < indistinguishable(least)]
        return min(tied, key=lambda f: (f.unknowns, f.chi2))

    def _near_best(self, seed: Fitted, refined: Sequence[Fitted]) -> list[Fitted]:
        """The second causes, linearised, that may turn out best: of different names, near the first one."""
        most = self.m.gain(seed, refined[0].chi2)
        distinct: dict[str, Fitted] = {}
        for f in refined:
            if self.m.gain(seed, f.chi2) >= MOST * most:
                distinct.setdefault(f.names[-1] if f.names else "", f)
        return list(distinct.values())[:FEW]

    def _kept(self, both: Fitted, seed: Fitted) -> list[Fitted]:
        """A pair that explains most of what a first cause leaves. Where one of the two is not there, the other one
        alone from where it ended: it found its valley only so.
        """
        self.ended.append(both)
        if not self._takes_most(both, seed):
            return []
        there = [k for k, term in enumerate(both.terms) if is_there(both, term)]
        if len(there) == len(both.terms):
            return [both]
        return [polish(self.m.problem, self.without_the_other(both, k), from_here=True) for k in there]

    def _is_pair(self, both: Fitted, seed: Fitted) -> bool:
        """Whether a second cause explains most of what a first one leaves, and both are there."""
        return self._takes_most(both, seed) and is_present(both)

    def _takes_most(self, both: Fitted, seed: Fitted) -> bool:
        """Whether two causes together explain most of what a first one leaves."""
        closes = self.m.is_adequate(both) and not self.m.is_adequate(seed)
        share = SECOND_BESIDE_A_LAW if closes else 1.0 - A_GOOD_PART
        if self.m.left(seed) < _TO_THE_LETTER:
            share = _NEARLY_ALL
        return self.m.gain(seed, both.chi2) >= share and seed.chi2 - both.chi2 > ALARM_GAIN

    def others(self, f: Fitted) -> list[Term]:
        """The terms that an explanation does not have yet, with starts from what it leaves."""
        taken = {(term.name, term.hook) for term in f.terms}
        return [term for term in all_terms(self.m.problem, f.residuals) if (term.name, term.hook) not in taken]

    def deeper(self, best: Fitted, place: Around) -> list[Fitted]:
        """Descriptions with one cause more from level to level, each of which takes a good share of what the others
        leave; the best few of each level.

        Nothing is linearised: where the nominal model is far off, a cause shows only after all else has moved. The
        nominal model may even have bent so far to what it lacks that no cause has a way on from there: the same search
        starts once more where such plants usually are. What runs by the clock describes one recording and no other.
        """
        found = self._levels([best, *self._grown(place, len(self.terms))])
        usual = place.accepted.parameters | {p.name: p.typical for p in self.m.problem.base}
        if usual != place.accepted.parameters and not self.m.problem.work.leaves_out("the usual unit as a start"):
            there = evaluated(self.m.problem, replace(place.accepted, parameters=usual))
            found += self._levels(self._grown(around(self.m.problem, there), len(self.terms)), LEADING)
        far = self.m.left_of_output(self.m.baseline) > MOST
        if far and not self.m.problem.work.leaves_out("starts far from the model"):
            found += self._levels(self._from_far(), LEADING)
        return found

    def _from_far(self) -> list[Fitted]:
        """The most promising single causes from many places far from the nominal model, which is none to start from."""
        problem = self.m.problem
        usual = {p.name: p.typical for p in problem.base}
        unknowns = [Unknown(p.name, p.unit, usual[p.name], p.low, p.high, p.scale) for p in problem.base]
        places = [dict(zip(usual, place.tolist(), strict=True)) for place in far_places(unknowns, _FAR_PLACES)]
        terms = [term for term in self.terms if term.kind == "effect" and not term.by_clock]
        starts = [start for term in terms for start in self._promising(term, [usual, *places])]
        rough = spread(partial(fit, problem, effort=AT_A_GLANCE, from_here=True), starts)
        return spread(partial(polish, problem, from_here=True), self._few(rough, FEW))

    def _promising(self, term: Term, places: Sequence[Mapping[str, float]]) -> list[Fitted]:
        """The best places to start one cause from, at its weakest start and its strongest: by shape, not by size."""
        problem = self.m.problem
        nominal = nothing(problem)
        tried = [
            replace(nominal, terms=(term,), values=(start,), parameters=problem.model.values | dict(at))
            for at in places
            for start in dict.fromkeys((term.starts[0], term.starts[-1]))
        ]
        seen = [f for f in spread(partial(evaluated, problem), tried) if np.isfinite(f.chi2)]
        return sorted(seen, key=partial(_unlike, problem))[:FEW]

    def _levels(self, first: Sequence[Fitted], beam: int = FEW) -> list[Fitted]:
        level = self._few(first, beam)
        found = list(level)
        for _ in range(1, NAMEABLE + 1):
            if not level or self.m.is_full(min(found, key=self.m.cost)):
                break
            if self.m.problem.work.leaves_out("one more cause"):
                break
            level = self._few([f for parent in level for f in self._children(parent)], beam)
            found += level
        return found

    def _children(self, parent: Fitted) -> list[Fitted]:
        grown = self._grown(around(self.m.problem, parent), MANY)
        return [f for f in grown if self.m.gain(parent, f.chi2) >= _STEP_SHARE]

    def _grown(self, place: Around, most: int) -> list[Fitted]:
        parent = place.accepted
        others = [term for term in self.others(parent) if term.kind == "effect" and not term.by_clock]
        screened = screen(place, others)
        starts = [
            Fitted((*parent.terms, s.term), (*parent.values, s.starts[0]), parent.parameters, s.chi2, parent.residuals)
            for s in screened[:most]
        ]
        return spread(partial(polish, self.m.problem, from_here=True), starts)

    def _few(self, found: Sequence[Fitted], beam: int) -> list[Fitted]:
        """The best few that are not the same terms."""
        distinct: dict[frozenset[tuple[str, str]], Fitted] = {}
        for f in sorted(found, key=lambda f: f.chi2):
            distinct.setdefault(frozenset((t.name, t.hook) for t in f.terms), f)
        return list(distinct.values())[:beam]


def _unlike(problem: Problem, f: Fitted) -> float:
    """How unlike the recordings an explanation moves, whatever its size: far off, what hardly moves fits best."""
    off = 0.0
    for e, noise, r in zip(problem.experiments, problem.noises, problem.outputs_of(f.residuals), strict=True):
        measured = e.output - e.output.mean()
        simulated = e.output + noise.std * r
        simulated = simulated - simulated.mean()
        size = float(np.linalg.norm(simulated) * np.linalg.norm(measured))
        off += 1.0 - max(float(simulated @ measured) / size, 0.0) ** 2 if size else 1.0
    return off
