"""An output in coarse steps: when it passes from level to level tells a law from what rounding leaves."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.stats import norm

from hil.diagnose.causes import NAMEABLE
from hil.diagnose.decide import OPEN, Choice, healthy
from hil.diagnose.events.coarse import all_rounding, coarse, cuts_off
from hil.diagnose.happened import Happened
from hil.diagnose.measures import LAW_TOLERANCE, excess, is_itself, is_present, is_strained
from hil.diagnose.problem import Problem
from hil.diagnose.search.fitted import Fitted, output_of
from hil.record.recording import Array

# Rounding is no white noise: what a coarse channel leaves beyond its floor is not taken for more.
_COARSE_EXCESS = 0.1
# Where a law is there, so many samples beyond those that noise misreads are misread without it, and this share with it.
_LEAST_MISREAD, _MOST_MISREAD = 60.0, 0.5
# One that misreads this share more, and so many samples more, is a worse one.
_WORSE = 0.25
_QUANTILES = 1000


def read_coarsely(found: Happened, step: float, std: float) -> Happened:
    """An output that comes in coarse steps, beside what else was found, or as all there is.

    `step`: of the output, with its standard uncertainty.
    """
    problem = found.problem
    told = _told_by_levels(found, step)
    law = found.choice.baseline if told is None else told[0].chosen
    rounded = all_rounding(problem, law, step)
    if told is not None:
        found = replace(found, choice=_explained(*told, cuts_off(law, step) and rounded is not None))
        if found.events or found.choice.verdict in OPEN:
            rounded = None
    elif rounded is not None or excess(problem, law.chi2) < _COARSE_EXCESS:
        found = found.instead(healthy(found.choice))
    left = found.residuals if rounded is None else rounded.residuals
    return found.also(coarse(problem, step, std, found.choice.chosen, left))


def _told_by_levels(found: Happened, step: float) -> tuple[Choice, float] | None:
    """The answer, where its law passes from level to level when the recordings do, with another law that explains them
    as well, where that does so better; and the share of misread samples that it leaves. None where no law does much
    better than none.

    A law that imitates what rounding leaves moves those moments away; least squares do not see that.
    """
    choice, levels = found.choice, Levels(found.problem, step)
    if not choice.chosen.terms:
        return None
    others = [f for f in choice.candidates if not found.events and _is_alike(f, choice)]
    counted = [(levels.misread(f), f) for f in (choice.chosen, *others)]
    least, best = min((c for c in counted if c[1] is choice.chosen or _is_beyond_doubt(c[1])), key=lambda c: c[0])
    without = levels.misread(choice.baseline)
    if not (without > _LEAST_MISREAD and least < _MOST_MISREAD * without):
        return None
    most = least + _WORSE * max(least, 0.0) + _LEAST_MISREAD
    as_good = [f for count, f in counted if count <= most]
    best = choice.chosen if as_good[0] is choice.chosen else best
    best = next((f for f in as_good if cuts_off(f, step)), best)
    worse = {f.names for count, f in counted if count > most}
    return _but_for(choice, worse, best), max(least, 0.0) / without


def _explained(told: Choice, left: float, all_of_it: bool) -> Choice:
    """An answer that leaves this share of misread samples, or nothing but rounding; explained where it can be named."""
    few = 0 < len(told.chosen.names) <= NAMEABLE
    if told.verdict in OPEN and few and _is_beyond_doubt(told.chosen) and (all_of_it or left <= LAW_TOLERANCE):
        return replace(told, verdict="explained", left=left)
    return told


def _but_for(choice: Choice, worse: Set[tuple[str, ...]], best: Fitted) -> Choice:
    """An answer with the best explanation, and without worse ones."""
    rivals = [pair for pair in choice.rivals if pair[1:] not in worse]
    if best is not choice.chosen:
        (first,) = best.names
        rivals = [(first, other) for _, other in rivals if other != first]
        choice = replace(choice, chosen=best)
    candidates = tuple(f for f in choice.candidates if f.names not in worse)
    return replace(choice, rivals=tuple(rivals), candidates=candidates)


def _is_alike(f: Fitted, choice: Choice) -> bool:
    """Whether an explanation is another name for what was chosen."""
    chosen = choice.chosen.names or ("parameter_change",)
    others = {(other,) for first, other in choice.rivals if chosen == (first,)}
    return f.estimate is not None and f.names in others


def _is_beyond_doubt(f: Fitted) -> bool:
    return is_present(f) and not is_strained(f) and all(is_itself(f, term) for term in f.terms)


@dataclass(frozen=True)
class Levels:
    """The levels of an output that comes in steps of a size."""

    problem: Problem
    step: float

    def misread(self, f: Fitted) -> float:
        """How many samples an explanation reads at another level than they were recorded, beyond those that noise
        misreads; counted by the square of the steps between.
        """
        total = 0.0
        for e, (place, recorded) in zip(self.problem.experiments, self.recorded, strict=True):
            off = recorded - np.rint(output_of(self.problem, f, e) / self.step - place)
            total += float(np.sum(off[e.told] ** 2))
        return total - self.by_noise

    @cached_property
    def recorded(self) -> list[tuple[float, Array]]:
        """Of every experiment where its levels lie, in steps, and the number of each sample's level, shape (n,)."""
        found = []
        for e in self.problem.experiments:
            place = float(np.angle(np.mean(np.exp(2j * np.pi * e.output / self.step)))) / (2.0 * np.pi)
            found.append((place, np.rint(e.output / self.step - place)))
        return found

    @cached_property
    def by_noise(self) -> float:
        """How many of them noise alone misreads, wherever between two levels the output is."""
        known = self.problem.model.noise
        assert known is not None  # noqa: S101 - without it there is no coarse step
        away = np.abs(norm.ppf((np.arange(_QUANTILES) + 0.5) / _QUANTILES)) * known.std / self.step
        whole = np.floor(away)
        squared = whole**2 + (away - whole) * (2.0 * whole + 1.0)
        return float(np.mean(squared)) * sum(int(e.told.sum()) for e in self.problem.experiments)
