"""What a plant answers to a command, as a bench would have recorded it."""

from __future__ import annotations

import numpy as np

from hil.physics.plant import Plant
from hil.physics.simulate import ActiveEffect, Drive, simulate
from hil.record.recording import Array, Recording, recording


def answer(
    of: Plant, command: Array, interval_s: float, *effects: ActiveEffect, noise: Array | float = 0.0,
    start: float = 0.0, name: str = "run", factor: float = 1.0, **truth: float,
) -> Recording:  # fmt: skip
    """The command and the output with noise of a unit that is a typical one but for `truth`.

    `start`: the output before. `factor`: sub-steps over those that the plant takes.
    """
    read = simulate(of, of.typical | truth, Drive(command[None, :], start, interval_s), effects, factor=factor)[0]
    channels = {of.inputs[0].heading: command, of.output.heading: read + noise}
    return recording(name, interval_s * np.arange(len(command)), channels)
