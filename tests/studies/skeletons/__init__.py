"""Units of another structure than the library's: each file was written from its brief, without a look at `hil`.

A skeleton has `PLANT` (the model that is asked for), `CHANNELS` (its command first), `STEP_S`, `NOISE` (standard
deviation by channel), `draw(rng)` (a unit), `respond(unit, command)` (noise-free channels) and `CHANGES` (by neutral
name: the unit with an amount of it, 0 to 1).
"""

from __future__ import annotations

import math
from collections import namedtuple
from collections.abc import Callable, Iterable, Mapping
from dataclasses import astuple, fields, replace
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Change = Callable[[Any, float], Any]
"""The unit with an amount of a change."""


def parameters_of(unit: type) -> Any:
    """A named tuple of a unit's fields, as compiled equations take it; `_Parameters` of the unit's module."""
    return namedtuple("_Parameters", [field.name for field in fields(unit)], module=unit.__module__)


def drawing(nominal: Any, spread: Mapping[str, float], usual: float) -> Callable[[np.random.Generator], Any]:
    """Draws healthy units: each parameter evenly within a share of its nominal value, by name or the usual one."""

    def draw(rng: np.random.Generator) -> Any:
        factors = {f.name: 1.0 + spread.get(f.name, usual) * float(rng.uniform(-1.0, 1.0)) for f in fields(nominal)}
        return replace(nominal, **{name: float(getattr(nominal, name)) * factor for name, factor in factors.items()})

    return draw


def answering(
    run: Callable[..., Array], parameters: Any, channels: Iterable[str], step_s: float, substeps: int
) -> Callable[[Any, Array], dict[str, Array]]:
    """The noise-free channels of a unit at the samples of a command, by name."""

    def respond(unit: Any, command: Array) -> dict[str, Array]:
        rows = run(parameters(*astuple(unit)), np.ascontiguousarray(command, dtype=np.float64), step_s, substeps)
        return dict(zip(list(channels)[1:], np.atleast_2d(rows), strict=True))

    return respond


def _each(by: Mapping[str, float], after: Callable[[float, float, float], float]) -> Change:
    return lambda unit, amount: replace(unit, **{n: after(getattr(unit, n), k, amount) for n, k in by.items()})


def more(**by: float) -> Change:
    """Parameters grow by so much."""
    return _each(by, lambda value, k, amount: value + k * amount)


def scaled(**by: float) -> Change:
    """Parameters grow by this share of themselves."""
    return _each(by, lambda value, k, amount: value * (1.0 + k * amount))


def divided(**by: float) -> Change:
    """Parameters are divided by one and so much."""
    return _each(by, lambda value, k, amount: value / (1.0 + k * amount))


def fading(**to: float) -> Change:
    """Parameters fade to this share of themselves, by powers."""
    return _each(to, lambda value, k, amount: value * k**amount)


def orifice_root(laminar: float) -> Callable[[float], float]:
    """The root of a drop with its sign, as an orifice passes it; below the drop `laminar` in proportion. Compiled."""

    @njit
    def root(drop: float) -> float:
        return drop / math.sqrt(abs(drop) + laminar)

    return root


@njit(cache=True)
def past_edge(past: float, width: float) -> float:
    """What is past an edge that is worn round over a width."""
    return 0.5 * (past + math.sqrt(past * past + width * width)) if past > -30.0 * width else 0.0
