"""How often a healthy unit is called anything but consistent: counted by plant, noise and length, else unknown."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal

from hil.language.note import Note
from hil.signals.interval import exact_limits

Colour = Literal["white", "coloured"]

# Cases of the concealment proof without an effect (own equations, four recordings), and for the HPV41 300 units of
# three short ones (docs/explanation/proof.md).
_COUNTED = Path(__file__).with_name("false_alarms.csv")


@dataclass(frozen=True, slots=True)
class FalseAlarms:
    """A rate and where it holds.

    Attributes:
        rate: upper end of the exact 95 % interval; None where nothing was counted.
        scope: of which units it was counted, one sentence.
    """

    rate: float | None
    scope: Note


@dataclass(frozen=True, slots=True)
class Counted:
    """Alarms among healthy units of a plant whose recordings lasted so long in all; `noise` with or without colour."""

    plant: str
    noise: Colour
    lasting_s: float
    alarms: int
    units: int

    def is_like(self, lasting_s: float) -> bool:
        """Whether recordings are neither twice as long nor half as long."""
        return 0.5 < lasting_s / self.lasting_s < 2.0


def false_alarms(plant: str, noise: Colour, lasting_s: float) -> FalseAlarms:
    """The rate for a plant of the library, for noise of a kind and recordings that last so long in all.

    Nothing is known of other plants, and of recordings that are much longer or shorter than those that were counted.
    """
    rows = [row for row in _counted() if row.plant == plant and row.noise == noise]
    if not rows:
        return FalseAlarms(None, Note("not counted for the plant '{plant}'", plant=plant))
    alike = [row for row in rows if row.is_like(lasting_s)]
    if not alike:
        other = Note("counted for recordings of {lengths} in all, not for {lasting_s:.3g} s",
                     lengths=_lengths(rows), lasting_s=lasting_s)  # fmt: skip
        return FalseAlarms(None, other)
    alarms, units = sum(row.alarms for row in alike), sum(row.units for row in alike)
    _, high = exact_limits(alarms, units)
    scope = Note(
        "{alarms} alarms of {units} healthy simulated units of the plant '{plant}', {noise} noise, recorded for "
        "{lengths} in all",
        alarms=alarms, units=units, plant=plant, noise=Note(noise), lengths=_lengths(alike),
    )  # fmt: skip
    return FalseAlarms(round(high, 4), scope)


def _lengths(rows: Sequence[Counted]) -> tuple[str, ...]:
    return tuple(f"{row.lasting_s:g} s" for row in rows)


@cache
def _counted() -> tuple[Counted, ...]:
    with _COUNTED.open(encoding="utf-8", newline="") as file:
        return tuple(
            Counted(row["plant"], "white" if row["noise"] == "white" else "coloured",
                    float(row["lasting [s]"]), int(row["alarms"]), int(row["units"]))
            for row in csv.DictReader(file)
        )  # fmt: skip
