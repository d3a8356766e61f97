"""A law: one way in which a real valve differs from its nominal chain."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeVar

import numpy as np

from .memory import KEY, PARAMETERS

HPV41, EFC, SP08, AXIS = "brevini-hpv41", "cummins-efc", "hydraforce-sp08-47c", "linear-axis"

Array = np.ndarray[Any, np.dtype[np.float64]]
ADDS_UP = {AXIS: (1000.0, 5000.0)}
"""Full severity of what is a force: it adds up in a position, a few newtons."""

_Acting = TypeVar("_Acting", bound=Callable[..., Any])
SampleLaw = Callable[[Array, float, Sequence[float], np.random.Generator], Array]


@dataclass(frozen=True, slots=True)
class Shared:
    """A quantity that a diagnosis should report with the same meaning: its unit, and its true value.

    `both_ways`: it is there on either side of nothing, and the side on which it was found is told by the sign.
    """

    name: str
    unit: str
    value: Callable[[Sequence[float]], float]
    both_ways: bool = False


class Times(NamedTuple):
    """A range that is drawn from evenly, times a value of the plant."""

    of: Mapping[str, float]
    low: float
    high: float


Range = float | tuple[float, float]
"""A number, or a range that is drawn from evenly."""


@dataclass(frozen=True, slots=True)
class Law:
    """One law. Exactly one of `equation`, `before` and `after` is given.

    Attributes:
        effect: Name of the effect in the contract, or the law's own name where no list has it.
        listed: Whether `effect` is one of the contract's names.
        strength: Name of the first parameter.
        largest: Greatest strength on each plant where the law makes sense.
        others: The other parameters by name, in their order, or by name and plant.
        equation: `law(x, a, b, r)` at a slot of the chain.
        at: Slot, or the slot on each plant.
        before: Changes the samples of the command on their way to the valve; the recorded ones stay.
        after: Changes the samples of the output on their way to the recording.
        predictable: Whether knowing the law suffices to predict a recording (chance is not predictable).
        counterparts: Base parameters that say the same thing; left out when asking what a refit could absorb.
        shared: Quantities on which intervals are checked.
        full_sigma: Full severity on a plant where it differs from the plant's own.
    """

    effect: str
    strength: str
    largest: Mapping[str, float]
    others: Mapping[str, Range | Times | Mapping[str, Range]] = field(default_factory=dict)
    equation: Callable[..., float] | None = None
    at: int | Mapping[str, int] | None = None
    before: SampleLaw | None = None
    after: SampleLaw | None = None
    listed: bool = True
    predictable: bool = True
    counterparts: tuple[str, ...] = ()
    shared: tuple[Shared, ...] = ()
    full_sigma: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def meaning(self) -> tuple[str, ...]:
        """Names of the parameters, the strength first."""
        return (self.strength, *self.others)

    def draw(self, rng: np.random.Generator, plant: str) -> tuple[float, ...]:
        """The other parameters, for a plant."""
        return tuple(_drawn(one, rng, plant) for one in self.others.values())

    def slot(self, plant: str) -> int | None:
        """Where the equation acts."""
        return self.at[plant] if isinstance(self.at, Mapping) else self.at


def _drawn(told: Range | Times | Mapping[str, Range], rng: np.random.Generator, plant: str) -> float:
    if isinstance(told, Times):
        return told.of[plant] * rng.uniform(told.low, told.high)
    range_ = told[plant] if isinstance(told, Mapping) else told
    return rng.uniform(*range_) if isinstance(range_, tuple) else range_


BEFORE, AFTER = "before", "after"
LAWS: dict[str, Law] = {}
"""Every law under the name of its function."""


def acts(at: int | str | Mapping[str, int], effect: str, **facts: Any) -> Callable[[_Acting], _Acting]:
    """Make a function the law of its name.

    Args:
        at: The slot (by plant) where `law(x, a, b, r)` acts, or BEFORE or AFTER for what a `SampleLaw` does to samples.
        effect: As in `Law`.
        **facts: What else `Law` has.
    """

    def kept(function: _Acting) -> _Acting:
        way = {at: function} if isinstance(at, str) else {"equation": function, "at": at}
        LAWS[function.__name__] = Law(effect, **facts, **way)
        return function

    return kept


@dataclass(frozen=True, slots=True)
class Hidden:
    """A law with its parameters, as it is concealed in a unit; parameters[0] is its strength."""

    law: str
    parameters: tuple[float, ...]


def row(hidden: Hidden, recording: float) -> Array:
    """Return the parameter row of a law for one recording."""
    if len(hidden.parameters) > KEY:
        raise ValueError(f"{hidden.law} has {len(hidden.parameters)} parameters, {KEY} fit")
    filled = np.zeros(PARAMETERS)
    filled[: len(hidden.parameters)] = hidden.parameters
    filled[KEY] = recording
    return filled
