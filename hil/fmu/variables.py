"""The variables of an FMU: which there are, what they are called, where they start and how far they may go."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

from hil.errors import UnknownNameError
from hil.physics.compose import Kernel, Site, kernel
from hil.physics.model import Model
from hil.physics.plant import Plant, Signal

FAR = 1e300  # stands for infinity, which is no number to some tools
_LINE = 10_000  # steps that a delay line can hold, where twice the model's dead time is no more


@dataclass(frozen=True, slots=True)
class Variable:
    """A settable number. `start` is NaN where it is not known."""

    name: str
    unit: str
    start: float
    low: float
    high: float
    meaning: str


@dataclass(frozen=True)
class Variables:
    """What an FMU of a model shows, in the order of its value references; reference 0 is time.

    Attributes:
        model: what is exported. `kernel`: its plant with the effects that can be switched on.
        parameters: of the plant, of each effect, then the output at the start where a plant asks for it.
        effects_at: by effect, the place of its first parameter in `parameters`.
        step_s: internal step.
    """

    model: Model
    kernel: Kernel
    parameters: tuple[Variable, ...]
    effects_at: tuple[int, ...]
    step_s: float

    @property
    def plant(self) -> Plant:
        """The plant of the model."""
        return self.kernel.plant

    @property
    def inputs(self) -> tuple[Signal, ...]:
        """Input signals."""
        return tuple(self.plant.inputs)

    @property
    def outputs(self) -> tuple[Signal, ...]:
        """The output, then the observed signals."""
        return (self.plant.output, *self.plant.observed)

    @property
    def first_input(self) -> int:
        """Value reference of the first input."""
        return 1

    @property
    def first_output(self) -> int:
        """Value reference of the first output."""
        return self.first_input + len(self.inputs)

    @property
    def first_parameter(self) -> int:
        """Value reference of the first parameter."""
        return self.first_output + len(self.outputs)

    @property
    def first_switch(self) -> int:
        """Value reference of the first effect's switch."""
        return self.first_parameter + len(self.parameters)

    @property
    def units(self) -> list[str]:
        """Every unit that occurs."""
        signals = {signal.unit for signal in (*self.inputs, *self.outputs)}
        return sorted(signals | {variable.unit for variable in self.parameters} | {"s"})

    def is_on(self, site: Site) -> bool:
        """Whether the model has an effect switched on."""
        return any(effect.key == site.key for effect in self.model.effects)


def variables_of(model: Model, also: Collection[tuple[str, str]] = (), step_s: float | None = None) -> Variables:
    """The variables of a model's FMU.

    Args:
        model: with its effects, which can be switched off.
        also: (effect, hook) of others, which are off at first: faults to be injected.
        step_s: internal step; the plant's own when not given.

    Raises:
        UnknownNameError: an effect that this plant does not have there.
    """
    whole = kernel(model.plant)
    for key in also:
        if key not in whole.indices:
            raise UnknownNameError(f"effect of {model.plant}", "@".join(key), ["@".join(k) for k in whole.indices])
    reduced = whole.with_sites({*(effect.key for effect in model.effects), *also})
    step_s = step_s or whole.plant.sub_step_s
    found = list(_of_plant(model, whole.plant, step_s))
    starts = []
    for site in reduced.sites:
        starts.append(len(found))
        found += _of_effect(model, site)
    if asks_for_start(whole.plant):
        meaning = "output at the start, where the steady state does not tell it; NaN: not known"
        found.append(Variable("initial_output", model.output_unit, math.nan, -FAR, FAR, meaning))
    return Variables(model, reduced, tuple(found), tuple(starts), step_s)


def asks_for_start(plant: Plant) -> bool:
    """Whether the plant has states that a steady state cannot tell."""
    return plant.initial.__name__ != "<lambda>"


def variable_name(signal: Signal) -> str:
    """A signal's name without spaces."""
    return signal.name.replace(" ", "_")


def _of_plant(model: Model, plant: Plant, step_s: float) -> list[Variable]:
    found, lines = [], set(plant.lines_s.values())
    for parameter in plant.parameters:
        value = model.parameters[parameter.name]
        low, high = min(parameter.low, value.value), max(parameter.high, value.value)
        if parameter.name in lines:  # C has no more memory than it is compiled with
            high = min(high, max(2.0 * value.value, _LINE * step_s))
        found.append(
            Variable(f"plant.{parameter.name}", value.unit, value.value, _near(low), _near(high), parameter.meaning)
        )
    return found


def _of_effect(model: Model, site: Site) -> list[Variable]:
    own = next((e for e in model.effects if e.key == site.key), None)
    null, found = site.effect.null_at(site.hook), []
    for parameter in site.effect.parameters_at(site.hook):
        value = _near(own.parameters[parameter.name].value if own else null[parameter.name])
        name = f"effect.{site.effect.name}.{site.hook.name}.{parameter.name}"
        low, high = _near(min(parameter.low, value)), _near(max(parameter.high, value))
        found.append(Variable(name, model.resolved_unit(parameter.unit), value, low, high, parameter.meaning))
    return found


def _near(value: float) -> float:
    return min(max(value, -FAR), FAR)
