"""From a problem to its table: sets of causes from the search, events among them, and the first row."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hil.diagnosis.events.coarse import cuts_off
from hil.diagnosis.events.event import Events
from hil.diagnosis.events.least_trimmed_squares import least_trimmed_squares
from hil.diagnosis.events.lost_commands import comes_every_time, held_commands
from hil.diagnosis.events.repeats import held_outputs, misfit_while_stale
from hil.diagnosis.events.tone import tone
from hil.diagnosis.intake.problem import Problem, pose
from hil.diagnosis.search.beam import Search
from hil.diagnosis.search.effort import EFFORT
from hil.diagnosis.search.fits import finished, fit
from hil.diagnosis.search.fitted import Fitted, evaluated, nothing
from hil.diagnosis.search.probes import keys
from hil.diagnosis.search.terms import all_terms
from hil.diagnosis.thresholds import TINY
from hil.diagnosis.verdict.choice import Choice
from hil.diagnosis.verdict.refuted import is_another_effect, refuted
from hil.diagnosis.verdict.score import Hypothesis, Noise, Row, Table, score, table
from hil.diagnosis.verdict.within_prior import is_within_prior
from hil.identification.preparation.experiment import Experiment
from hil.language.words import marked
from hil.record.recording import Array
from hil.signals.colour import colour_factor

# Of events is estimated how often they come and how long they last.
_OF_EVENTS = 2


@dataclass(frozen=True, slots=True)
class Option:
    """A set of causes that was fitted.

    Attributes:
        problem: the question, without the events that were taken out of the recordings.
        fitted: laws and parameters. `events`: beside them.
        residuals: whitened, with all of it. `chi2`: of them and the prior.
    """

    problem: Problem
    fitted: Fitted
    events: tuple[Events, ...]
    residuals: Array
    chi2: float

    def to_its_end(self) -> Option:
        """Refits with tight tolerances; what rounding may have done counts as before."""
        if len(self.own.terms) < len(self.fitted.terms):
            return self
        f, fitted = self.fitted, finished(replace(self.problem, step=0.0), _as_reported(self))
        falls = min(fitted.chi2 - f.chi2, 0.0) if self.problem.step <= 0.0 else 0.0
        residuals = fitted.residuals if self.residuals is f.residuals else self.residuals
        return replace(self, fitted=fitted, residuals=residuals, chi2=self.chi2 + falls)

    def hypothesis(self, known: Sequence[str]) -> Hypothesis:
        """As the table has it; `known`: names of events that were read off the recordings themselves."""
        names, changed, unknowns = as_named(self.problem, self.own)
        events, described = [e.name for e in self.events], len(self.fitted.terms) - len(self.own.terms)
        freed = len(self.freed)
        return Hypothesis(
            tuple(dict.fromkeys((*known, *events, *names))), self.chi2,
            len(events) + len(names) + len(changed) + described + freed,
            unknowns + self.fitted.unknowns - self.own.unknowns + _OF_EVENTS * len(events) + freed, changed,
            described > 0, freed,
        )  # fmt: skip

    @property
    def freed(self) -> Sequence[str]:
        """Parameters that have to have moved for its effects: each is a cause, as where it is named, or bent before."""
        has_effects = any(t.kind == "effect" for t in self.fitted.terms)
        return moved_too_far(self.problem, self.fitted) if has_effects else ()

    @property
    def own(self) -> Fitted:
        """Those of its terms that are what their names say; the others only describe."""
        f = self.fitted
        return f.only([k for k, (t, v) in enumerate(f.pairs) if not is_another_effect(t, v)])

    @property
    def is_degenerate(self) -> bool:
        """Whether one of its terms has ended at nothing: then it is another option."""
        return any(t.is_nothing(v) for t, v in self.fitted.pairs)


def as_named(problem: Problem, f: Fitted) -> tuple[tuple[str, ...], tuple[str, ...], int]:
    """What a set says: effects, changed parameters, and the number of their unknowns.

    Half a step of a converter that cuts off is not in it, nor a size that the model has and was never sure of. Where
    parameters alone have changed, and one that no effect is named after is among them, all are told as parameters;
    beside no effect those that moved farther than they may wander are among them.
    """
    there = [
        (t, v)
        for t, v in f.pairs
        if not (is_within_prior(problem.model, t, v) or (t.name == "sensor_offset" and cuts_off(f, problem.step)))
    ]
    names = [t.effect_name(v) for t, v in there]
    moved = () if any(t.kind == "effect" for t, _ in there) else tuple(moved_too_far(problem, f))
    plain = all(t.kind == "parameter" for t, _ in there) and (bool(moved) or not all(names))
    effects = tuple(dict.fromkeys(name for name in names if name and not plain))
    changed = tuple(t.name for (t, _), name in zip(there, names, strict=True) if plain or not name)
    return effects, (*changed, *moved), sum(len(t.unknowns) for t, _ in there) + len(moved)


def moved_too_far(problem: Problem, f: Fitted) -> list[str]:
    """Parameters that are no terms of a set and lie farther off than they may wander: these have changed."""
    terms = {t.name for t in f.terms if t.kind == "parameter"}
    return [name for name in problem.prior.moved(f.parameters) if name not in terms]


@dataclass(frozen=True)
class Scoring:
    """The one score, as a search takes it.

    Attributes:
        events: S of the best event beside the nominal model and no law, were noise as small as it may be.
    """

    problem: Problem
    noise: Noise
    events: Callable[[], float] = lambda: math.inf

    def of(self, f: Fitted, least: float) -> float:
        """S of a set by itself."""
        names, changed, unknowns = as_named(self.problem, f)
        return score(self.noise, self.noise.left(f.chi2, least), len(names) + len(changed), unknowns)

    def is_enough(self, f: Fitted, size: int) -> bool:
        """Whether no set of so many causes could be worth more, were noise as small as it may be."""
        least = score(self.noise, 0.0, size, size)
        return self.of(f, 0.0) <= least or (size > 1 and self.events() <= least)

    def is_within_noise(self, f: Fitted) -> bool:
        """Whether what it leaves is within what noise may be."""
        return self.noise.left(f.chi2, f.chi2) <= 0.0


class Explanation:
    """One problem explained.

    Args:
        problem: the question.
        known: names of events that were read off the recordings themselves.
    """

    def __init__(self, problem: Problem, known: Sequence[str] = ()) -> None:
        self.problem, self.known = problem, tuple(known)
        self.options: list[Option] = []
        self.terms = all_terms(problem, problem.nominal_residuals)
        names = {t.reported_name if t.kind == "effect" else t.name for t in self.terms}
        self.scoring = Scoring(problem, self._noise(1.0, len(names)), self._best_alone)

    def choice(self) -> tuple[Problem, Choice]:
        """Search, look for events, and read the table: the first row, and the question that it answers."""
        search = Search(self.problem, self.scoring)
        search.run()
        self._led_back(search)
        self._keep(search, ())
        self._events(self.problem, ())
        return self._first()

    # -- what is tried -----------------------------------------------------------------------------------

    def _keep(self, search: Search, events: tuple[Events, ...]) -> None:
        """The sets of a search, given events that were taken out of the recordings."""
        rest = search.problem.experiments
        for f in (nothing(search.problem), *search.fits.values()):
            lost = misfit_while_stale(self.problem, rest, f.residuals)
            self.options.append(Option(search.problem, f, events, f.residuals, f.chi2 + float(lost @ lost)))

    @cached_property
    def _alone(self) -> list[tuple[Fitted, Events]]:
        """Events beside the nominal model."""
        return recognised(self.problem, [nothing(self.problem)])

    def _best_alone(self) -> float:
        """S of the best of them, were noise as small as it may be."""
        noise, found = self.scoring.noise, [e.chi2 for _, e in self._alone]
        return min((score(noise, noise.left(chi2, 0.0), 1, _OF_EVENTS) for chi2 in found), default=math.inf)

    def _led_back(self, search: Search) -> None:
        """Sets from simulations that are led back to the recordings, where the plant has an observer.

        A plant that integrates adds up what is missing: a second cause shows in its output only when the first one is
        right. Led back, both show where they are.
        """
        problem = self.problem
        best = search.first
        if problem.plant.observer is None or self.scoring.is_enough(best, 1 + len(best.terms)):
            return
        if not problem.work.leaves_out(marked("a led-back search")):
            led = Search(replace(problem, following=True), self.scoring)
            led.run()
            search.also([f for f in led.ranked() if f.terms][: 2 * EFFORT.beam])

    def _events(self, problem: Problem, before: tuple[Events, ...]) -> None:
        """Events beside the unit and the best laws; and laws without them, where they may tell more than laws alone."""
        laws = [o for o in self._ranked() if o.problem is problem and o.events == before]
        if replace(self.scoring, events=Scoring.events).is_enough(laws[0].fitted, 1 + len(laws[0].fitted.terms)):
            return
        unit = next(o.fitted for o in laws if not o.fitted.terms)
        models = [unit, *([laws[0].fitted] if laws[0].fitted.terms else [])]
        if self.table().first.is_open and (law := least_trimmed_squares(problem, [o.fitted for o in laws])) is not None:
            models.append(law)
        alone = self._alone if problem is self.problem else recognised(problem, [nothing(problem)])
        found = [
            Option(problem, model, (*before, e), e.residuals, e.chi2 + _prior_cost(model))
            for model, e in (*alone, *recognised(problem, models))
            if e.name not in (b.name for b in before)
        ]
        is_open = self.table().first.is_open
        self.options += found
        best = min(found, key=self._score, default=None)
        if best is None or problem.work.leaves_out(marked("laws beside events")):
            return
        if is_open or self._score(best) < self._score(laws[0]):
            search = Search(posed_again(problem, best.events[-1].rest), self.scoring)
            search.run()
            self._keep(search, best.events)
            if len(best.events) < EFFORT.events:
                self._events(search.problem, best.events)
            else:
                self._events_first(best.events[-1])

    def _events_first(self, last: Events) -> None:
        """What was found first had bent to commands that were lost: it is looked for again where these are known."""
        pairs = list(zip(self.problem.experiments, last.rest, strict=True))
        if all(np.array_equal(e.drive.inputs, rest.drive.inputs) for e, rest in pairs):
            return
        again = posed_again(self.problem, tuple(replace(e, drive=rest.drive) for e, rest in pairs))
        unit = fit(again, nothing(again), steps=EFFORT.fine)
        self.options.append(Option(again, unit, (last,), unit.residuals, unit.chi2))
        self._events(again, (last,))

    # -- what it is worth --------------------------------------------------------------------------------

    def _noise(self, colour: float, names: int) -> Noise:
        """What noise alone leaves."""
        problem = self.problem
        return Noise(problem.expected, 1.0, 1.0 + problem.noise_uncertainty, problem.size / colour, names)

    def table(self) -> Table:
        """All options, and something unknown beside each."""
        by_chi2 = sorted((o for o in self.options if not o.is_degenerate), key=lambda o: o.chi2)
        noise = self._noise(colour_factor(by_chi2[0].residuals), self.scoring.noise.names)
        by_news = sorted(by_chi2, key=lambda o: len(o.events) + sum(t.is_new for t in o.fitted.terms))
        return table(noise, [o.hypothesis(self.known) for o in by_news])

    def _score(self, option: Option) -> float:
        h, noise = option.hypothesis(self.known), self.scoring.noise
        return score(noise, noise.left(h.chi2, min(o.chi2 for o in self.options)), h.causes, h.unknowns)

    def _ranked(self) -> list[Option]:
        return sorted(self.options, key=self._score)

    # -- what is read ------------------------------------------------------------------------------------

    def _first(self) -> tuple[Problem, Choice]:
        """The first row, fitted to its end, but for what the recordings themselves refute."""
        ended: list[Option] = []
        while True:
            printed = self.table()
            option = self._of(printed.first)
            wrong = refuted(option.problem, option.fitted)
            if wrong:
                self.options = [o for o in self.options if not keys(o.fitted) & wrong]
            elif any(option is o for o in ended):
                return self._read(printed, self._as_recorded(option))
            else:
                ended.append(option.to_its_end())
                self.options = [ended[-1] if o is option else o for o in self.options]

    def _as_recorded(self, option: Option) -> Option:
        """The same in the recordings as they are, where it names events alone: that fit is what the operator has."""
        if option.fitted.terms or not option.events:
            return option
        own = option.hypothesis(self.known)
        same = [o for o in self.options if o.problem is self.problem and not o.fitted.terms and o.events]
        alike = (o for o in same if replace(o.hypothesis(self.known), chi2=own.chi2) == own)
        return min(alike, key=lambda o: o.chi2, default=option)

    def _of(self, row: Row) -> Option:
        named = (o for o in self.options if not o.is_degenerate)
        same = [o for o in named if o.hypothesis(self.known) == row.hypothesis]
        return min(same, key=lambda o: o.chi2)

    def _read(self, printed: Table, option: Option) -> tuple[Problem, Choice]:
        first, problem = printed.first, replace(option.problem, step=0.0)
        chosen = option.fitted if not first.hypothesis.is_open else finished(problem, option.own)
        unit = min((o for o in self.options if _is_unit(o) and o.problem is option.problem), key=lambda o: o.chi2)
        whole = min(o.chi2 for o in self.options if _is_unit(o) and not o.events)
        baseline = nothing(problem) if moved_too_far(problem, unit.fitted) else _seen_in(problem, unit)
        ranked = [o.fitted for o in self._ranked() if o.fitted.terms and o.problem is option.problem]
        near = [self._of(r) for r in printed.ambiguous]
        share = max(first.hypothesis.chi2 - printed.chi2, 0.0) / max(whole - printed.chi2, TINY)
        names = {name for r in printed.rows for name in r.hypothesis.named}
        is_beside = option.residuals is not option.fitted.residuals  # events that no fit has taken into account
        return problem, Choice(
            first.verdict, chosen if chosen.terms else baseline, baseline, nothing(problem), tuple(ranked),
            printed.alternatives, self.terms, min(share, 1.0), alike=printed.alike,
            chances={name: printed.chance(name) for name in sorted(names)}, events=option.events,
            residuals=option.residuals if is_beside else None, table=printed,
            twins=tuple(o.fitted for o in near if o.problem is option.problem),
        )  # fmt: skip


def recognised(problem: Problem, models: Sequence[Fitted]) -> list[tuple[Fitted, Events]]:
    """Events of each kind beside each model; what comes with every jump beside the nominal one is no lost command."""
    lost = not comes_every_time(problem, nothing(problem))
    kinds = (tone, held_outputs, held_commands) if lost else (tone, held_outputs)
    looked = [(model, look(problem, model)) for model in models for look in kinds]
    return [(model, found) for model, found in looked if found is not None]


def explained(problem: Problem, known: Sequence[str] = ()) -> tuple[Problem, Choice]:
    """The question without the events that are named, and the answer to it.

    Args:
        problem: the question.
        known: names of events that were read off the recordings themselves.
    """
    return Explanation(problem, known).choice()


def posed_again(problem: Problem, experiments: tuple[Experiment, ...]) -> Problem:
    """The same question of the experiments on another clock, or without events."""
    again = replace(pose(problem.model, experiments), refuted=problem.refuted, work=problem.work, step=problem.step)
    return replace(again, factor=problem.factor, observed_noise=problem.observed_noise, is_own=problem.is_own)


def _as_reported(option: Option) -> Fitted:
    """The laws of an option, parameters as what they are told, those that have moved too far among them."""
    f, problem = option.fitted, option.problem
    names, changed, _ = as_named(problem, f)
    if names:
        return f
    missing = set(changed) - {t.name for t in f.terms}
    terms = tuple(t for t in all_terms(problem, f.residuals) if t.kind == "parameter" and t.name in missing)
    values = tuple((f.parameters[t.name],) for t in terms)
    return replace(f, terms=(*f.terms, *terms), values=(*f.values, *values)).as_change


def _is_unit(option: Option) -> bool:
    return not option.fitted.terms


def _prior_cost(f: Fitted) -> float:
    return f.chi2 - float(f.residuals @ f.residuals)


def _seen_in(problem: Problem, unit: Option) -> Fitted:
    """The unit as it is, where what rounding may have done counts too."""
    if problem.step == unit.problem.step:
        return unit.fitted
    seen = evaluated(problem, unit.fitted)
    return replace(seen, chi2=seen.chi2 + _prior_cost(unit.fitted))
