"""The signals of a simulated plant to which instruments can be connected."""

from __future__ import annotations

from dataclasses import dataclass

from hil.physics.model import Model
from hil.record.recording import split_heading


@dataclass(frozen=True, slots=True)
class Line:
    """A signal: its name in the plant, the unit in which it runs, and whether it drives the plant."""

    signal: str
    unit: str
    driven: bool


def lines_of(model: Model) -> dict[str, Line]:
    """Every signal of the plant by its name, and by the name of the channel that the model was made for.

    So a transfer function that was identified from `command [%]` to `flow [l/min]` has a `command` and a `flow`.
    """
    plant = model.definition
    lines = {signal.name: Line(signal.name, signal.unit, driven=True) for signal in plant.inputs}
    lines |= {signal.name: Line(signal.name, signal.unit, driven=False) for signal in (plant.output, *plant.observed)}
    for heading, signal, driven in ((model.input, plant.inputs[0], True), (model.output, plant.output, False)):
        if "[" in heading:
            name, unit = split_heading(heading)
            lines.setdefault(name, Line(signal.name, unit if signal.unit == "any" else signal.unit, driven))
    return lines
