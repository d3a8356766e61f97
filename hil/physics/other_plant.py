"""Whether a model is of another plant than the valve that was recorded."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from hil.catalog import base_plant
from hil.errors import HilError
from hil.language.note import Note
from hil.physics.compose import plant
from hil.physics.measured_curve import MEASURED

_VALVES = {measured: valve for valve, measured in MEASURED.items()}
PLANT = "plant"
"""Where the header of a run has the plant of its valve."""


def plant_of_run(meta: Mapping[str, Any]) -> str:
    """The plant of the valve that was recorded; empty where the recording does not say it.

    Runs of versions that did not write it down name the plant or the model of their valve.
    """
    valve = meta.get("valve")
    named = valve.get("plant") if isinstance(valve, Mapping) else None
    return str(meta.get(PLANT) or base_plant(str(named or "")))


def other_plants(model_plant: str, recorded: Iterable[tuple[str, Mapping[str, Any]]]) -> list[Note]:
    """A sentence for each recording that is of another plant than a model.

    A plant that takes any channels, a transfer function, is of no valve in particular and never another one.

    Args:
        model_plant: name of the model's plant.
        recorded: (name, header) of each recording.
    """
    plants = [(name, plant_of_run(meta)) for name, meta in recorded]
    return [
        Note(
            "{name} is a run of the plant {own}, the model is of {other}. What a verdict names may be nothing but the "
            "difference between the two plants.",
            name=name,
            own=own,
            other=model_plant,
        )
        for name, own in plants
        if own
        and own not in (base_plant(model_plant), _VALVES.get(model_plant))
        and not (_is_general(own) or _is_general(model_plant))
    ]


def _is_general(name: str) -> bool:
    try:
        return plant(name).inputs[0].unit == "any"
    except HilError:  # a plant that is not installed here
        return False
