"""A reading that stands still longer than its own noise allows: a sensor or device that repeats itself.

Conversions count, not samples: a device that converts each 20 ms and is read each 2 ms repeats ten readings by itself.
How likely the next conversion gives the same code is learned from the channel's own conversions near this level before
it came to stand. Where noise hardly moves a reading, or nothing is known near this level, nothing is said: at a rest on
one code, below a cut-off, at an end of what was seen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from hil.arrays import Array, Mask
from hil.signals.rounding import rounding_step
from hil.signals.runs import runs


@dataclass(frozen=True, slots=True)
class Criteria:
    """When a standstill is no chance.

    Attributes:
        chance: that a channel stands as long by its noise, at most.
        codes: half of the conversions move the reading by so many codes, at least: less noise stands by itself.
        turns: least share of turning points among the conversions near a level and `around` them: two thirds where
            noise is white. What moves on has none, and what swings turns at its ends alone, which are near one level.
        beside: conversions at a level or next to it are so many times those at it, at least: more than twice where
            noise is a code, once below a cut-off.
        fewest: conversions near a level that tell how it rests; fewer equal ones are looked at no closer.
        errors: standard errors by which the chance of the next equal code may be greater than it was seen.
        memory: readings that are remembered.
    """

    chance: float = 1e-12
    codes: float = 1.0
    turns: float = 0.25
    around: int = 10
    beside: float = 1.5
    fewest: int = 20
    errors: float = 3.0
    memory: int = 4096


CRITERIA = Criteria()
NEVER = int(np.iinfo(np.int64).max)


@dataclass(frozen=True, slots=True)
class Standstill:
    """Follows a channel from block to block.

    Attributes:
        readings: the last ones, NaN where nothing was measured, shape (n,); `memory` of them before the last run of
            equal ones, and as many of that run.
        repeats: of the last reading, however long ago. `most`: by chance, once there are enough of them to ask.
    """

    readings: Array
    repeats: int = 0
    most: int | None = None

    @classmethod
    def begun(cls) -> Standstill:
        """Nothing is known yet."""
        return cls(np.empty(0))

    def after(self, values: Array) -> tuple[Standstill, Mask]:
        """The channel after a block, and which of its readings repeat more often than by chance, shape (n,)."""
        seen, new = np.concatenate([self.readings, values]), len(self.readings)
        first = max(new - 1 - min(self.repeats, CRITERIA.memory), 0)
        beyond = np.zeros(len(values), dtype=np.bool_)
        start, stop, repeats, most = 0, -1, 0, None
        for begin, end in runs(seen[first + 1 :] == seen[first:-1]):
            goes_on = begin == 0 and self.repeats > 0
            start, stop = first + begin, first + end
            repeats = end - begin + (max(self.repeats - CRITERIA.memory, 0) if goes_on else 0)
            most = self.most if goes_on else None
            if repeats < CRITERIA.fewest:
                continue
            if most is None:
                most = most_by_chance(seen[max(start - CRITERIA.memory, 0) : start], float(seen[start]))
            if repeats > most:
                beyond[max(stop - new - (repeats - most) + 1, 0) : stop - new + 1] = True
        if stop < len(seen) - 1:
            start, repeats, most = len(seen) - 1, 0, None
        kept = np.concatenate([seen[: start + 1][-CRITERIA.memory - 1 :], seen[start + 1 :][-CRITERIA.memory :]])
        return Standstill(kept, repeats, most), beyond


def most_by_chance(before: Array, level: float) -> int:
    """So many repeats of a level may be chance, by the readings before; `NEVER` too many where that cannot be told."""
    measured = before[np.isfinite(before)]
    if len(measured) <= CRITERIA.fewest or not measured.min() < level < measured.max():
        return NEVER
    stood = np.diff(np.flatnonzero(np.diff(measured, prepend=np.nan, append=np.nan) != 0.0))
    period = max(int(np.median(stood)), 1)  # readings to a conversion
    starts = np.concatenate([[0], np.cumsum(stood)[:-1]])
    conversions = np.repeat(measured[starts], np.maximum(np.rint(stood / period).astype(np.int64), 1))
    steps = np.diff(conversions)
    scale, code = float(np.median(np.abs(steps))) if len(steps) else 0.0, rounding_step(conversions)
    if scale <= 0.0 or scale < CRITERIA.codes * code:
        return NEVER
    away = np.abs(conversions[:-1] - level)
    from_here = [away <= distance for distance in (scale, 0.0)]
    beside = np.count_nonzero(away <= max(1.5 * code, 0.5 * scale))
    if beside < CRITERIA.beside * np.count_nonzero(from_here[1]):
        return NEVER
    turns, near = np.append(False, steps[1:] * steps[:-1] < 0.0), np.flatnonzero(from_here[0])
    around = (near[:, None] + np.arange(-CRITERIA.around, CRITERIA.around + 1)).clip(0, len(turns) - 1)
    if len(near) < CRITERIA.fewest or np.mean(turns[np.unique(around)]) < CRITERIA.turns:
        return NEVER
    likely = max(_at_most(np.count_nonzero(steps[here] == 0.0) + 1, np.count_nonzero(here) + 2) for here in from_here)
    if likely >= 1.0:
        return NEVER
    return max(math.ceil(math.log(CRITERIA.chance) / math.log(likely)) * period, CRITERIA.fewest)


def _at_most(of: Any, among: Any) -> float:
    """A share, and as much more as its own scatter may hide."""
    share = of / among
    return share + CRITERIA.errors * math.sqrt(share * (1.0 - share) / among)
