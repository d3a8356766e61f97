"""Where samples pass a level: on the straight line between two of them."""

from __future__ import annotations

import numpy as np

from hil.arrays import Array


def first_crossing(places: Array, values: Array, level: float) -> float | None:
    """The first place at which values have come up to a level; None where they do not."""
    i = int(np.argmax(values >= level))
    if not values[i] >= level:
        return None
    return crossing(places, values, level, i - 1, i) if i else float(places[0])


def crossing(places: Array, values: Array, level: float, before: int, after: int) -> float:
    """The place at which the line from one sample to another, by their numbers, has a level; they may not be equal."""
    share = (level - values[before]) / (values[after] - values[before])
    return float(places[before] + share * (places[after] - places[before]))
