"""Write the recordings of a case, as a bench would leave them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..truth.law import Array
from ..truth.noise import WHITE, converted, noise
from ..truth.simulate import SAMPLE_S, Unit, displayed
from .draw import programme_of
from .play import BASELINE, CHANGED, UNSEEN, Played, play
from .truth import Truth


@dataclass(frozen=True, slots=True)
class Recorded:
    """A recording: its name, command, noisy channels (samples × channels), and the output without noise."""

    name: str
    command: Array
    channels: Array
    clean: Array


def write_case(truth: Truth, folder: Path) -> None:
    """Write `case.toml`, `baseline/*.csv` and `changed/*.csv`; nothing in them tells the truth."""
    commands = programme_of(truth.seed, truth.label)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "case.toml").write_text(
        f'valve = "{truth.plant.name}"\nsample_rate_hz = {1.0 / SAMPLE_S:g}\n'
        f'input = "{truth.plant.command.heading}"\noutput = "{truth.plant.channels[0].heading}"\n'
    )
    healthy, afflicted = truth.healthy(), truth.afflicted()
    for played in play(healthy, commands.baseline, truth.key + BASELINE):
        write(truth, record(truth, healthy, played), folder / "baseline")
    for played in play(afflicted, commands.changed, truth.key + CHANGED):
        write(truth, record(truth, afflicted, played), folder / "changed")


def unseen(truth: Truth) -> list[Recorded]:
    """Return the recordings that are never handed over."""
    commands, afflicted = programme_of(truth.seed, truth.label).unseen, truth.afflicted()
    return [record(truth, afflicted, played) for played in play(afflicted, commands, truth.key + UNSEEN)]


def record(truth: Truth, unit: Unit, played: Played) -> Recorded:
    """Add noise, what links and converters do to samples, and the resolution of 16 bits."""
    rng = np.random.default_rng([played.number, 4])
    channels = truth.plant.channels[: None if truth.intermediate else 1]
    columns = [
        played.channels[:, i] + noise(truth.colour if i == 0 else WHITE, channel.noise, len(played.command), rng)
        for i, channel in enumerate(channels)
    ]
    columns[0] = displayed(unit, columns[0], played.number)
    digitised = [converted(column, channel.span) for column, channel in zip(columns, channels, strict=True)]
    return Recorded(played.name, played.command, np.stack(digitised, axis=1), played.shown)


def write(truth: Truth, recorded: Recorded, folder: Path) -> Path:
    """Write one recording as CSV."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{recorded.name}.csv"
    count = recorded.channels.shape[1]
    headings = ["time [s]", truth.plant.command.heading, *(c.heading for c in truth.plant.channels[:count])]
    time_s = np.arange(len(recorded.command)) * SAMPLE_S
    rows = np.column_stack([time_s, recorded.command, recorded.channels])
    np.savetxt(
        path, rows, fmt=["%.3f", *["%.10g"] * (count + 1)], delimiter=",", header=",".join(headings), comments=""
    )
    return path
