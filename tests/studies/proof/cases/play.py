"""Play a programme to a unit: what was commanded and what the output was, free of noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..truth.law import Array
from ..truth.simulate import SUBSTEPS, Unit, displayed, respond, track

BASELINE, CHANGED, UNSEEN = 0, 10, 20
"""Numbers of the first recording of each group."""


@dataclass(frozen=True, slots=True)
class Played:
    """One recording without noise.

    Attributes:
        name: File name, without suffix.
        number: Unique among all recordings, for everything that chance decides in it.
        command: Samples of the command.
        channels: What sensors would show, shape (samples, channels).
        shown: The output as it arrives in the recording, which links and converters may have changed.
    """

    name: str
    number: int
    command: Array
    channels: Array
    shown: Array


def play(unit: Unit, commands: Mapping[str, Array], first: int, substeps: int = SUBSTEPS) -> list[Played]:
    """Play each command (each reference, on an axis in its position loop) to a unit."""
    return [_play(unit, name, number, x, substeps) for number, (name, x) in enumerate(commands.items(), first)]


def replay(unit: Unit, played: Played, substeps: int = SUBSTEPS) -> Array:
    """Return the output, shape (samples,), of another unit on the same command."""
    return displayed(unit, respond(unit, played.command, played.number, played.number, substeps)[:, 0], played.number)


def _play(unit: Unit, name: str, number: int, command: Array, substeps: int) -> Played:
    if unit.plant.tracked:
        blur = unit.plant.channels[0].noise * np.random.default_rng([number, 3]).standard_normal(len(command))
        command, channels = track(unit, command, blur, number, substeps=substeps)
    else:
        channels = respond(unit, command, number, number, substeps)
    return Played(name, number, command, channels, displayed(unit, channels[:, 0], number))
