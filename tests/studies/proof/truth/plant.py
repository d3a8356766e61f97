"""A plant of the truth: its equations, what its parameters are and how they differ from unit to unit."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True, slots=True)
class Base:
    """A parameter of the nominal chain; units differ by ±`spread` of it. `dead_time` is the solver's to keep."""

    name: str
    value: float
    spread: float = 0.15
    unit: str = "1"
    changes: bool = True
    """Whether a concealed change of it is a `parameter_change`; not so where an effect is named after it."""
    change: tuple[float, float] = (0.05, 0.35)
    """Least and greatest concealed change, as a share of the value."""
    together: tuple[str, ...] = ()
    """Others that change with it, by the same factor: a change of one of them alone is an effect of that name."""


@dataclass(frozen=True, slots=True)
class Channel:
    """A measured signal: heading of its column, standard deviation of its noise, span of its 16-bit converter."""

    heading: str
    noise: float
    span: float


@dataclass(frozen=True, slots=True)
class Plant:
    """One valve or axis.

    Attributes:
        drive: Half span of the input in input units; laws scale their strengths with it.
        centre: Middle of the input span.
        output: Full output in the units of slot FLOW.
        start: Steady states for a constant input.
        settle_s: How long the plant rests on the first sample before the recording starts.
        full_sigma: Lowest and highest change of the output, in noise sigmas, that counts as full severity.
    """

    name: str
    equations: Callable[..., None]
    base: tuple[Base, ...]
    start: Callable[[np.ndarray[Any, Any], float], tuple[float, ...]]
    command: Channel
    channels: tuple[Channel, ...]
    drive: float
    centre: float
    output: float
    settle_s: float = 4.0
    full_sigma: tuple[float, float] = (3.0, 10.0)
    tracked: bool = False

    def unit(self, rng: np.random.Generator) -> dict[str, float]:
        """Draw a unit."""
        return {b.name: b.value * (1.0 + b.spread * rng.uniform(-1.0, 1.0)) for b in self.base}

    def row(self, unit: Mapping[str, float]) -> np.ndarray[Any, Any]:
        """Return the parameters of a unit in the order of the equations."""
        return np.array([unit[b.name] for b in self.base])
