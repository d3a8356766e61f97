"""Everything that a recording may be mistaken for, held against a model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from hil.identification.preparation.content import is_of_its_origin
from hil.identification.preparation.experiment import Experiment
from hil.identification.preparation.plausibility.column import swapped_columns
from hil.identification.preparation.plausibility.sign import reversed_sign
from hil.identification.preparation.plausibility.suspicion import Suspicion, can_be_held_against, expected
from hil.identification.preparation.plausibility.time_unit import wrong_time
from hil.identification.preparation.plausibility.unit import wrong_unit
from hil.language.note import Note
from hil.physics.model import Model


def suspicions(model: Model, experiments: Sequence[Experiment]) -> Iterator[Suspicion]:
    """What looks wrong in recordings whose output moves, time first; nothing in those the model was identified from."""
    if not can_be_held_against(model):
        return
    strange = [e for e in experiments if not (e.stands_still or is_of_its_origin(model, e))]
    yield from wrong_time(model, strange)
    for e in strange:
        yield from implausible(model, e)


def implausible_metadata(model: Model, e: Experiment) -> list[Note]:
    """The same of one recording, in words; nothing of one without an output."""
    return [one.sentence for one in suspicions(model, [e])] if e.valid.any() else []


def implausible(model: Model, e: Experiment) -> Iterator[Suspicion]:
    """What looks wrong in one recording, one suspicion after another; another time is looked for in all together."""
    if not can_be_held_against(model):
        return
    simulated = expected(model, e)
    for looked in (reversed_sign, swapped_columns, wrong_unit):
        if (found := looked(model, e, simulated)) is not None:
            yield found
