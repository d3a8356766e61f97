"""Choose between explanations: nothing, changed parameters, one effect, several, or none that is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any

import numpy as np

from hil.diagnosis.causes import ALARM_GAIN, NAMEABLE, Alone, Causes
from hil.diagnosis.diagnosis import Verdict
from hil.diagnosis.events.event import Events
from hil.diagnosis.events.recognise import recognised
from hil.diagnosis.evidence import indistinguishable
from hil.diagnosis.measures import (
    CONSISTENT_EXCESS,
    NEARLY_ALL,
    PART_TOLERANCE,
    SMALL_EXCESS,
    Measures,
    are_themselves,
    excess,
    is_present,
    is_strained,
)
from hil.diagnosis.problem import Problem
from hil.diagnosis.refuted import refuted
from hil.diagnosis.search.fitted import Fitted, change_without, nothing
from hil.diagnosis.search.polish import finished, from_other_shapes, polish, roughly
from hil.diagnosis.search.terms import Term, all_terms
from hil.diagnosis.yardsticks import FAR, MOST, MUCH_THE_SAME, PLAINLY

OPEN = ("partly_explained", "unexplained")


@dataclass(frozen=True, slots=True)
class Choice:
    """What the evidence says.

    Attributes:
        verdict: the answer.
        chosen: terms and values, fitted together; no terms when nothing is to be named.
        baseline: the nominal model, base parameters moved within their prior; as it is where they have changed.
        nominal: the nominal model as it is.
        candidates: single explanations that were fitted: those with nothing linearised, then the others; best first.
        rivals: effect names that explain the data as well as the first chosen one.
        terms: everything that was looked for.
        left: the share of the misfit that the chosen explanation leaves.
        events: what happened at moments that no law foresees, if that explains what the library does not.
        part: such events that take a good part of the misfit and leave the rest open.
        descriptions: what else comes near where nothing can be named, the closest first.
        pairs: two causes that were fitted together, as far as they were.
        alike: names that would each explain as much, where nothing is named.
        chances: how probable each name is, where one score has weighed all of them; `table`: all that it has weighed.
    """

    verdict: Verdict
    chosen: Fitted
    baseline: Fitted
    nominal: Fitted
    candidates: tuple[Fitted, ...]
    rivals: tuple[tuple[str, str], ...]
    terms: tuple[Term, ...]
    left: float
    events: Events | None = None
    part: Events | None = None
    descriptions: tuple[Fitted, ...] = ()
    pairs: tuple[Fitted, ...] = ()
    alike: tuple[str, ...] = ()
    chances: Mapping[str, float] = field(default_factory=dict)
    table: Mapping[str, Any] | None = None


def decide(problem: Problem, *, laws_only: bool = False, most: int = NAMEABLE) -> Choice:
    """Search for the most economical explanation that the data support, and do not refute.

    Args:
        problem: the question.
        laws_only: look for no events.
        most: so many causes at most may be named.
    """
    choice = _Judge(problem, laws_only, most).choose()
    wrong = refuted(problem, choice.chosen)
    if not wrong:
        return choice
    return decide(replace(problem, refuted=problem.refuted | wrong), laws_only=laws_only, most=most)


def healthy(choice: Choice) -> Choice:
    """The same search with nothing named."""
    return replace(choice, verdict="consistent", chosen=choice.baseline, rivals=(), left=1.0, events=None)


class _Judge:
    """One decision; holds what several questions share."""

    def __init__(self, problem: Problem, laws_only: bool, most: int) -> None:
        self.problem, self.laws_only, self.most = problem, laws_only, most
        self.baseline = _baseline(problem)
        self.m = Measures(problem, self.baseline)
        self.causes = Causes(self.m, all_terms(problem, self.baseline.residuals))

    def choose(self) -> Choice:
        alone = self.causes.alone()
        nominal, singles = alone.place.accepted, alone.fitted
        free = roughly(self.problem, self.baseline, base_free=True)
        if self.baseline.chi2 - min(alone.least, free.chi2) < ALARM_GAIN:
            return self.nothing_found(nominal, singles)
        polished = self.causes.polished(singles)
        known = [*polished, *self.causes.changed_parameters(free, polished)]
        if self.baseline.chi2 - min(alone.least, *(f.chi2 for f in known)) < ALARM_GAIN:
            return self.nothing_found(nominal, singles)
        best = self.best_law(known, polished, alone)
        if not best.terms and self.m.excess(self.baseline) < CONSISTENT_EXCESS:
            return self.nothing_found(nominal, singles)
        best = self.most_telling([best, *polished], polished)
        verdict = self.verdict(best, polished)
        open_question = verdict in OPEN and not self.m.is_adequate(best)
        events, part = self.events(nominal) if open_question and not self.laws_only else (None, None)
        if events is not None and verdict == "partly_explained" and self.says_more(best, events):
            events = None
        if not self.m.is_full(best) and events is None and not self.problem.work.leaves_out("a led-back search"):
            best = self.most_telling([best, *self.followed()], polished)
            verdict = self.verdict(best, polished)
        descriptions: list[Fitted] = []
        short = self.problem.is_short and not self.problem.work.leaves_out("several causes one after another")
        if verdict in OPEN and not self.m.is_adequate(best) and events is None and short:
            self.problem.work.at(0.4, "looking for several causes one after another")
            descriptions = self.causes.deeper(best, alone.place)
            best, verdict = self.of_several(best, descriptions, polished)
        elif events is None:
            best, verdict = self.of_three(best, verdict, polished)
        candidates = (*sorted(polished, key=self.m.cost), *singles)
        rivals = self.rivals(best, polished)
        best = finished(self.problem, best)
        if verdict == "explained" and self.is_changed_unit(best):
            best, verdict = best.as_change, "parameter_change"
        return Choice(
            verdict, best, self.baseline, nominal, candidates,
            rivals, self.causes.terms, self.m.left(best), events, part, self.others(best, descriptions),
            (*self.causes.second, *self.causes.ended),
        )  # fmt: skip

    def best_law(self, known: Sequence[Fitted], polished: Sequence[Fitted], alone: Alone) -> Fitted:
        """The most economical explanation of one cause or two, at its lowest, and least strained."""
        best = min(known, key=self.m.cost)
        work = self.problem.work
        if self.most > 1 and not self.m.is_full(best) and not work.leaves_out("two causes"):
            work.at(0.25, "looking for two causes")
            best = self.of_two(best, polished, alone)
        if self.m.excess(best) > SMALL_EXCESS:  # a rugged term may have ended in the wrong valley
            best = from_other_shapes(self.problem, best)
        return self.least_strained(best, polished)

    def of_two(self, best: Fitted, polished: Sequence[Fitted], alone: Alone) -> Fitted:
        """The most economical explanation of two causes, or the best of one where that is more economical."""
        best = self.most_telling([best, *self.causes.couples(alone, best)], polished)
        if not (self.m.is_all(best) or (len(best.terms) == NAMEABLE and self.verdict(best, polished) == "explained")):
            best = self.most_telling([best, *self.causes.pairs(self.causes.seeds(best, polished))], polished)
        if not self.m.is_all(best) and len(best.terms) == NAMEABLE:
            # the first one was found when the second was not known
            best = self.most_telling([best, *self.causes.pairs([self.causes.without_the_other(best, 1)])], polished)
        return self.causes.needed(best) if len(best.terms) == NAMEABLE else best

    def of_three(self, best: Fitted, verdict: Verdict, polished: Sequence[Fitted]) -> tuple[Fitted, Verdict]:
        """Two causes that leave something, or a third beside them where that can be named, and the verdict on it."""
        enough = self.most < NAMEABLE or len(best.terms) != NAMEABLE or self.m.is_full(best)
        if enough or self.problem.work.leaves_out("a third cause"):
            return best, verdict
        known = len(self.causes.second)
        found = self.causes.pairs([best])
        return self.of_several(best, [*found, *self.causes.second[known:]], polished)

    def of_several(self, best: Fitted, found: Sequence[Fitted], polished: Sequence[Fitted]) -> tuple[Fitted, Verdict]:
        """The most telling of an explanation and descriptions with ever more causes, and the verdict on it."""
        closest: dict[int, Fitted] = {}
        for f in sorted(found, key=lambda f: f.chi2):
            closest.setdefault(len(f.terms), f)
        firsts = [best, *(closest[size] for size in sorted(closest))]
        best = self.most_telling(firsts, polished)
        verdict = self.verdict(best, polished)
        named: list[tuple[Fitted, Verdict]] = [
            (f, "explained" if self.m.is_adequate(f) else "partly_explained")
            for f in firsts
            if self.is_third_named(f, best if verdict != "unexplained" else None, found)
        ]
        return min([(best, verdict), *named], key=lambda each: (_openness(each[1]), self.m.cost(each[0])))

    def others(self, best: Fitted, found: Sequence[Fitted]) -> tuple[Fitted, ...]:
        """Descriptions of other names than the best, those of each name once, the most economical first."""
        distinct = {frozenset(best.names): best}
        for f in sorted(found, key=self.m.cost):
            distinct.setdefault(frozenset(f.names), f)
        return tuple(f for f in distinct.values() if f is not best)

    def events(self, nominal: Fitted) -> tuple[Events | None, Events | None]:
        """Events beside the unit as it was, or with its parameters moved: they bend to what no parameter has done."""
        return recognised(self.problem, (nominal, self.baseline), self.m.excess(self.baseline))

    def says_more(self, law: Fitted, events: Events) -> bool:
        """Whether a law that can be named is to be preferred to events that leave most of what it leaves: they are
        placed freely, and steps that a limit of rate rounds off look like commands that came late.
        """
        return excess(self.problem, events.chi2) > MOST * self.m.excess(law)

    def most_telling(self, found: Sequence[Fitted], polished: Sequence[Fitted]) -> Fitted:
        """Of explanations what can be named rather than what cannot, and then the most economical."""
        return min(found, key=lambda f: (_openness(self.verdict(f, polished)), self.m.cost(f)))

    def followed(self) -> list[Fitted]:
        """What a search finds whose simulations are led back to the recordings; nothing where no observer leads them.

        A plant that integrates adds up what is missing: a second cause shows in its output only when the first one is
        right. Led back, both show where they are.
        """
        if self.problem.following or self.problem.plant.observer is None:
            return []
        f = decide(replace(self.problem, following=True), laws_only=True, most=self.most).chosen
        count = len(f.terms)
        kept = [keep for size in {count, min(count, NAMEABLE)} - {0} for keep in combinations(range(count), size)]
        return [polish(self.problem, f.only(keep)) for keep in kept]

    def nothing_found(self, nominal: Fitted, singles: tuple[Fitted, ...]) -> Choice:
        """No term is worth its price."""
        verdict: Verdict = "consistent" if self.m.excess(self.baseline) < CONSISTENT_EXCESS else "unexplained"
        return Choice(verdict, self.baseline, self.baseline, nominal, singles, (), self.causes.terms, 1.0)

    def verdict(self, f: Fitted, polished: Sequence[Fitted]) -> Verdict:
        if self.m.is_adequate(f) and self.is_nameable(f):
            return "explained" if f.names else "parameter_change" if f.terms else "unexplained"
        named = bool(f.names) and self.is_nameable(f) and self.is_most_of_it(f, polished)
        return "partly_explained" if named else "unexplained"

    def is_changed_unit(self, f: Fitted) -> bool:
        """Whether all that an explanation brings are base parameters, and one that no effect is named after shows more
        than those that have grown into an effect.
        """
        if len(f.names) == len(f.terms) or any(term.kind == "effect" for term in f.terms):
            return False
        named, plain = [0.0], [0.0]
        for k, (term, values) in enumerate(zip(f.terms, f.values, strict=True)):
            shown = float(np.linalg.norm(change_without(self.problem, f, k)))
            (named if term.effect_name(values) else plain).append(shown)
        return max(plain) > max(named)

    def is_nameable(self, f: Fitted) -> bool:
        """Whether an explanation has few causes, each there beyond doubt and with the shape that tells it."""
        few = sum(term.kind == "effect" for term in f.terms) <= self.most
        return few and is_present(f) and are_themselves(f)

    def is_third_named(self, f: Fitted, two: Fitted | None, alike: Sequence[Fitted]) -> bool:
        """Whether three causes are named: they leave nothing and no others come near, or little beside two that were
        named without the third, of what these leave no other third takes much, or every other leaves far more.

        `two`: what was named, if anything. `alike`: what else was found.
        """
        if self.most < NAMEABLE or len(f.names) != NAMEABLE + 1 or not (is_present(f) and are_themselves(f)):
            return False
        others = [o.chi2 for o in alike if len(o.terms) == len(f.terms) and set(o.names) != set(f.names)]
        closest = min(others, default=self.baseline.chi2)
        if self.m.is_full(f):
            return excess(self.problem, closest) > PLAINLY * max(self.m.excess(f), SMALL_EXCESS)
        if two is None or len(two.names) != NAMEABLE or not set(two.names) < set(f.names) or is_strained(f):
            return False
        alone = two.chi2 - closest < MOST * (two.chi2 - f.chi2)
        alone = alone or excess(self.problem, closest) > FAR * self.m.excess(f)
        return alone and self.m.left(f) <= NEARLY_ALL

    def is_most_of_it(self, f: Fitted, polished: Sequence[Fitted]) -> bool:
        """Whether an explanation takes nearly all of the misfit, or most of it and no other name comes near it."""
        if is_strained(f):
            return False
        if self.m.left(f) <= NEARLY_ALL:
            return True
        others = [other.chi2 for other in polished if not set(other.names) & set(f.names)]
        closest = min(others, default=self.baseline.chi2)
        alone = excess(self.problem, closest) > PLAINLY * self.m.excess(f)
        return self.m.left(f) <= PART_TOLERANCE and alone

    def least_strained(self, best: Fitted, polished: Sequence[Fitted]) -> Fitted:
        """Instead of an explanation that is not what its name says, or is strained to its end, one nearly as good."""
        if self.m.is_adequate(best):
            wrong, most = _is_something_else, 2.0 * self.m.left(best)  # laws are no more exact than that
            others = [f for f in polished if self.m.is_adequate(f)]
        else:
            wrong, most = is_strained, min(NEARLY_ALL, MUCH_THE_SAME * self.m.left(best))
            others = list(polished)
        if not wrong(best):
            return best
        return min((f for f in others if self.m.left(f) <= most and not wrong(f)), key=self.m.cost, default=best)

    def rivals(self, best: Fitted, polished: Sequence[Fitted]) -> tuple[tuple[str, str], ...]:
        """Other names that the data cannot tell from the chosen ones, or from a change of parameters."""
        if not best.terms:
            return ()
        first, named = best.first_name, set(best.names)
        found = {(first, f.names[0]) for f in polished if f.names and self._is_rival(f, best)}
        for f in self.causes.second if len(best.names) == NAMEABLE else ():
            ours, theirs = named - set(f.names), set(f.names) - named
            if len(f.names) == NAMEABLE and len(ours) == len(theirs) == 1 and self._is_rival(f, best):
                found.add((ours.pop(), theirs.pop()))
        return tuple(sorted(found))

    def _is_rival(self, f: Fitted, best: Fitted) -> bool:
        """Whether an explanation brings another name and is as good."""
        return not set(f.names) <= set(best.names) and f.chi2 - best.chi2 < indistinguishable(best.chi2)


def _baseline(problem: Problem) -> Fitted:
    """The nominal model with base parameters moved as far as they may wander; as it is where it fits only with one that
    has moved farther.
    """
    nominal = nothing(problem)
    moved = roughly(problem, nominal)
    return nominal if has_drifted(problem, nominal, moved) and problem.prior.moved(moved.parameters) else moved


def has_drifted(problem: Problem, nominal: Fitted, moved: Fitted) -> bool:
    """Whether the nominal model is consistent with the recordings only with base parameters moved."""
    off = excess(problem, nominal.chi2) >= CONSISTENT_EXCESS and nominal.chi2 - moved.chi2 >= ALARM_GAIN
    return off and excess(problem, moved.chi2) < CONSISTENT_EXCESS


def _openness(verdict: Verdict) -> int:
    """How much a verdict leaves open."""
    return 1 + OPEN.index(verdict) if verdict in OPEN else 0


def _is_something_else(f: Fitted) -> bool:
    return not are_themselves(f)
