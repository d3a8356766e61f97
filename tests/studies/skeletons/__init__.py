"""Units of another structure than the library's: each file was written from its brief, without a look at `hil`.

A skeleton has `PLANT` (the model that is asked for), `CHANNELS` (its command first), `STEP_S`, `NOISE` (standard
deviation by channel), `draw(rng)` (a unit), `respond(unit, command)` (noise-free channels) and `CHANGES` (by neutral
name: the unit with an amount of it, 0 to 1).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np

_Unit = TypeVar("_Unit", bound=Any)


def around(nominal: _Unit, spread: Mapping[str, float], usual: float, rng: np.random.Generator) -> _Unit:
    """A unit whose parameters lie evenly around their nominal values, within a share of them by name or the usual."""
    factors = {f.name: 1.0 + spread.get(f.name, usual) * float(rng.uniform(-1.0, 1.0)) for f in fields(nominal)}
    return replace(nominal, **{name: float(getattr(nominal, name)) * factor for name, factor in factors.items()})
