"""Which events there are beside models of a unit."""

from __future__ import annotations

from collections.abc import Sequence

from hil.diagnosis.events.event import Events
from hil.diagnosis.events.lost_commands import comes_every_time, held_commands
from hil.diagnosis.events.repeats import held_outputs
from hil.diagnosis.events.tone import tone
from hil.diagnosis.problem import Problem
from hil.diagnosis.search.fitted import Fitted


def recognised(problem: Problem, models: Sequence[Fitted]) -> list[tuple[Fitted, Events]]:
    """Events of each kind beside each model, the nominal one first; what comes with every jump is no lost command."""
    lost = not comes_every_time(problem, models[0])
    kinds = (tone, held_outputs, held_commands) if lost else (tone, held_outputs)
    looked = [(model, look(problem, model)) for model in models for look in kinds]
    return [(model, found) for model, found in looked if found is not None]
