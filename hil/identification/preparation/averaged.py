"""Long recordings compared as means of neighbouring samples: memory follows what they tell, not how often they tell it.

A mean of m neighbours times √m has the variance of one sample where noise is white, and all that they tell of a plant
that moves little between them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hil.identification.preparation.criteria import CRITERIA, EFFORT
from hil.identification.preparation.experiment import Experiment
from hil.language.note import Note
from hil.physics.model import Model
from hil.record.recording import Array


def means(errors: Array, count: int) -> Array:
    """Of so many neighbouring errors each, times the root of their number, shape (ceil(n / count),)."""
    if count == 1:
        return errors
    firsts = np.arange(0, len(errors), count)
    return np.add.reduceat(errors, firsts) / np.sqrt(np.minimum(count, len(errors) - firsts))


def with_means(model: Model, experiments: Sequence[Experiment]) -> tuple[list[Experiment], tuple[Note, ...]]:
    """Experiments with as many samples to a mean as lose nothing of the model's motion, and that in words."""
    made = [replace(e, averaged=_count(model, e)) for e in experiments]
    notes = (
        Note(
            "{count} neighbouring samples are compared as one mean: the plant moves little between them",
            count=e.averaged,
        ).of(e.name)
        for e in made
        if e.averaged > 1
    )
    return made, tuple(notes)


def _count(model: Model, e: Experiment) -> int:
    if len(e.output) < 2 * EFFORT.means_from:
        return 1
    motion = [np.diff(row) for row in e.simulated(model)]
    moving = [row for row in motion if float(row @ row) > 0.0]
    count = 1
    while len(e.output) >= 2 * count * EFFORT.means_from and all(
        _power_lost(row, 2 * count) <= CRITERIA.lost_power for row in moving
    ):
        count *= 2
    return count


def _power_lost(motion: Array, count: int) -> float:
    """The share of its power that means do not have."""
    kept = means(motion, count)
    return 1.0 - float(kept @ kept) / float(motion @ motion)
