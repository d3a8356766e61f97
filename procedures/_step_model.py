"""The first-order model with dead time that follows a measured step best."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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
    from scipy.optimize import least_squares

    change = figures.final - figures.start
    share = (measured - figures.start) / change

    def follow(p: Array) -> Array:
        late = np.maximum(time_s - p[1], 0.0)
        return -np.expm1(-late / p[0])

    longest_s = float(time_s[-1])
    first = [max(figures.rise_s / np.log(9.0), 1e-6), max(figures.onset_s, 0.0)]

    def residuals(p: Array) -> Array:
        return follow(p) - share

    def slopes(p: Array) -> Array:
        late = np.maximum(time_s - p[1], 0.0)
        left = np.exp(-late / p[0]) / p[0]
        return np.column_stack((-left * late / p[0], -left * (late > 0.0)))

    found = least_squares(
        residuals, np.clip(first, 1e-6, 0.9 * longest_s), jac=slopes,
        bounds=([1e-7, 0.0], [10.0 * longest_s, longest_s]), x_scale=[first[0], first[0]],
    )  # fmt: skip
    constant_s, dead_time_s = found.x.tolist()
    text = Note(
        "first order: time constant {constant_ms:.3g} ms, dead time {dead_time_ms:.3g} ms",
        constant_ms=1e3 * constant_s, dead_time_ms=1e3 * dead_time_s,
    )  # fmt: skip
    return StepModel(figures.start + change * follow(found.x), text)
