"""Parameters by name, of a plant and of the effects in a model: `pilot_rate`, `friction.coulomb`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from hil.errors import SettingError, option
from hil.identification.grey_box.estimate import Unknown
from hil.physics.compose import effect
from hil.physics.model import Model, Value
from hil.physics.plant import Parameter, Parameters
from hil.physics.simulate import ActiveEffect


def named_values(model: Model) -> dict[str, Value]:
    """All parameters by name, those of effects as `effect.parameter`."""
    effects = {f"{e.name}.{name}": value for e in model.effects for name, value in e.parameters.items()}
    return {**model.parameters, **effects}


def all_values(model: Model) -> dict[str, float]:
    """The same as numbers."""
    return {name: found.value for name, found in named_values(model).items()}


def moved(model: Model, values: Parameters, stds: Mapping[str, float] | None = None) -> Model:
    """The model with new values for parameters and `effect.parameter`s."""

    def value(name: str, old: Value) -> Value:
        return Value(values[name], old.unit, (stds or {}).get(name)) if name in values else old

    parameters = {name: value(name, old) for name, old in model.parameters.items()}
    effects = tuple(
        replace(e, parameters={name: value(f"{e.name}.{name}", old) for name, old in e.parameters.items()})
        for e in model.effects
    )
    return replace(model, parameters=parameters, effects=effects)


def effects_at(effects: Sequence[ActiveEffect], values: Parameters) -> tuple[ActiveEffect, ...]:
    """Effects with new values for `effect.parameter`s."""
    if not any("." in name for name in values):
        return tuple(effects)
    return tuple(
        replace(e, parameters={name: values.get(f"{e.name}.{name}", v) for name, v in e.parameters.items()})
        for e in effects
    )


def unknown_of(model: Model, name: str) -> Unknown:
    """A parameter of a model's plant, or of an effect of it, as something to be estimated from where it is."""
    parameter, start = _found(model, name)
    is_usual = parameter.typical and "." not in name  # how strong an effect usually is says nothing of this one
    scale = parameter.scale if is_usual else abs(start) or parameter.scale
    return Unknown(name, parameter.unit, start, parameter.low, parameter.high, scale)


def check_free(model: Model, name: str) -> None:
    """Raise `SettingError` unless a model has a parameter of this name."""
    if name in all_values(model):
        return
    known = ", ".join(sorted(all_values(model)))
    of_effect = (
        f"; a plant has no effects: {option('plant')} names a model that has them, installed or the corrected.json "
        "of a diagnosis"
    )
    raise SettingError(
        f"{option('free')} {name}: the model of {model.plant} has no parameter '{name}'"
        f"{of_effect if '.' in name else ''}; known: {known}"
    )


def _found(model: Model, name: str) -> tuple[Parameter, float]:
    if "." not in name:
        return model.definition.parameter(name), model.values[name]
    effect_name, _, parameter_name = name.partition(".")
    active = next(e for e in model.effects if e.name == effect_name)
    at = effect(effect_name).parameters_at(model.definition.hook(active.hook))
    parameter = next(p for p in at if p.name == parameter_name)
    return parameter, active.parameters[parameter_name].value
