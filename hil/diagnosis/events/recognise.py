"""Which events there are in a misfit."""

from __future__ import annotations

from collections.abc import Sequence

from hil.diagnosis.events.event import Events
from hil.diagnosis.events.lost_commands import comes_every_time, held_commands
from hil.diagnosis.events.repeats import held_outputs
from hil.diagnosis.events.tone import tone
from hil.diagnosis.measures import PART_TOLERANCE, SMALL_EXCESS, excess, share_left
from hil.diagnosis.problem import Problem
from hil.diagnosis.search.fitted import Fitted
from hil.diagnosis.yardsticks import A_GOOD_PART

# Events may leave so much: a tone has more harmonics, a held command a start between two samples.
TOLERANCE_OF_EVENTS = {"periodic_disturbance": 0.1, "dropout": 0.15}


def recognised(
    problem: Problem, models: Sequence[Fitted], beyond: float, *, commands: bool = True
) -> tuple[Events | None, Events | None]:
    """Events that explain, beside one of these models, a misfit given as variance beyond the noise; or a good part
    of it.

    Args:
        problem: the question.
        models: the nominal one first.
        beyond: the misfit.
        commands: whether to look for lost commands, which takes longest.
    """
    part: Events | None = None
    lost = commands and not comes_every_time(problem, models[0])
    for beside in models:
        for events in (tone, held_outputs, held_commands) if lost else (tone, held_outputs):
            found = events(problem, beside)
            if found is None:
                continue
            left = share_left(problem, found.chi2, beyond)
            small = excess(problem, found.chi2) <= SMALL_EXCESS
            if left <= (PART_TOLERANCE if small else TOLERANCE_OF_EVENTS[found.name]):
                return found, None
            if left <= 1.0 - A_GOOD_PART and (part is None or found.chi2 < part.chi2):
                part = found
    return None, part
