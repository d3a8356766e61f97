"""Events and laws beside each other: what happened is taken out of the recordings, and the rest is looked at again."""

from __future__ import annotations

from dataclasses import dataclass, replace

from hil.diagnosis.causes import NAMEABLE
from hil.diagnosis.decide import OPEN, Choice, decide
from hil.diagnosis.events.event import Events
from hil.diagnosis.events.recognise import recognised
from hil.diagnosis.events.undisturbed import undisturbed
from hil.diagnosis.measures import LAW_TOLERANCE, SMALL_EXCESS, excess
from hil.diagnosis.problem import Problem, pose
from hil.diagnosis.search.fitted import Fitted, evaluated
from hil.diagnosis.yardsticks import A_GOOD_PART
from hil.identification.experiment import Experiment
from hil.record.recording import Array

# Events and a law beside them are looked for so often.
_LOOKS = 2


@dataclass(frozen=True, slots=True)
class Happened:
    """Events, and the answer to what is left without them.

    Attributes:
        events: what happened; none where laws say it all.
        problem: the question without the events beside which there is something more.
        choice: the answer to it. Its own events, the last of `events`, are not taken out.
    """

    events: tuple[Events, ...]
    problem: Problem
    choice: Choice

    @property
    def residuals(self) -> Array:
        """Whitened, with everything that was found."""
        return self.events[-1].residuals if self.events else self.choice.chosen.residuals

    @property
    def replaces_laws(self) -> bool:
        """Whether events are there instead of what laws say, not beside it."""
        return any(events is self.choice.events for events in self.events)

    def also(self, events: Events) -> Happened:
        """One more kind of event; its residuals are with all of them."""
        return replace(self, events=(*self.events, events))

    def with_another(self, events: Events, before: Events) -> Happened:
        """More of the same events, in the place of those found before."""
        choice = replace(self.choice, events=events) if before is self.choice.events else self.choice
        return Happened(tuple(events if e is before else e for e in self.events), self.problem, choice)

    def instead(self, choice: Choice) -> Happened:
        """Another answer to the same question; only events that are taken out stay."""
        return Happened(tuple(e for e in self.events if e is not self.choice.events), self.problem, choice)


def happened(problem: Problem, choice: Choice) -> Happened:
    """What there is of events in an answer, or beside it."""
    alone = Happened(() if choice.events is None else (choice.events,), problem, choice)
    found = _beside_each_other(problem, choice)
    if found is None or (alone.events and len(found.events) == 1 and not found.choice.chosen.terms):
        return alone
    return found


def posed_again(problem: Problem, experiments: tuple[Experiment, ...]) -> Problem:
    """The same question of the experiments on another clock, or without events."""
    again = pose(problem.model, experiments)
    again = replace(again, refuted=problem.refuted, work=problem.work)
    return replace(again, factor=problem.factor, observed_noise=problem.observed_noise)


def _beside_each_other(problem: Problem, choice: Choice) -> Happened | None:
    """Events, and what explains the rest, or most of it, when they are taken out; None where that stays open.

    A law hides some of the events, and they distort the law: where it explains most of the rest, they are looked for
    beside it once more. Where the events alone explain too little, the law explains the rest if what both leave
    together is within the tolerance of laws.
    """
    most = LAW_TOLERANCE * excess(problem, choice.baseline.chi2) if choice.events is None else 0.0
    events = _first(problem, choice)
    looks = 0
    while events is not None and not problem.work.leaves_out("a law beside events"):
        looks += 1
        rest = posed_again(problem, events.rest)
        found = decide(rest, laws_only=True, most=NAMEABLE - 1)
        if found.verdict == "partly_explained" and excess(rest, found.chosen.chi2) <= most:
            found = replace(found, verdict="explained")
        if found.verdict not in OPEN:
            return Happened((replace(events, residuals=found.chosen.residuals),), rest, found)
        if (other := _of_another_kind(rest, found, events)) is not None:
            return Happened((replace(events, residuals=other.residuals), other), rest, replace(found, events=other))
        if found.verdict == "unexplained":
            return None
        if looks == _LOOKS:
            large = excess(rest, found.baseline.chi2) >= A_GOOD_PART  # of the noise's variance
            return Happened((replace(events, residuals=found.chosen.residuals),), rest, found) if large else None
        events = _beside_law(problem, evaluated(problem, found.chosen))
    return None


def _first(problem: Problem, choice: Choice) -> Events | None:
    """Events beside which there is something more: they leave more than noise, or are a good part of what is open.

    Where laws explain what they should, but leave more than noise, there may be a tone beside them.
    """
    if choice.events is not None:
        return choice.events if excess(problem, choice.events.chi2) > SMALL_EXCESS else None
    left = excess(problem, choice.chosen.chi2)
    if left <= SMALL_EXCESS:
        return None
    is_open = choice.verdict in OPEN
    law = undisturbed(problem, choice.candidates) if is_open else None
    beside = recognised(problem, (choice.chosen if law is None else law,), left, commands=is_open)
    found = (*beside, choice.part) if is_open else beside
    return min((e for e in found if e is not None), key=lambda e: e.chi2, default=None)


def _of_another_kind(rest: Problem, found: Choice, events: Events) -> Events | None:
    """Events of another kind that explain what is left without the first ones."""
    models = (found.nominal, found.baseline)
    whole, _ = recognised(rest, models, excess(rest, found.baseline.chi2), commands=events.name != "dropout")
    return whole if whole is not None and whole.name != events.name else None


def _beside_law(problem: Problem, law: Fitted) -> Events | None:
    """Events that explain all or a part of what a law leaves of the recordings as they are."""
    whole, part = recognised(problem, (law,), excess(problem, law.chi2))
    return whole or part
