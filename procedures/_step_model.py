"""The first-order model with dead time that follows a measured step best."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hil.identification.grey_box.estimate import Unknown, estimate
from hil.identification.step.step_response import StepFigures
from hil.language.note import Note
from hil.record.recording import Array


@dataclass(frozen=True, slots=True)
class StepModel:
    """A fitted step: the response, shape (n,), and its formula."""

    response: Array
    text: Note


def step_model(time_s: Array, measured: Array, figures: StepFigures) -> StepModel:
    """Least squares of start + change·(1 − e^(−(t − dead time)/T)) over time constant and dead time.

    Args:
        time_s: stamps from the step on (before it negative), shape (n,).
        measured: the response, shape (n,).
        figures: where it starts and ends, and a first guess of the rest.
    """
    change = figures.final - figures.start
    share = (measured - figures.start) / change

    def follow(p: Array) -> Array:
        late = np.maximum(time_s - p[1], 0.0)
        return -np.expm1(-late / p[0])

    longest_s, scale_s = float(time_s[-1]), max(figures.rise_s / np.log(9.0), 1e-6)
    unknowns = (
        Unknown("time_constant", "s", min(scale_s, 0.9 * longest_s), 1e-7, 10.0 * longest_s, scale_s),
        Unknown("dead_time", "s", min(max(figures.onset_s, 1e-6), 0.9 * longest_s), 0.0, longest_s, scale_s),
    )
    found = estimate(lambda p: follow(p) - share, unknowns).values
    constant_s, dead_time_s = found.tolist()
    text = Note(
        "first order: time constant {constant_ms:.3g} ms, dead time {dead_time_ms:.3g} ms",
        constant_ms=1e3 * constant_s, dead_time_ms=1e3 * dead_time_s,
    )  # fmt: skip
    return StepModel(figures.start + change * follow(found), text)
