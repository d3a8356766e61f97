"""How often an unchanged unit is called changed: counted on units of other structures than that of the plant."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

from hil.language.note import Note
from hil.signals.interval import exact_limits

_COUNTED = Path(__file__).with_name("false_alarms.csv")  # the sealed rounds of docs/explanation/proof.md, as they ran


@dataclass(frozen=True, slots=True)
class FalseAlarms:
    """A rate and where it holds.

    Attributes:
        rate: upper end of the exact 95 % interval; None where nothing was counted.
        scope: of which units it was counted, one sentence.
    """

    rate: float | None
    scope: Note


def false_alarms(plant: str, asked: str) -> FalseAlarms:
    """The rate for a plant of the library, among units that were as at identification.

    Args:
        plant: of the model.
        asked: `changed`; what a model leaves out has no rate, since no model is its unit.
    """
    if asked != "changed":
        return FalseAlarms(None, Note("counted for what has changed, not for what a model leaves out"))
    with _COUNTED.open(encoding="utf-8", newline="") as file:
        found = next((row for row in csv.DictReader(file) if row["plant"] == plant), None)
    if found is None:
        return FalseAlarms(None, Note("not counted for the plant '{plant}'", plant=plant))
    alarms, units, structures = (int(found[name]) for name in ("alarms", "units", "structures"))
    _, high = exact_limits(alarms, units)
    scope = Note(
        "alarms at {alarms} of {units} unchanged simulated units of {structures} structures other than that of the "
        "plant '{plant}'",
        alarms=alarms, units=units, structures=structures, plant=plant,
    )  # fmt: skip
    return FalseAlarms(round(high, 4), scope)
