"""How long a unit takes to follow its command."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hil.identification.preparation.criteria import EFFORT
from hil.identification.preparation.experiment import Experiment
from hil.physics.model import Model
from hil.physics.plant import Parameters, Plant
from hil.physics.simulate import ActiveEffect, Drive, simulate


def time_constant_s(model: Model, e: Experiment, moved: Parameters | None = None,
                    effects: Sequence[ActiveEffect] = ()) -> float:  # fmt: skip
    """Time after which a step of the command, as small as moves the output, has gone 63 % of its way.

    0 for plants that do not settle. `moved`: parameters that are other than in the model; `effects`: beside its own.
    """
    values, active = model.values | dict(moved or {}), [*model.active_effects, *effects]
    interval_s = e.interval_s
    found_s = _time_constant_s(model.definition, values, active, e, interval_s)
    while (
        found_s == 0.0 and (interval_s := EFFORT.resolved * interval_s) < EFFORT.longest_s
    ):  # it may not have moved in time
        found_s = _time_constant_s(model.definition, values, active, e, interval_s)
    while 0.0 < found_s <= EFFORT.resolved * interval_s and interval_s > EFFORT.instant * e.interval_s:
        interval_s /= EFFORT.resolved
        found_s = _time_constant_s(model.definition, values, active, e, interval_s)
    return found_s


def _time_constant_s(
    plant: Plant, values: Parameters, effects: Sequence[ActiveEffect], e: Experiment, interval_s: float
) -> float:
    for share in EFFORT.steps:
        # how much further the output moves with a step from where the recording begins than without
        rest, full = e.drive.inputs[:, :1], plant.inputs[0].full_scale
        held = np.repeat(rest, EFFORT.step_samples, axis=1)
        stepped = held.copy()
        stepped[0, 1:] += share * full * (-1.0 if rest[0, 0] > 0.5 * full else 1.0)
        drives = (Drive(inputs, e.drive.first_output, interval_s) for inputs in (held, stepped))
        without, answer = (simulate(plant, values, d, effects)[0] for d in drives)
        change = np.abs(answer - without)
        if change[-1] > 0.0:
            settles = abs(change[-1] - change[3 * EFFORT.step_samples // 4]) <= 0.01 * change[-1]
            return float(np.argmax(change >= 0.632 * change[-1])) * interval_s if settles else 0.0
    return 0.0
