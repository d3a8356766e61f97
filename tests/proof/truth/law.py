"""A law: one way in which a real valve differs from its nominal chain."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .memory import KEY, PARAMETERS

HPV41, EFC, SP08, AXIS = "brevini-hpv41", "cummins-efc", "hydraforce-sp08-47c", "linear-axis"

Array = np.ndarray[Any, np.dtype[np.float64]]
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


@dataclass(frozen=True, slots=True)
class Law:
    """One law. Exactly one of `equation`, `before` and `after` is given.

    Attributes:
        effect: Name of the effect in the contract, or the law's own name where no list has it.
        listed: Whether `effect` is one of the contract's names.
        meaning: Names of the parameters, the strength first.
        largest: Greatest strength on each plant where the law makes sense.
        draw: Draws the other parameters for a plant.
        equation: `law(x, a, b, r)` at a slot of the chain.
        slot: Slot on each plant.
        before: Changes the samples of the command on their way to the valve; the recorded ones stay.
        after: Changes the samples of the output on their way to the recording.
        predictable: Whether knowing the law suffices to predict a recording (chance is not predictable).
        counterparts: Base parameters that say the same thing; left out when asking what a refit could absorb.
        shared: Quantities on which intervals are checked.
        full_sigma: Full severity on a plant where it differs from the plant's own.
    """

    effect: str
    meaning: tuple[str, ...]
    largest: Mapping[str, float]
    draw: Callable[[np.random.Generator, str], tuple[float, ...]]
    equation: Callable[..., float] | None = None
    slot: Mapping[str, int] = field(default_factory=dict)
    before: SampleLaw | None = None
    after: SampleLaw | None = None
    listed: bool = True
    predictable: bool = True
    counterparts: tuple[str, ...] = ()
    shared: tuple[Shared, ...] = ()
    full_sigma: Mapping[str, tuple[float, float]] = field(default_factory=dict)


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
