"""How a bench is protected: limits, ramps, interlocks, and how often they are looked at."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from hil.safety.envelope import Envelope
from hil.safety.interlock import Interlock
from hil.safety.witness import Witness


@dataclass(frozen=True, slots=True)
class Protection:
    """How a bench is protected, in engineering units.

    Attributes:
        rate_hz: sample rate of what the guard itself plays (ramps, waiting).
        envelopes: limits of each output; one that is not named has the range of its device.
        ramps_per_s: outputs that go to their safe value at this slew; the others jump.
        interlocks: conditions on inputs and outputs.
        block_s: how often inputs are judged and recorded: the reaction time to a violation.
        patience_s: how long a `hold` is waited for before the run is stopped.
        witnesses: by output, the input that answers to it.
        look_s: how long the bench is looked at before anything moves.
        shutdown_order: outputs that go to their safe values one after another; the others go at once.
    """

    rate_hz: float
    envelopes: Mapping[str, Envelope] = field(default_factory=dict)
    ramps_per_s: Mapping[str, float] = field(default_factory=dict)
    interlocks: Sequence[Interlock] = ()
    block_s: float = 0.1
    patience_s: float = 600.0
    witnesses: Mapping[str, Witness] = field(default_factory=dict)
    look_s: float = 0.1
    shutdown_order: Sequence[str] = ()

    def block_samples(self, rate_hz: float) -> int:
        """Samples of a block at a rate."""
        return max(1, round(self.block_s * rate_hz))
