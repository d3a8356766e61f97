"""What is certain, what is most, what is much the same: the yardsticks that all rooms of a diagnosis share."""

from __future__ import annotations

from dataclasses import dataclass

# Standard uncertainties: from so many on nobody doubts it, and so many seldom come by chance.
CERTAIN, SELDOM_BY_CHANCE = 5.0, 3.0
# Shares: most of something, a good part of it, and next to nothing.
MOST, A_GOOD_PART, NEXT_TO_NOTHING = 0.5, 0.3, 0.02
# Ratios: within it two sizes are much the same, from it on one is plainly larger, far larger, or another thing.
MUCH_THE_SAME, PLAINLY, FAR = 1.25, 1.5, 4.0
# So many of the best are followed to the end, so many looked at closely, so many roughly; so many lines of a list are
# read.
LEADING, FEW, MANY, LISTED = 2, 4, 8, 12


@dataclass(frozen=True, slots=True)
class Effort:
    """How far a fit goes: evaluations at most, and the relative fall of χ² at which it stops."""

    evaluations: int
    tolerance: float


# To its end; so far that it is known whether an end is worth it; so far that it can be compared.
TO_THE_END, ROUGHLY, AT_A_GLANCE = Effort(40, 1e-5), Effort(15, 1e-4), Effort(8, 1e-3)
