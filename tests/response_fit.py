"""Physical parameters of a plant from frequency responses at several amplitudes and biases together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hil.cores import parallel_map
from hil.identification.frequency.sine_test import SineTest
from hil.identification.grey_box.estimate import Estimate, estimate
from hil.identification.grey_box.free import moved, unknown_of
from hil.identification.uncertainty.fit import fit_percent
from hil.physics.model import Model
from hil.record.recording import Array, Complex


@dataclass(frozen=True, slots=True)
class ResponseFit:
    """A model fitted to frequency responses.

    Attributes:
        model: with the estimated values.
        estimate: names are `parameter` or `effect.parameter`.
        fits: complex fit in per cent per response, both taken over their value at the first frequency.
        responses: simulated, over their value at the first frequency, per response.
    """

    model: Model
    estimate: Estimate
    fits: tuple[float, ...]
    responses: tuple[Complex, ...]


def fit_responses(
    model: Model, free: Sequence[str], tests: Sequence[SineTest], measured: Sequence[Complex]
) -> ResponseFit:
    """Estimate parameters of a plant and of its effects so that simulated tests give the measured responses.

    Responses are compared over their magnitude at the first frequency (eq. 1 of the HPV41 paper), because
    published ones come so: the static gain takes no part.

    Args:
        model: start values, with the effects that take part.
        free: names of parameters, or `effect.parameter`, to estimate.
        tests: one per response, on its frequencies.
        measured: complex responses, shape (n,) each.
    """
    wanted = [_relative(response) for response in measured]
    spreads = [float(np.linalg.norm(w - w.mean())) for w in wanted]

    def residuals(values: Array) -> Array:
        tried = moved(model, dict(zip(free, values.tolist(), strict=True)))
        parts = [
            (_simulated(tried, test) - want) / spread for test, want, spread in zip(tests, wanted, spreads, strict=True)
        ]
        whole = np.concatenate(parts)
        return np.concatenate((whole.real, whole.imag))

    found = estimate(residuals, [unknown_of(model, name) for name in free], tolerance=1e-6)
    stds = dict(zip(free, found.std.tolist(), strict=True))
    best = moved(model, found.named, stds)
    responses = tuple(parallel_map(lambda test: _simulated(best, test), tests))
    fits = tuple(fit_percent(want, got) for want, got in zip(wanted, responses, strict=True))
    return ResponseFit(best, found, fits, responses)


def _simulated(model: Model, test: SineTest) -> Complex:
    return _relative(test.response(model.definition, model.values, model.active_effects))


def _relative(response: Complex) -> Complex:
    return response / abs(response[0])
