"""A coarse converter that cuts off what is below its level."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..law import Array
from .quantisation_mid_tread import LAW as MID_TREAD


def after(values: Array, sample_s: float, p: Sequence[float], rng: np.random.Generator) -> Array:
    return values if p[0] <= 0.0 else p[0] * np.floor(values / p[0])


LAW = replace(MID_TREAD, after=after)
