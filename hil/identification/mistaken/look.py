"""Everything that a recording may be mistaken for, held against a model."""

from __future__ import annotations

from collections.abc import Iterator

from hil.identification.experiment import Experiment
from hil.identification.mistaken.column import swapped_columns
from hil.identification.mistaken.sign import reversed_sign
from hil.identification.mistaken.suspicion import Suspicion, can_be_held_against, expected
from hil.identification.mistaken.unit import wrong_unit
from hil.physics.model import Model


def mistaken(model: Model, e: Experiment) -> Iterator[Suspicion]:
    """What looks wrong in one recording, one suspicion after another; another time is looked for in all together."""
    if not can_be_held_against(model):
        return
    simulated = expected(model, e)
    for looked in (reversed_sign, swapped_columns, wrong_unit):
        if (found := looked(model, e, simulated)) is not None:
            yield found
