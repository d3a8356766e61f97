"""The witness of an output: an input that answers to it, since a register is not a valve."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from hil.daq.channel import InputChannel, OutputChannel
from hil.daq.contract import Block
from hil.errors import HilError

Look = Callable[[str], Block]
"""Reads an input by its name, now; raises `HardwareError`."""
_AGREES = 0.0025  # of the range: what a converter or a protocol may round
SETTLES_S = 1.0
_SIGMAS = 5.0


def stands_at(level: float, at: float, channel: OutputChannel) -> bool:
    """Whether an output that reads back `at` stands at a level, but for what a converter or a protocol may round."""
    return abs(at - level) <= _AGREES * (channel.high - channel.low)


@dataclass(frozen=True, slots=True)
class Witness:
    """An input that answers to an output.

    Attributes:
        channel: its name.
        is_named: the bench file names it: without it the output is not safe. Else it makes a note.
        uncertainty: differences that its calibration leaves open, in its unit.
        settles_s: so long after the safe value it is back at what it read at rest.
    """

    channel: str
    is_named: bool = True
    uncertainty: float = 0.0
    settles_s: float = SETTLES_S


@dataclass(frozen=True, slots=True)
class Testimony:
    """What a witness reads where that is not what it read at rest; None where it reads nothing.

    `is_named`: the bench file names it, so that its output is not safe.
    """

    channel: str
    unit: str
    is_named: bool
    reads: float | None = None
    at_rest: float | None = None

    def as_dict(self) -> dict[str, Any]:
        """As it is kept with a run."""
        return asdict(self)

    @classmethod
    def of(cls, record: Mapping[str, Any]) -> Testimony:
        """What a record says.

        Raises:
            KeyError: it is no record of a witness.
        """
        return cls(*(record[name] for name in ("channel", "unit", "is_named", "reads", "at_rest")))


class Witnesses:
    """The witnesses of a bench, what they read at rest, and for which outputs they are to be heard.

    Args:
        of: by output.
        inputs: of the bench, in engineering units.
    """

    def __init__(
        self,
        of: Mapping[str, Witness] = MappingProxyType({}),
        inputs: Mapping[str, InputChannel] = MappingProxyType({}),
    ) -> None:
        self._of, self._inputs = of, inputs
        self._rest: dict[str, tuple[float, float]] = {}
        self._due: set[str] = set()

    def rested(self, block: Block) -> None:
        """Keep what they read before anything is driven: the median, and what a difference from it must exceed."""
        for witness in self._of.values():
            values, channel = block.inputs[witness.channel], self._inputs[witness.channel]
            still = values[np.isfinite(values)]
            sigma = float(np.std(still)) if still.size else 0.0
            span = channel.high - channel.low
            rounds = _AGREES * span if math.isfinite(span) else channel.step
            self._rest[witness.channel] = float(np.median(values)), max(_SIGMAS * sigma, witness.uncertainty, rounds)

    def driven(self, output: str) -> None:
        """An output leaves its safe value: from now on its witness is to be heard."""
        if output in self._of:
            self._due.add(output)

    def due(self, output: str) -> Witness | None:
        """The witness that is to be heard before an output is called safe."""
        return self._of[output] if output in self._due else None

    def pending(self, output: str) -> Testimony | None:
        """As long as nobody has looked."""
        witness = self.due(output)
        if witness is None:
            return None
        return Testimony(witness.channel, self._inputs[witness.channel].unit, witness.is_named)

    def heard(self, output: str, look: Look) -> Testimony | None:
        """What the witness of an output has against it now; None where it is back at rest: then it has been heard."""
        pending = self.pending(output)
        if pending is None:
            return None
        rest, allowed = self._rest.get(pending.channel, (math.nan, 0.0))
        reads = _reading(look, pending.channel)
        if reads == rest or abs(reads - rest) <= allowed:
            self._due.discard(output)
            return None
        return Testimony(pending.channel, pending.unit, pending.is_named, _number(reads), _number(rest))


def _reading(look: Look, channel: str) -> float:
    try:
        return float(look(channel).inputs[channel][-1])
    except HilError:
        return math.nan


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None
