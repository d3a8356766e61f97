"""Periodic disturbance: mains hum or pump ripple that has nothing to do with the command."""

from __future__ import annotations

import math

from hil.physics.effect import Effect, EffectParameter, Seen, compiled


@compiled
def transform(value: float, time_s: float, amplitude: float, frequency: float, phase: float) -> float:
    """Add a sine."""
    return value + amplitude * math.sin(2.0 * math.pi * frequency * time_s + phase)


def starts(seen: Seen) -> list[dict[str, float]]:
    """The strongest lines in what is left unexplained."""
    return [{"amplitude": size, "frequency": f, "phase": phase} for f, size, phase in seen.tones]


EFFECT = Effect(
    name="periodic_disturbance",
    title="periodic disturbance",
    hooks=("command", "flow", "sensor", "recorder"),
    parameters=(
        EffectParameter("amplitude", "{value}", 0.0, 0.01, 0.0, 0.5, "amplitude"),
        EffectParameter("frequency", "Hz", None, 10.0, 0.05, 500.0, "frequency"),
        EffectParameter("phase", "rad", None, 0.0, -7.0, 7.0, "phase at the start of the recording"),
    ),
    transform=transform,
    starts=starts,
    equation="y = u + a·sin(2πft + φ)",
    signature="a line in the residual spectrum, the same whatever the command does",
    source="Ivantysyn, Ivantysynova: Hydrostatic Pumps and Motors, 2001",
    sentence="A disturbance of {frequency} with amplitude {amplitude} runs through everything.",
)
