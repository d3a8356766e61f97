"""A response that follows its command at once, as far as samples show: what is told of it, and what would tell more."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hil.identification.preparation.criteria import EFFORT
from hil.identification.preparation.experiment import Experiment
from hil.language.note import Note
from hil.physics.model import Model
from hil.physics.plant import Parameters
from hil.record.recording import Array
from hil.signals.colour import colour_factor
from hil.signals.interval import COVERED, UNIFORM

_LAGS = ("lag_time", "pair1_time", "pair2_time", "integrator_gain")


def responds_within_sample(values: Parameters) -> bool:
    """Whether a transfer function is a gain, with a dead time or without."""
    return all(values.get(name) == 0.0 for name in _LAGS)


def dead_time_std_s(experiments: Sequence[Experiment]) -> float:
    """How well such a one's dead time is told: between two samples all look the same, and it rests at either."""
    return 2.0 * UNIFORM * min(e.interval_s for e in experiments)


def sub_sample_limits(model: Model, experiments: Sequence[Experiment]) -> tuple[Note, ...]:
    """What is said of a transfer function without dynamics: why none were seen, and how they would be."""
    gain = model.parameters["gain"]
    if not responds_within_sample(model.values) or gain.std is None or not abs(gain.value) > COVERED * gain.std:
        return ()
    interval_s, hidden_s = min(e.interval_s for e in experiments), _longest_hidden_s(model, experiments)
    late = Note("the gain at rest and, to one sample, the dead time")
    if hidden_s < interval_s:
        over = Note(
            "the response is over within one sample, {interval_s:.3g} s: it determines {known}, no more. A time "
            "constant above {hidden_s:.2g} s would have shown: sample at {rate_hz:g} Hz or faster to see a shorter one",
            interval_s=interval_s, known=late, hidden_s=hidden_s, rate_hz=float(f"{1.0 / hidden_s:.2g}"),
        )  # fmt: skip
        return (over,)
    known = late if model.values["dead_time"] else Note("the gain at rest")
    if not math.isfinite(hidden_s):
        return (Note("the command is too slow for any time constant: it determines {known}, no more; add steps",
                     known=known),)  # fmt: skip
    hides = Note(
        "a time constant below {hidden_s:.2g} s does not show: the command determines {known}, no more. Faster changes "
        "of the command would show it",
        known=known, hidden_s=hidden_s,
    )  # fmt: skip
    return (hides,)


def _longest_hidden_s(model: Model, experiments: Sequence[Experiment]) -> float:
    """The longest lag that these recordings do not tell from none (95 %); infinite where any may hide."""

    def errors(lag_s: float) -> list[Array]:
        values = model.values | {"lag_time": lag_s}
        return [e.telling(e.respond(model.definition, values, model.active_effects)[0] - e.output) for e in experiments]

    plain = np.concatenate(errors(0.0))
    allowed = float(plain @ plain) * (1.0 + COVERED**2 * colour_factor(plain) / int(np.count_nonzero(plain)))
    interval_s = min(e.interval_s for e in experiments)

    def shows(lag_s: float) -> bool:
        other = np.concatenate(errors(lag_s))
        return float(other @ other) > allowed

    low, high = math.log(EFFORT.shortest * interval_s), math.log(EFFORT.longest * interval_s)
    if not shows(math.exp(high)):
        return math.inf
    for _ in range(EFFORT.halvings):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if shows(math.exp(middle)) else (middle, high)
    return math.exp(high)
