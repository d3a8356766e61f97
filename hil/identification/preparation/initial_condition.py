"""The first reading of a plant that integrates: one noisy sample from which all later ones count.

A simulation may start only where the first sample says that the plant stands. What that sample got wrong stays as an
offset for the whole recording, and would be taken for physics. So the start is an unknown of its own: residuals are
those that are left when it is marginalised (Gaussian, linear), which is one rank-one step for each recording.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hil.identification.preparation.criteria import CRITERIA
from hil.identification.preparation.experiment import Experiment
from hil.physics.plant import Parameters, Plant
from hil.physics.simulate import ActiveEffect
from hil.record.recording import Array


def start_slope(
    e: Experiment,
    plant: Plant,
    parameters: Parameters,
    effects: Sequence[ActiveEffect],
    noise_std: float,
    factor: float = 1.0,
    plain: Array | None = None,
) -> Array | None:
    """What a start that is wrong by its uncertainty does to the output, in units of the noise, shape (n,).

    0 where the output says nothing. None where the plant does not start from its reading, or soon forgets it.
    `plain` is what the plant does from the reading as it stands, shape (n,), where the caller has simulated it.
    """
    known = plant.integrates is None or not plant.integrates(parameters)
    # a linear integrator is as much off as it has moved before its first sample, of which nobody knows
    step = CRITERIA.start * noise_std if known else max(CRITERIA.start * noise_std, float(np.ptp(e.output)))
    inputs = tuple(e.drive.inputs[:, 0].tolist())
    first = e.drive.first_output
    if plant.initial(parameters, inputs, first) == plant.initial(parameters, inputs, first + step):
        return None
    moved = replace(e, drive=replace(e.drive, first_output=first + step))
    if plain is None:
        plain = e.respond(plant, parameters, effects, factor=factor)[0]
    changed = moved.respond(plant, parameters, effects, factor=factor)[0]
    slope = e.telling((changed - plain) / noise_std)
    return slope if float(slope @ slope) > CRITERIA.felt_start**2 else None


def with_free_start(residuals: Array, slope: Array | None) -> Array:
    """Residuals whose sum of squares is that of the marginal likelihood, the start being unknown, shape (n,).

    Args:
        residuals: weighted to unit variance.
        slope: of the residuals in the start, in units of its uncertainty; None leaves them as they are.
    """
    if slope is None:
        return residuals
    power = float(slope @ slope)
    share = (1.0 - 1.0 / np.sqrt(1.0 + power)) / power
    return residuals - share * float(slope @ residuals) * slope
