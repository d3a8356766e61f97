"""What a recording looks like beside a model, if its headings are not to be believed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hil.errors import option
from hil.identification.preparation.criteria import CRITERIA
from hil.identification.preparation.experiment import Experiment
from hil.identification.uncertainty.fit import fit_percent
from hil.language.note import Note
from hil.physics.model import Model
from hil.record.recording import Array, split_heading


@dataclass(frozen=True, slots=True)
class Suspicion:
    """One heading that looks wrong.

    Attributes:
        recording: its name.
        sentence: what it looks like, for the operator.
        fit: of the model if it is so, in %.
    """

    recording: str
    sentence: Note
    fit: float

    def outweighs(self, fit: float, *, at_bounds: bool = False) -> bool:
        """Whether it is to be believed beside a fit of the recording as it says it is, in %.

        `at_bounds`: that fit drove parameters as far as any unit of the plant goes, and has no credit for it.
        """
        return not fit >= CRITERIA.poor_fit or self.fit >= (fit if at_bounds else 100.0 - CRITERIA.half * (100.0 - fit))


def can_be_held_against(model: Model) -> bool:
    """Whether the model says what to expect: one that was identified, or a plant with units of its own.

    One that followed none of its own recordings says nothing.
    """
    plant, own = model.definition, (model.origin.get("fit_percent") or {}).values()
    if own and max(own) < CRITERIA.poor_fit:
        return False
    return bool(model.origin) or "any" not in (plant.inputs[0].unit, plant.output.unit)


def spoken_of(model: Model) -> Note:
    """The model in a sentence to somebody who may have named a plant only."""
    return Note("the model") if model.origin else Note("a typical {plant}", plant=Note(model.definition.title))


def stating_units(*headings: str) -> str:
    """The options by which a user who knows better says that these headings are right."""
    return " ".join(option("unit", f"{name}={unit}") for name, unit in map(split_heading, headings))


def expected(model: Model, e: Experiment) -> Array:
    """What the model expects; led back to the recording where it would drift away from any, right or wrong."""
    plant = model.definition
    return e.respond(plant, model.values, model.active_effects, following=plant.observer is not None)[0]


def good_fit(model: Model) -> float:
    """From which fit on the channels are what they say; less where the model never fitted well, run freely.

    Never a poor fit: a recording that the model cannot follow in any unit says nothing of its units.
    """
    own = [] if model.definition.observer else list((model.origin.get("fit_percent") or {}).values())
    return (
        max(min(CRITERIA.good_fit, float(np.median(own)) - CRITERIA.less_than_own), CRITERIA.poor_fit)
        if own
        else CRITERIA.good_fit
    )


def fit_but_for_gain(model: Model, e: Experiment) -> float:
    """The fit of the model; with a gain that may have changed besides, where it fits well so."""
    simulated = expected(model, e)
    fit = fit_percent(e.output, simulated)
    if model.definition.observer is not None:
        return fit
    (gain, of_moves), (of_level, _) = moves(simulated, e.output), times(simulated, e.output)
    likely = all(1.0 / CRITERIA.changed_gain < found < CRITERIA.changed_gain for found in (gain, of_level))
    return max(fit, of_moves) if likely and of_moves > CRITERIA.good_fit else fit


def times(simulated: Array, measured: Array) -> tuple[float, float]:
    """How many times the one is in the other, and how much of that one (rms, in %) this explains."""
    power, size = float(simulated @ simulated), float(np.sqrt(measured @ measured))
    if power == 0.0 or size == 0.0:
        return 0.0, 0.0
    slope = float(simulated @ measured) / power
    return slope, 100.0 * (1.0 - float(np.linalg.norm(measured - slope * simulated)) / size)


def moves(simulated: Array, measured: Array) -> tuple[float, float]:
    """The same of how they move about their means."""
    return times(simulated - simulated.mean(), measured - measured.mean())
