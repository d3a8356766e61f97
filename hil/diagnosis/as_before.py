"""What a model already left of the recordings that it was identified from: that is no news in later ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hil.diagnosis.problem import Problem
from hil.diagnosis.wording import quantity_text
from hil.diagnosis.yardsticks import PLAINLY
from hil.identification.mistaken.suspicion import is_of_its_origin

WHAT_IT_LACKS = "what the model itself lacks is found by a diagnosis of the recordings that it was identified from"


def is_asked_what_changed(problem: Problem) -> bool:
    """Whether the model was identified from other recordings: then it is asked what has changed since."""
    return bool(problem.model.origin) and not any(is_of_its_origin(problem.model, e) for e in problem.experiments)


def with_inner_noise(problem: Problem) -> Problem:
    """The question with inner signals as noisy as the model left them: what their simulation lacks is no news."""
    known = problem.model.origin.get("inner_rms") or {}
    noise = tuple(
        {name: max(floor, float(known.get(name, 0.0))) for name, floor in own.items()} for own in problem.observed_noise
    )
    return replace(problem, observed_noise=noise)


def as_before(problem: Problem) -> str:
    """In words that recordings leave no more than those that the model was identified from, where that was twice the
    noise; empty where they leave plainly more, or the model left nothing.
    """
    then, noise = float(problem.model.origin.get("misfit_rms") or 0.0), problem.model.noise
    if noise is None or then <= 2.0 * noise.std:
        return ""
    model = problem.model
    simulated = (e.respond(model.definition, model.values, model.active_effects)[0] for e in problem.experiments)
    left = [np.std((e.output - y)[e.told]) for e, y in zip(problem.experiments, simulated, strict=True)]
    if max(left) > PLAINLY * then:
        return ""
    already = f"which already left {quantity_text(then, None, model.output_unit)} (rms)"
    return f"The unit is as it was when the model was identified, {already}."
