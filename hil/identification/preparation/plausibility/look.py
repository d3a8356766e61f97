"""Everything that a recording may be mistaken for, held against a model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from hil.identification.preparation.content import is_of_its_origin
from hil.identification.preparation.criteria import CRITERIA
from hil.identification.preparation.experiment import Experiment
from hil.identification.preparation.plausibility.suspicion import (
    Suspicion,
    can_be_held_against,
    expected,
    fit_but_for_gain,
    good_fit,
    moves,
    spoken_of,
    stating_units,
)
from hil.identification.preparation.plausibility.time_unit import wrong_time
from hil.identification.preparation.plausibility.unit import wrong_unit
from hil.identification.uncertainty.fit import fit_percent
from hil.identification.uncertainty.noise import channel_floor, white_floor
from hil.language.note import Note
from hil.physics.model import Model
from hil.record.invalid_samples import across
from hil.record.recording import Array, split_heading


def suspicions(model: Model, experiments: Sequence[Experiment]) -> Iterator[Suspicion]:
    """What looks wrong in recordings whose output moves, time first; nothing in those the model was identified from."""
    if not can_be_held_against(model):
        return
    strange = [e for e in experiments if not (e.stands_still or is_of_its_origin(model, e))]
    yield from wrong_time(model, strange)
    for e in strange:
        yield from implausible(model, e)


def implausible_metadata(model: Model, e: Experiment) -> list[Note]:
    """The same of one recording, in words; nothing of one without an output."""
    return [one.sentence for one in suspicions(model, [e])] if e.valid.any() else []


def implausible(model: Model, e: Experiment) -> Iterator[Suspicion]:
    """What looks wrong in one recording, one suspicion after another; another time is looked for in all together."""
    if not can_be_held_against(model):
        return
    simulated = expected(model, e)
    for looked in (reversed_sign, swapped_columns, wrong_unit):
        if (found := looked(model, e, simulated)) is not None:
            yield found


def reversed_sign(model: Model, e: Experiment, simulated: Array) -> Suspicion | None:
    """An output that is what the model expects but for its sign; `simulated` of `expected`."""
    before, turned = fit_percent(e.output, simulated), _turned(model, e, simulated)
    if not (before < 0.0 and turned > CRITERIA.poor_fit) or _has_either_sign(model, e, simulated):
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


def swapped_columns(model: Model, e: Experiment, simulated: Array) -> Suspicion | None:
    """Two columns of which each is what the other should be, unless their user stated both units."""
    if e.stated_units.issuperset(split_heading(heading)[0] for heading in (e.input, e.output_heading)):
        return None
    command, before = e.on_grid_input(), fit_percent(e.output, simulated)
    # What is commanded has no noise, unless a position loop that keeps an integrating plant in its stroke commands it.
    by_a_loop = model.definition.observer is not None
    noisy = _noise_share(white_floor(command), command) > 10.0 * _noise_share(channel_floor(e.output), e.output)
    if before > CRITERIA.hopeless and not by_a_loop and not noisy:
        return None
    inputs = e.drive.inputs.copy()
    inputs[0] = across(e.to_follow)[0]
    turned = replace(e, drive=replace(e.drive, inputs=inputs, first_output=float(command[0])), output=command)
    enough = good_fit(model) if before <= CRITERIA.hopeless else CRITERIA.good_fit
    fit = fit_but_for_gain(model, turned)
    if not fit > max(enough, before + CRITERIA.fits_better):
        return None
    cause = Note(
        "the columns '{first}' and '{second}' look swapped: {model} fits the other way round. If they are right, "
        "{option} says so",
        first=e.input, second=e.output_heading, model=spoken_of(model), option=stating_units(e.input, e.output_heading),
    )  # fmt: skip
    return Suspicion(e.name, cause.of(e.name), fit)


def _noise_share(floor: float, values: Array) -> float:
    """Noise over how far a channel goes; a coarse one has at least that of its steps."""
    return floor / (float(np.ptp(values)) or 1.0)
