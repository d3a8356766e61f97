"""Choose between explanations: nothing, changed parameters, one effect, several, or none that is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from hil.diagnose.diagnosis import Verdict
from hil.diagnose.events import Events, held_commands, held_outputs, tone
from hil.diagnose.evidence import indistinguishable
from hil.diagnose.problem import Problem
from hil.diagnose.search import (
    Around,
    Fitted,
    around,
    from_other_shapes,
    nothing,
    polish,
    refine_all,
    roughly,
    screen,
)
from hil.diagnose.terms import Term, all_terms
from hil.physics.simulate import sub_steps

# The χ² that chance may give back to the best of all terms, with a margin; `python -m tests.proof.alarms` counts what
# gets through.
ALARM_GAIN = 60.0
# A misfit below this share of the noise variance is of no practical size.
SMALL_EXCESS = 0.03
_CONSISTENT_EXCESS = 2.0 * SMALL_EXCESS
# Laws of nature are not the laws of the library: an explanation may leave this share of the misfit, …
LAW_TOLERANCE = 0.04
# … and this share (rms) of the swing of the output, …
OUTPUT_TOLERANCE = 0.05
# … below this share, and this variance in units of the noise's, nobody looks for a second cause, …
FULL_TOLERANCE, FULL_EXCESS = 0.003, 1.0
# … and a second cause must explain most of what the first one leaves.
SECOND_SHARE = 0.7
# An explanation that leaves more than the tolerance of laws is still named as part of the truth when it leaves no
# more than this share, and every other one leaves so many times more, …
PART_TOLERANCE, ALONE_BY = 0.25, 1.5
# … or when it leaves so little that another name for it would have to look much the same.
NEARLY_ALL = 0.12
# Nearly as good is what leaves so many times as much.
_NEARLY_AS_GOOD = 1.1
# A base parameter this many standard uncertainties (of its prior) from its nominal value may have changed.
MOVED_SIGMAS = 3.0
# A value this many standard uncertainties from its null is there.
PRESENT_SIGMAS = 5.0
_INSIDE_SIGMAS = 2.0

_POLISHED = 2
_NEW_PHYSICS = 10.0
# An unknown costs so many times what it would if the laws of the library were those of nature (Schwarz: ln n).
_PRICE = 2.0
# The coarse grid of the screen must show this share of it before a second cause is fitted.
_HOPE = 0.3
_PAIR_SEEDS, _PAIR_TRIED, _NEAR = 2, 3, 0.5
# Beside an adequate first cause another one that leaves so many times as much is no first cause.
_FAR_BEHIND = 5.0
OPEN = ("unexplained", "partly_explained")
_OPENNESS = {"partly_explained": 1, "unexplained": 2}
# Events may leave so much: a tone has more harmonics, a held command a start between two samples.
TOLERANCE_OF_EVENTS = {"periodic_disturbance": 0.1, "dropout": 0.15}
# The share of the misfit that events must take before the rest is looked at again without them.
_WORTH_A_SECOND_LOOK = 0.3
# In short recordings every term is fitted, and more causes are tried while each takes this share of what is left.
_SHORT, _STEP_SHARE, _BEAM, _TRIED_NEXT, _MOST_CAUSES = 40_000, 0.2, 4, 6, 3
# So many causes may be named together; more of them describe, but anything can be described with enough of them.
_NAMEABLE = 2
# Beyond this share of the noise variance a rugged term may have ended in the wrong valley.
_ONLY_NOISE = 0.01
# A rough fit may still be so much above its least χ².
_SURELY = 0.95


@dataclass(frozen=True, slots=True)
class Choice:
    """What the evidence says.

    Attributes:
        verdict: the answer.
        chosen: terms and values, fitted together; no terms when nothing is to be named.
        baseline: the nominal model, base parameters moved within their prior.
        nominal: the nominal model as it is.
        candidates: single explanations that were fitted, best first.
        rivals: effect names that explain the data as well as the first chosen one.
        terms: everything that was looked for.
        left: the share of the misfit that the chosen explanation leaves.
        events: what happened at moments that no law foresees, if that explains what the library does not.
        part: such events that take a good part of the misfit and leave the rest open.
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


def decide(problem: Problem, *, laws_only: bool = False) -> Choice:
    """Search for the most economical explanation that the data support.

    Args:
        problem: the question.
        laws_only: look for no events.
    """
    return _Judge(problem, laws_only).choose()


def excess(problem: Problem, chi2: float) -> float:
    """Variance beyond the noise, as a share of it."""
    return max(chi2 / problem.size - 1.0, 0.0)


def share_left(problem: Problem, chi2: float, beyond: float) -> float:
    """The share that an explanation leaves of a misfit, given as variance beyond the noise."""
    return excess(problem, chi2) / max(beyond, SMALL_EXCESS)


def recognised(problem: Problem, models: Sequence[Fitted], beyond: float) -> tuple[Events | None, Events | None]:
    """Events that explain, beside one of these models, a misfit given as variance beyond the noise; or a part of it."""
    part: Events | None = None
    for beside in models:
        for events in (tone, held_outputs, held_commands):
            found = events(problem, beside)
            if found is None:
                continue
            left = share_left(problem, found.chi2, beyond)
            if left <= TOLERANCE_OF_EVENTS[found.name]:
                return found, None
            if left <= 1.0 - _WORTH_A_SECOND_LOOK and (part is None or found.chi2 < part.chi2):
                part = found
    return None, part


def healthy(choice: Choice) -> Choice:
    """The same search with nothing named."""
    return replace(choice, verdict="consistent", chosen=choice.baseline, rivals=(), left=1.0, events=None)


def _only(f: Fitted, keep: Sequence[int]) -> Fitted:
    """Some of the terms of an explanation."""
    return replace(f, terms=tuple(f.terms[k] for k in keep), values=tuple(f.values[k] for k in keep))


class _Judge:
    """One decision; holds what several questions share."""

    def __init__(self, problem: Problem, laws_only: bool) -> None:
        self.problem, self.laws_only = problem, laws_only
        self.size = problem.size
        self.baseline = roughly(problem, nothing(problem))
        self.terms = all_terms(problem, self.baseline.residuals)
        self.seconds: list[Fitted] = []
        outputs = zip(problem.experiments, problem.noises, strict=True)
        self.swing = sum(float(np.sum((e.output - e.output.mean()) ** 2)) / noise.std**2 for e, noise in outputs)

    def choose(self) -> Choice:
        # Around the nominal model: the baseline has bent its parameters to a misfit that is not theirs.
        nominal = nothing(self.problem)
        place = around(self.problem, nominal)
        singles = refine_all(place, screen(place, self.terms))
        free = roughly(self.problem, self.baseline, base_free=True)
        if self.baseline.chi2 - min(singles[0].chi2, free.chi2) < ALARM_GAIN:
            return self.nothing_found(nominal, singles)
        polished = self.polished(singles)
        known = [*polished, *self.changed_parameters(free, polished)]
        if self.baseline.chi2 - min(singles[0].chi2, *(f.chi2 for f in known)) < ALARM_GAIN:
            return self.nothing_found(nominal, singles)
        best = self.best_law(known, polished)
        if not best.terms and self.excess(self.baseline) < _CONSISTENT_EXCESS:
            return self.nothing_found(nominal, singles)
        verdict = self.verdict(best, polished)
        open_question = verdict in OPEN and not self.is_adequate(best)
        events, part = self.events(nominal) if open_question and not self.laws_only else (None, None)
        if events is not None and verdict == "partly_explained" and best.chi2 < events.chi2:
            events = None  # a law that leaves less says more
        if not self.is_full(best) and events is None:
            best = self.most_telling([best, *self.followed()], polished)
            verdict = self.verdict(best, polished)
        if verdict in OPEN and not self.is_adequate(best) and events is None and self.is_short():
            best = self.most_telling([best, self.deeper(best, place)], polished)
            verdict = self.verdict(best, polished)
        return Choice(
            verdict, best, self.baseline, nominal, tuple(singles),
            self.rivals(best, polished), self.terms, self.left(best), events, part,
        )  # fmt: skip

    def best_law(self, known: Sequence[Fitted], polished: Sequence[Fitted]) -> Fitted:
        """The most economical explanation of one cause or two, at its lowest, and least strained."""
        best = min(known, key=self.cost)
        if not self.is_full(best):
            best = min([best, *self.pairs(self.seeds(best, polished))], key=self.cost)
        if not self.is_full(best) and len(best.terms) == _NAMEABLE:  # the first was found when the second was not known
            best = min([best, *self.pairs([self._alone(best, 1)])], key=self.cost)
        if self.excess(best) > _ONLY_NOISE:
            best = from_other_shapes(self.problem, best)
        return best if self.is_adequate(best) else self.least_strained(best, polished)

    def events(self, nominal: Fitted) -> tuple[Events | None, Events | None]:
        """Events beside the unit as it was, or with its parameters moved: they bend to what no parameter has done."""
        return recognised(self.problem, (nominal, self.baseline), self.excess(self.baseline))

    def most_telling(self, found: Sequence[Fitted], polished: Sequence[Fitted]) -> Fitted:
        """Of explanations what can be named rather than what cannot, and then the most economical."""
        return min(found, key=lambda f: (_OPENNESS.get(self.verdict(f, polished), 0), self.cost(f)))

    def followed(self) -> list[Fitted]:
        """What a search finds whose simulations are led back to the recordings; nothing where no observer leads them.

        A plant that integrates adds up what is missing: a second cause shows in its output only when the first one is
        right. Led back, both show where they are.
        """
        if self.problem.following or self.problem.plant.observer is None:
            return []
        f = decide(replace(self.problem, following=True), laws_only=True).chosen
        kept = [
            range(len(f.terms)),
            *(combinations(range(len(f.terms)), _NAMEABLE) if len(f.terms) > _NAMEABLE else ()),
        ]
        return [polish(self.problem, _only(f, keep)) for keep in kept if f.terms]

    def nothing_found(self, nominal: Fitted, singles: Sequence[Fitted]) -> Choice:
        """No term is worth its price."""
        verdict: Verdict = "consistent" if self.excess(self.baseline) < _CONSISTENT_EXCESS else "unexplained"
        return Choice(verdict, self.baseline, self.baseline, nominal, tuple(singles), (), self.terms, 1.0)

    # -- measures ------------------------------------------------------------------------------------------

    def excess(self, f: Fitted) -> float:
        """Variance that an explanation leaves beyond the noise, as a share of it."""
        return excess(self.problem, f.chi2)

    def left(self, f: Fitted) -> float:
        """The share of the misfit that an explanation leaves."""
        return share_left(self.problem, f.chi2, self.excess(self.baseline))

    def cost(self, f: Fitted) -> float:
        """χ² and the price of unknowns; physics that the nominal model lacks costs more than what it has."""
        added = sum(term.kind == "effect" for term in f.terms)
        return f.chi2 + f.unknowns * _PRICE * float(np.log(self.size)) + added * _NEW_PHYSICS

    def is_full(self, f: Fitted) -> bool:
        excess = self.excess(f)
        return excess <= SMALL_EXCESS or (excess <= FULL_EXCESS and self.left(f) <= FULL_TOLERANCE)

    def is_adequate(self, f: Fitted) -> bool:
        """Whether an explanation leaves little of the misfit and, where that is most of the output, little of that."""
        little = self.left(f) <= LAW_TOLERANCE and self.excess(f) * self.size <= OUTPUT_TOLERANCE**2 * self.swing
        return self.excess(f) <= SMALL_EXCESS or little

    # -- hypotheses ----------------------------------------------------------------------------------------

    def changed_parameters(self, free: Fitted, polished: Sequence[Fitted]) -> list[Fitted]:
        """The base parameters alone: which of them must have changed, and how well that explains.

        No answer where all of them together, `free`, leave more than an effect does.
        """
        if polished and _SURELY * free.chi2 > min(self.cost(f) for f in polished):
            return []
        names = self._moved(free.parameters)
        fitted = polish(self.problem, self._parameter_terms(free, names))
        while len(names) > 1 and (spare := self._dispensable(fitted)):
            names = [name for name in names if name != spare]
            fitted = polish(self.problem, self._parameter_terms(fitted, names))
        return [fitted]

    def _dispensable(self, f: Fitted) -> str:
        """The changed parameter that costs least to put back, if that is less than its price."""
        assert f.estimate is not None  # noqa: S101
        prices = {}
        for term, values in zip(f.terms, f.values, strict=True):
            std = float(f.estimate.std[f.estimate_index(term)])
            prices[term.name] = ((values[0] - term.nominal) / std) ** 2 if std > 0.0 else np.inf
        name = min(prices, key=lambda name: prices[name])
        return name if prices[name] < ALARM_GAIN else ""

    def _moved(self, parameters: dict[str, float]) -> list[str]:
        nominal = self.problem.model.values
        stds = self.problem.prior_std
        return [
            p.name
            for p, std in zip(self.problem.base, stds, strict=True)
            if abs(parameters[p.name] - nominal[p.name]) > MOVED_SIGMAS * std
        ]

    def _parameter_terms(self, at: Fitted, names: Sequence[str]) -> Fitted:
        terms = tuple(t for t in self.terms if t.kind == "parameter" and t.name in names)
        values = tuple((at.parameters[t.name],) for t in terms)
        return Fitted(terms, values, at.parameters, at.chi2, at.residuals)

    def polished(self, singles: Sequence[Fitted]) -> list[Fitted]:
        """The best few single explanations of different names, fitted with nothing linearised."""
        seen: set[str] = set()
        found = []
        for f in singles:
            name = f.names[0] if f.names else f.terms[0].name
            if name in seen:
                continue
            seen.add(name)
            found.append(polish(self.problem, f))
            if len(found) == _POLISHED:
                break
        return [f for f in found if self.is_present(f)]

    def is_present(self, f: Fitted) -> bool:
        """Whether every effect is really there: its strength differs from its null beyond doubt."""
        return all(self._strength(f, term) for term in f.terms)

    def _strength(self, f: Fitted, term: Term) -> bool:
        if term.kind == "parameter" or not np.isfinite(term.null) or f.estimate is None:
            return True
        k = f.estimate_index(term)
        std = f.estimate.std_holding(k, range(k + 1, k + len(term.unknowns)))  # how large it is, not which shape
        return not abs(f.estimate.values[k] - term.null) < PRESENT_SIGMAS * std

    def seeds(self, best: Fitted, polished: Sequence[Fitted]) -> list[Fitted]:
        """First causes worth a second one: where one of them is adequate, those that are not far behind it."""
        far = _FAR_BEHIND * self.excess(best) if self.is_adequate(best) else np.inf
        return [f for f in polished if self.excess(f) <= far]

    def pairs(self, seeds: Sequence[Fitted]) -> list[Fitted]:
        """A second cause beside each of the best first ones, where it explains most of what they leave."""
        found: list[Fitted] = []
        for seed in seeds[:_PAIR_SEEDS]:
            if any(self.is_full(both) for both in found):
                break
            place = around(self.problem, seed)
            screened = screen(place, self.others(seed))
            if self._gain(seed, screened[0].chi2) < _HOPE:
                continue
            rough = [roughly(self.problem, f) for f in self._near_best(seed, refine_all(place, screened))]
            self.seconds += rough
            best = self._most_economical(rough)
            if self._gain(seed, best.chi2) >= _NEAR * SECOND_SHARE:
                best = polish(self.problem, best)
                found += [best] if self._is_pair(best, seed) else []
        return found

    def _alone(self, f: Fitted, k: int) -> Fitted:
        """One term of an explanation, as it is there."""
        one = _only(f, [k])
        r = self.problem.residuals(f.parameters, [*self.problem.model.active_effects, *one.effects])
        return replace(one, chi2=float(r @ r), residuals=r, estimate=None)

    def _most_economical(self, fits: Sequence[Fitted]) -> Fitted:
        """Of those as good as the best, the one with the fewest unknowns."""
        least = min(f.chi2 for f in fits)
        tied = [f for f in fits if f.chi2 - least < indistinguishable(least)]
        return min(tied, key=lambda f: (f.unknowns, f.chi2))

    def _near_best(self, seed: Fitted, refined: Sequence[Fitted]) -> list[Fitted]:
        """The second causes, linearised, that may turn out best: of different names, near the first one."""
        most = self._gain(seed, refined[0].chi2)
        distinct: dict[str, Fitted] = {}
        for f in refined:
            if self._gain(seed, f.chi2) >= _NEAR * most:
                distinct.setdefault(f.names[-1] if f.names else "", f)
        return list(distinct.values())[:_PAIR_TRIED]

    def _is_pair(self, both: Fitted, seed: Fitted) -> bool:
        better = self._gain(seed, both.chi2) >= SECOND_SHARE and seed.chi2 - both.chi2 > ALARM_GAIN
        return better and self.is_present(both)

    def others(self, f: Fitted) -> list[Term]:
        """The terms that an explanation does not have yet, with starts from what it leaves."""
        taken = {(term.name, term.hook) for term in f.terms}
        return [term for term in all_terms(self.problem, f.residuals) if (term.name, term.hook) not in taken]

    def is_short(self) -> bool:
        """Whether fits are so quick that hundreds of them are affordable."""
        plant, experiments = self.problem.plant, self.problem.experiments
        steps = sum(e.drive.inputs.shape[1] * sub_steps(plant, e.drive.interval_s) for e in experiments)
        return bool(steps <= _SHORT)

    def deeper(self, best: Fitted, place: Around) -> Fitted:
        """The best description with several causes, each of which takes a good share of what the others leave.

        Nothing is linearised: where the nominal model is far off, a cause shows only after all else has moved.
        """
        level = self._few([best, *self._grown(place, len(self.terms))])
        for _ in range(_MOST_CAUSES):
            best = min([best, *level[:1]], key=self.cost)
            if self.is_full(best):
                break
            level = self._few([f for parent in level for f in self._children(parent)])
            if not level:
                break
        return best

    def _children(self, parent: Fitted) -> list[Fitted]:
        grown = self._grown(around(self.problem, parent), _TRIED_NEXT)
        return [f for f in grown if self._gain(parent, f.chi2) >= _STEP_SHARE]

    def _grown(self, place: Around, most: int) -> list[Fitted]:
        parent = place.accepted
        screened = screen(place, [term for term in self.others(parent) if term.kind == "effect"])
        starts = [
            Fitted((*parent.terms, s.term), (*parent.values, s.starts[0]), parent.parameters, s.chi2, parent.residuals)
            for s in screened[:most]
        ]
        return [polish(self.problem, start) for start in starts]

    def _few(self, found: Sequence[Fitted]) -> list[Fitted]:
        """The best few that are not the same terms."""
        distinct: dict[frozenset[tuple[str, str]], Fitted] = {}
        for f in sorted(found, key=lambda f: f.chi2):
            distinct.setdefault(frozenset((t.name, t.hook) for t in f.terms), f)
        return list(distinct.values())[:_BEAM]

    def _gain(self, seed: Fitted, chi2: float) -> float:
        """The share of what an explanation leaves that another χ² would take away."""
        return (seed.chi2 - chi2) / max(self.excess(seed) * self.size, 1e-12)

    # -- the answer ----------------------------------------------------------------------------------------

    def verdict(self, f: Fitted, polished: Sequence[Fitted]) -> Verdict:
        if self.is_adequate(f) and self.is_nameable(f):
            return "explained" if f.names else "parameter_change" if f.terms else "unexplained"
        named = bool(f.names) and self.is_nameable(f) and self.is_most_of_it(f, polished)
        return "partly_explained" if named else "unexplained"

    def is_nameable(self, f: Fitted) -> bool:
        """Whether an explanation has few causes, each there beyond doubt and with the shape that tells it."""
        few = sum(term.kind == "effect" for term in f.terms) <= _NAMEABLE
        return few and self.is_present(f) and all(self._is_itself(f, term) for term in f.terms)

    def _is_itself(self, f: Fitted, term: Term) -> bool:
        """Whether the shapes that tell an effect from others are beyond doubt inside their range."""
        if f.estimate is None:
            return True
        first = f.estimate_index(term)
        return all(
            min(f.estimate.values[k] - u.low, u.high - f.estimate.values[k]) > _INSIDE_SIGMAS * f.estimate.std[k]
            for k, u in enumerate(term.unknowns, first)
            if u.name in term.telling
        )

    def is_most_of_it(self, f: Fitted, polished: Sequence[Fitted]) -> bool:
        """Whether an explanation takes nearly all of the misfit, or most of it and no other name comes near it."""
        if self.is_strained(f):
            return False
        if self.left(f) <= NEARLY_ALL:
            return True
        others = [other.chi2 for other in polished if not set(other.names) & set(f.names)]
        closest = min(others, default=self.baseline.chi2)
        alone = excess(self.problem, closest) > ALONE_BY * self.excess(f)
        return self.left(f) <= PART_TOLERANCE and alone

    def is_strained(self, f: Fitted) -> bool:
        """Whether a shape had to go to the end of what is physical, where that is not simply its absence."""
        return any(
            k > 0 and value != 0.0 and u.at_bound(value)
            for term, own in zip(f.terms, f.values, strict=True)
            for k, (value, u) in enumerate(zip(own, term.unknowns, strict=True))
        )

    def least_strained(self, best: Fitted, polished: Sequence[Fitted]) -> Fitted:
        """Instead of an explanation strained to its end another one that is nearly as good without."""
        most = min(NEARLY_ALL, _NEARLY_AS_GOOD * self.left(best))
        others = [f for f in polished if self.left(f) <= most and not self.is_strained(f)]
        return min(others, key=self.cost) if self.is_strained(best) and others else best

    def rivals(self, best: Fitted, polished: Sequence[Fitted]) -> tuple[tuple[str, str], ...]:
        """Other names that the data cannot tell from the chosen ones, or from a change of parameters."""
        if not best.terms:
            return ()
        first = best.names[0] if best.names else "parameter_change"
        found = {(first, f.names[0]) for f in polished if f.names and self._is_rival(f, best)}
        if len(best.names) == _NAMEABLE:
            same = [f for f in self.seconds if len(f.names) == _NAMEABLE and f.names[0] == first]
            found |= {(best.names[1], f.names[1]) for f in same if self._is_rival(f, best)}
        return tuple(sorted(found))

    def _is_rival(self, f: Fitted, best: Fitted) -> bool:
        """Whether an explanation brings another name and is as good."""
        return not set(f.names) <= set(best.names) and f.chi2 - best.chi2 < indistinguishable(best.chi2)
