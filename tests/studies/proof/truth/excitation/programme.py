"""The recordings of a case, by plant."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..law import AXIS, EFC, HPV41, SP08, Array
from . import axis, efc, hpv41, sp08


@dataclass(frozen=True, slots=True)
class Programme:
    """Commands by file name (references of the position loop, for an axis)."""

    baseline: dict[str, Array]
    changed: dict[str, Array]
    unseen: dict[str, Array]


_PLAY: dict[str, Callable[[np.random.Generator], tuple[dict[str, Array], dict[str, Array], dict[str, Array]]]] = {
    HPV41: hpv41.play,
    EFC: efc.play,
    SP08: sp08.play,
    AXIS: axis.play,
}


def programme(plant: str, rng: np.random.Generator) -> Programme:
    """Draw what is played to a plant."""
    groups = _PLAY[plant](rng)
    # as many digits as the CSV files carry, so that what is recorded is what was played
    return Programme(*({name: np.round(x, 6) for name, x in group.items()} for group in groups))
