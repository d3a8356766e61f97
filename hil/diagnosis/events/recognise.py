"""Which events there are beside models of a unit."""

from __future__ import annotations

from collections.abc import Sequence

from hil.diagnosis.events.event import Events
from hil.diagnosis.events.lost_commands import comes_every_time, held_commands
from hil.diagnosis.events.repeats import held_outputs
from hil.diagnosis.events.tone import tone
from hil.diagnosis.problem import Problem
from hil.diagnosis.search.fitted import Fitted, nothing


def recognised(problem: Problem, models: Sequence[Fitted]) -> list[tuple[Fitted, Events]]:
    """Events of each kind beside each model; what comes with every jump beside the nominal one is no lost command."""
    lost = not comes_every_time(problem, nothing(problem))
    kinds = (tone, held_outputs, held_commands) if lost else (tone, held_outputs)
    looked = [(model, look(problem, model)) for model in models for look in kinds]
    return [(model, found) for model, found in looked if found is not None]
