"""Dead time: transport through bus, electronics or line before anything answers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hil.physics.effect import Effect, EffectParameter, Seen, compiled
from hil.physics.linear import delayed
from hil.physics.plant import Parameter


@compiled
def transform(value: float, state: Any, steps: float) -> float:
    """`value` as it was the dead time ago."""
    return delayed(state, value, steps)


@compiled
def settle(value: float, state: Any) -> float:
    """The line is full of the first value."""
    return delayed(state, value, -1.0)


def coefficients(parameters: Mapping[str, float], step_s: float) -> dict[str, float]:
    """The delay in sub-steps."""
    return {"steps": parameters["delay"] / step_s}


def memory(parameters: Mapping[str, Parameter], step_s: float) -> int:
    """A ring that holds the longest delay."""
    return math.ceil(parameters["delay"].high / step_s) + 4


def starts(seen: Seen) -> list[dict[str, float]]:
    """From a sample to a tenth of a second."""
    return [{"delay": delay} for delay in (seen.interval_s, 0.015, 0.05, 0.12)]


EFFECT = Effect(
    name="dead_time",
    title="dead time",
    hooks=("command", "sensor", "recorder"),
    parameters=(EffectParameter("delay", "s", 0.0, 0.01, 0.0, 0.25, "time until anything answers"),),
    transform=transform,
    starts=starts,
    memory=memory,
    settle=settle,
    coefficients=coefficients,
    equation="y(t) = u(t − T)",
    signature="phase lag that grows with frequency, no distortion, no dependence on amplitude",
    source="Åström, Hägglund: Advanced PID Control, 2006, ch. 2",
    sentence="The answer comes {delay} later than it should, at any amplitude.",
)
