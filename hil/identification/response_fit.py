"""Physical parameters of a plant from frequency responses at several amplitudes and biases together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hil.cores import spread
from hil.identification.estimate import Estimate, Unknown, estimate
from hil.identification.sine_test import SineTest
from hil.identification.transfer_function import fit_percent
from hil.physics.compose import effect
from hil.physics.model import Model, Value
from hil.physics.plant import Parameter
from hil.record.recording import Array

Complex = NDArray[np.complex128]


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
        moved = _moved(model, dict(zip(free, values.tolist(), strict=True)))
        parts = [
            (_simulated(moved, test) - want) / spread for test, want, spread in zip(tests, wanted, spreads, strict=True)
        ]
        whole = np.concatenate(parts)
        return np.concatenate((whole.real, whole.imag))

    found = estimate(residuals, [_unknown(model, name) for name in free], tolerance=1e-6)
    stds = dict(zip(free, found.std.tolist(), strict=True))
    best = _moved(model, dict(zip(free, found.values.tolist(), strict=True)), stds)
    responses = tuple(spread(lambda test: _simulated(best, test), tests))
    fits = tuple(fit_percent(want, got) for want, got in zip(wanted, responses, strict=True))
    return ResponseFit(best, found, fits, responses)


def _simulated(model: Model, test: SineTest) -> Complex:
    return _relative(test.response(model.definition, model.values, model.active_effects))


def _relative(response: Complex) -> Complex:
    made: Complex = response / abs(response[0])
    return made


def _moved(model: Model, values: Mapping[str, float], stds: Mapping[str, float] | None = None) -> Model:
    """The model with new values for parameters and `effect.parameter`s."""

    def value(name: str, old: Value) -> Value:
        return Value(values[name], old.unit, (stds or {}).get(name)) if name in values else old

    parameters = {name: value(name, old) for name, old in model.parameters.items()}
    effects = tuple(
        replace(e, parameters={name: value(f"{e.name}.{name}", old) for name, old in e.parameters.items()})
        for e in model.effects
    )
    return replace(model, parameters=parameters, effects=effects)


def _unknown(model: Model, name: str) -> Unknown:
    parameter, start = _find(model, name)
    return Unknown(name, parameter.unit, start, parameter.low, parameter.high, abs(start) or parameter.scale)


def _find(model: Model, name: str) -> tuple[Parameter, float]:
    if "." not in name:
        return model.definition.parameter(name), model.values[name]
    effect_name, parameter_name = name.split(".")
    active = next(e for e in model.effects if e.name == effect_name)
    for parameter in effect(effect_name).parameters_at(model.definition.hook(active.hook)):
        if parameter.name == parameter_name:
            return parameter, active.parameters[parameter_name].value
    raise KeyError(name)
