"""How widely a search looks. None of these numbers decides what is believed."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Steps:
    """How far a fit goes: evaluations at most, and the relative fall of χ² at which it stops."""

    evaluations: int
    tolerance: float


@dataclass(frozen=True, slots=True)
class Effort:
    """How much is tried.

    Attributes:
        beam: sets that are followed from each size. `causes`, `events`: of the largest set.
        alone: single terms that are fitted given all else linear. `tried`: the same of terms beside a set.
        finished: of those, fitted to their end. `starts`: that a term is fitted from.
        far: a linearised fit that would not turn out best where it left so many times less is not finished.
        again: below so many times its χ² from elsewhere a set is extended anew.
        stronger: a start is scaled at most so far. `sketched`: residuals that are remembered of what a term changes.
        linear, rough, fine, end: steps of a fit given all else linear, of one to be compared, of the search, and of
            what is told.
    """

    beam: int = 3
    causes: int = 3
    events: int = 2
    alone: int = 12
    tried: int = 8
    finished: int = 3
    starts: int = 2
    far: float = 4.0
    again: float = 0.9
    stronger: float = 3.0
    sketched: int = 40_000
    linear: Steps = Steps(6, 1e-3)
    rough: Steps = Steps(8, 1e-3)
    fine: Steps = Steps(15, 1e-4)
    end: Steps = Steps(40, 1e-5)


EFFORT = Effort()
