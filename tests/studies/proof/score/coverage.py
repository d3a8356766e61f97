"""Whether 95 % intervals hold the truth, where truth and library mean the same quantity."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from ..cases.truth import Truth
from ..truth.catalog import all_laws

# base parameters of the truth by the names under which models carry them
LIBRARY_NAMES: dict[str, dict[str, str]] = {
    "brevini-hpv41": {
        "pilot": "pilot_rate",
        "spool_frequency": "spool_frequency",
        "spool_damping": "spool_damping",
        "full_flow": "full_flow",
        "curve_exponent": "curve_exponent",
    },
    "cummins-efc": {
        "rotor_frequency": "rotor_frequency",
        "rotor_damping": "rotor_damping",
        "closed_pressure": "closed_pressure",
        "pressure_span": "pressure_span",
        "centre": "curve_centre",
        "width": "curve_width",
    },
    # loop gain and cylinder speed act as their product unless the valve saturates; only the spool is compared
    "hydraforce-sp08-47c": {"spool_frequency": "spool_frequency", "spool_damping": "spool_damping"},
    "linear-axis": {"mass": "mass", "damping": "viscous"},
}


@dataclass(frozen=True, slots=True)
class Interval:
    """A reported quantity beside its truth."""

    name: str
    true: float
    value: float
    std: float

    @property
    def holds(self) -> bool:
        """Whether the 95 % interval holds the truth."""
        return abs(self.value - self.true) <= 1.96 * self.std


def intervals(truth: Truth, diagnosis: Mapping[str, Any]) -> list[Interval]:
    """Return all quantities of a diagnosis that can be compared."""
    return [*_of_effects(truth, diagnosis), *_of_parameters(truth, diagnosis)]


def _of_effects(truth: Truth, diagnosis: Mapping[str, Any]) -> Iterator[Interval]:
    for hidden in truth.hidden:
        law = all_laws()[hidden.law]
        said = [effect for effect in diagnosis["effects"] if effect["name"] == law.effect]
        for shared in law.shared if said else ():
            # without a common name, only a unit that occurs once tells which parameter is meant
            fitting = [p for p in said[0]["parameters"].values() if p["unit"] == shared.unit and p["std"] is not None]
            if len(fitting) == 1:
                true, found = shared.value(hidden.parameters), fitting[0]["value"]
                true = math.copysign(true, found) if shared.both_ways else true
                yield Interval(f"{law.effect}: {shared.name}", true, found, fitting[0]["std"])


def _of_parameters(truth: Truth, diagnosis: Mapping[str, Any]) -> Iterator[Interval]:
    said = {p["name"]: p for p in diagnosis["changed_parameters"]}
    for name, library_name in LIBRARY_NAMES[truth.label.plant].items():
        if library_name in said and truth.changed_unit[name] != truth.unit[name]:
            found = said[library_name]
            if found["std"] is not None:
                yield Interval(f"parameter: {library_name}", truth.changed_unit[name], found["to"], found["std"])
