"""An output in coarse steps: when it passes from level to level tells a law from what rounding leaves."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hil.cores import spread
from hil.diagnosis.causes import NAMEABLE
from hil.diagnosis.decide import OPEN, Choice, healthy
from hil.diagnosis.diagnosis import Verdict
from hil.diagnosis.events.coarse import all_rounding, coarse, cuts_off
from hil.diagnosis.happened import Happened
from hil.diagnosis.measures import LAW_TOLERANCE, SMALL_EXCESS, are_themselves, excess, is_present, is_strained
from hil.diagnosis.problem import Problem
from hil.diagnosis.search.fitted import Fitted
from hil.diagnosis.search.polish import fit
from hil.diagnosis.yardsticks import A_GOOD_PART, MOST, MUCH_THE_SAME, ROUGHLY

# Rounding is no white noise: what a coarse channel leaves beyond its floor is not taken for more.
_COARSE_EXCESS = 0.1


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
    better or as well with less, where there is one; and the share of what is off that it leaves. None where no law does
    much better than none.

    Least squares hardly see those moments: a law that imitates what rounding leaves moves them away.
    """
    choice, levels = found.choice, Levels(found.problem, step)
    if not choice.chosen.terms:
        return None
    without = levels.off(choice.baseline)
    if without <= MOST * levels.by_noise:
        return None
    others = [] if found.events else [f for f in choice.candidates if f.estimate is not None]
    tried = [choice.chosen, *(f for f in others if f.names != choice.chosen.names)]
    counted = list(zip(spread(levels.off, tried), tried, strict=True))
    sound = [(off, f) for off, f in counted if f is choice.chosen or _is_beyond_doubt(f)]
    least = min(off for off, _ in sound)
    if least >= MOST * without:
        return None
    most = max(least, MUCH_THE_SAME * least) + A_GOOD_PART * levels.by_noise
    as_good = [(off, f) for off, f in sound if off <= most]
    _, best = min(as_good, key=lambda c: (not cuts_off(c[1], step), is_strained(c[1]), len(c[1].terms), c[0]))
    worse = {f.names for off, f in counted if off > most}
    return _but_for(choice, worse, best), max(least, 0.0) / without


def _explained(told: Choice, left: float, all_of_it: bool) -> Choice:
    """An answer that leaves this share of what is off, or nothing but rounding; explained where it can be named."""
    few = 0 < len(told.chosen.names) <= NAMEABLE
    if told.verdict in OPEN and few and _is_beyond_doubt(told.chosen) and (all_of_it or left <= LAW_TOLERANCE):
        return replace(told, verdict="explained", left=left)
    return told


def _but_for(choice: Choice, worse: Set[tuple[str, ...]], best: Fitted) -> Choice:
    """An answer with the best explanation, and without worse ones."""
    rivals = [pair for pair in choice.rivals if pair[1:] not in worse]
    if best is not choice.chosen:
        instead = set() if choice.chosen.names in worse else {choice.chosen.first_name}
        others = {other for _, other in rivals} | instead
        rivals = [(best.first_name, other) for other in sorted(others - {best.first_name})]
        closed: Verdict = "explained" if best.names else "parameter_change"
        choice = replace(choice, chosen=best, verdict=choice.verdict if choice.verdict in OPEN else closed)
    candidates = tuple(f for f in choice.candidates if f.names not in worse)
    return replace(choice, rivals=tuple(rivals), candidates=candidates)


def _is_beyond_doubt(f: Fitted) -> bool:
    return is_present(f) and are_themselves(f)


@dataclass(frozen=True)
class Levels:
    """The levels of an output that comes in steps of a size.

    A sample says that the output lay within half a step of its level, to within noise. How far outside an explanation
    puts it, in noise deviations, squared and summed, is nearly −2 ln of the likelihood that it has.
    """

    problem: Problem
    step: float

    @cached_property
    def read(self) -> Problem:
        """The question, with what is read in steps counted so."""
        return replace(self.problem, step=self.step)

    def off(self, f: Fitted) -> float:
        """By how much an explanation, fitted to the levels, is further from them than noise makes the truth; what its
        base parameters had to move for it included.
        """
        fitted = fit(self.read, f, effort=ROUGHLY, from_here=True)
        return fitted.chi2 - self._expected

    @property
    def by_noise(self) -> float:
        """By how much noise makes the truth be off, and what does not matter in inner signals."""
        return self._by_noise_of_output + SMALL_EXCESS * self._inner

    @property
    def _expected(self) -> float:
        return self._by_noise_of_output + self._inner

    @cached_property
    def _told(self) -> int:
        """Number of samples of the output that say something."""
        return sum(int(e.told.sum()) for e in self.problem.experiments)

    @property
    def _inner(self) -> int:
        """Number of samples of inner signals, which are not read in steps."""
        return self.problem.size - self._told

    @property
    def _by_noise_of_output(self) -> float:
        """Of a sample at a distance d from the end of its level, where all distances are as likely, noise of variance
        σ² makes d² with the probability Φ(−d/σ): 2/q·∫d²Φ(−d/σ)dd = ⅔·√(2/π)·σ³/q.
        """
        known = self.problem.model.noise
        assert known is not None  # noqa: S101 - without it there is no coarse step
        return self._told * 2.0 / 3.0 * float(np.sqrt(2.0 / np.pi)) * known.std / self.step
