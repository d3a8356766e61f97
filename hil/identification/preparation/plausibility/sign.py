"""An output that runs the other way than its model."""

from __future__ import annotations

from dataclasses import replace

from hil.identification.preparation.experiment import Experiment
from hil.identification.preparation.plausibility.suspicion import (
    POOR_FIT,
    Suspicion,
    fit_but_for_gain,
    moves,
    spoken_of,
)
from hil.identification.uncertainty.fit import fit_percent
from hil.language.note import Note
from hil.physics.model import Model
from hil.record.recording import Array


def reversed_sign(model: Model, e: Experiment, simulated: Array) -> Suspicion | None:
    """An output that is what the model expects but for its sign; `simulated` of `expected`."""
    before, turned = fit_percent(e.output, simulated), _turned(model, e, simulated)
    if not (before < 0.0 and turned > POOR_FIT) or _has_either_sign(model, e, simulated):
        return None
    reversed_ = Note(
        "the output '{channel}' runs the other way: where {model} rises, it falls; is its sign right, or that of the "
        "command?",
        channel=e.output_heading, model=spoken_of(model),
    )  # fmt: skip
    return Suspicion(e.name, reversed_.of(e.name), turned)


def _has_either_sign(model: Model, e: Experiment, simulated: Array) -> bool:
    """Whether a parameter that may have either sign turns the output round: its sign is the bench's own."""
    if model.origin:
        return False
    either = [p for p in model.definition.parameters if not p.fixed and p.low < 0.0 < p.high]
    turned = (e.respond(model.definition, model.values | {p.name: -model.values[p.name]}, ())[0] for p in either)
    return any(moves(simulated, other)[0] < 0.0 for other in turned)


def _turned(model: Model, e: Experiment, simulated: Array) -> float:
    """The fit with the sign reversed; a position that adds up starts on the other side of zero too."""
    if model.definition.observer is None:
        slope, fit = moves(simulated, e.output)
        return fit if slope < 0.0 else 0.0
    begins = replace(e.drive, first_output=-e.drive.first_output)
    return fit_but_for_gain(model, replace(e, drive=begins, output=-e.output))
