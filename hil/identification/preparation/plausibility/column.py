"""Command and response that stand under each other's headings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hil.identification.preparation.experiment import Experiment
from hil.identification.preparation.plausibility.suspicion import (
    GOOD_FIT,
    Suspicion,
    fit_but_for_gain,
    good_fit,
    spoken_of,
)
from hil.identification.uncertainty.fit import fit_percent
from hil.identification.uncertainty.noise import channel_floor, white_floor
from hil.language.note import Note
from hil.physics.model import Model
from hil.record.invalid_samples import across
from hil.record.recording import Array

# Where columns are swapped a model fits the one way hardly better than a mean does, and the other way well.
_HOPELESS, _FITS_BETTER = 35.0, 20.0


def swapped_columns(model: Model, e: Experiment, simulated: Array) -> Suspicion | None:
    """Two columns of which each is what the other should be; `simulated` of `suspicion.expected`."""
    command, before = e.on_grid_input(), fit_percent(e.output, simulated)
    # What is commanded has no noise, unless a position loop that keeps an integrating plant in its stroke commands it.
    by_a_loop = model.definition.observer is not None
    noisy = _noise_share(white_floor(command), command) > 10.0 * _noise_share(channel_floor(e.output), e.output)
    if before > _HOPELESS and not by_a_loop and not noisy:
        return None
    inputs = e.drive.inputs.copy()
    inputs[0] = across(e.to_follow)[0]
    turned = replace(e, drive=replace(e.drive, inputs=inputs, first_output=float(command[0])), output=command)
    enough = good_fit(model) if before <= _HOPELESS else GOOD_FIT
    fit = fit_but_for_gain(model, turned)
    if not fit > max(enough, before + _FITS_BETTER):
        return None
    cause = Note(
        "the columns '{first}' and '{second}' look swapped: {model} fits the other way round",
        first=e.input, second=e.output_heading, model=spoken_of(model),
    )  # fmt: skip
    return Suspicion(e.name, cause.of(e.name), fit)


def _noise_share(floor: float, values: Array) -> float:
    """Noise over how far a channel goes; a coarse one has at least that of its steps."""
    return floor / (float(np.ptp(values)) or 1.0)
