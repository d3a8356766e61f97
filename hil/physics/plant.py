"""What a plant is: a chain of stages with named signals, written as one page of equations.

The page is a plain Python function `equations(<inputs>, x, c, hook)` that advances the state `x` by one
sub-step with the coefficients `c`, and asks `hook.NAME(value)` wherever an effect may act. The same page is
run as Python by the reference tests and compiled, effects included, by `hil.physics.compose`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from hil.record.recording import Array, split_heading

Parameters = Mapping[str, float]
"""Values of a plant's parameters, by name, in their units."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number of the physics, with its unit, where it usually lies and how far it may go.

    Where the plant takes any channel, `unit` may contain `{input}` and `{output}` (see `Plant.units`).
    `fixed` parameters are held at their value unless freed by name. `growth` names the effect that a larger
    value is known as (more dead time than the healthy unit had *is* `dead_time`), `change` what any other value
    is known as. `hook` names the hook nearest to where the parameter acts. `drift` is how far it may move without
    having changed, where the usual share of its size would be too much: of a place on a steep curve. `size` is natural
    for it where the typical value is 0 and the bounds are far.
    """

    name: str
    unit: str
    typical: float
    low: float
    high: float
    meaning: str
    fixed: bool = False
    growth: str = ""
    change: str = ""
    hook: str = ""
    drift: float | None = None
    size: float = 0.0

    @property
    def scale(self) -> float:
        """A natural size for steps in this parameter."""
        return abs(self.typical) or self.size or (self.high - self.low) / 10.0

    def refusal(self, value: float) -> str:
        """Why it cannot have a value: `0.5 s; allowed are 0 … 0.2`; empty for one that it can have."""
        if self.low <= value <= self.high:
            return ""
        return f"{value:g} {self.unit}; allowed are {self.low:g} … {self.high:g}"


@dataclass(frozen=True, slots=True)
class Signal:
    """A named quantity of the plant with the unit that its equations use."""

    name: str
    unit: str
    full_scale: float = 1.0

    @property
    def heading(self) -> str:
        """`name [unit]`, as in a column header."""
        return f"{self.name} [{self.unit}]"


@dataclass(frozen=True, slots=True)
class Hook:
    """A named place in the chain where effects may act.

    Attributes:
        name: as in `hook.NAME(...)` on the page; effects list the names where they belong.
        stage: the stage of the chain, in the words of a fitter.
        unit, full_scale: of the value that passes; effects scale their bounds and typical values by it. Where the
            plant takes any channel, `unit` is `{input}` or `{output}`, as in its parameters.
        extra: what else the page hands over at this hook. `mobility` marks a force hook: effects return a
            force, each takes its share of the free velocity, and the hook returns their sum.
        motion_unit, motion_scale: of the travel of the part that a force acts on, where it is not counted in the
            unit of the force.
        slower: how many times slower than in a valve everything is there; effects scale times and rates by it.
    """

    name: str
    stage: str
    unit: str
    full_scale: float
    extra: str = ""
    motion_unit: str = ""
    motion_scale: float = 0.0
    slower: float = 1.0

    @property
    def is_force(self) -> bool:
        """Whether effects here return a force (see `extra`)."""
        return self.extra == "mobility"


@dataclass(frozen=True, slots=True)
class Structure:
    """One of the shapes that a plant can take: which parameters it has, the others being off.

    A plant that lists structures asks identification to choose among them by evidence.

    Attributes:
        name: as a report would say it.
        free: parameters in it; every other stays at its typical value, which must mean "not there".
        after: structure whose estimate this one starts from; empty for the first.
        starts: where to start what is new, each tried: times as a multiple of the slowest time in the structure
            before (of trial times between sample and record where it has none), other numbers as they are.
        fixed: parameters that have another value than their typical one in it.
    """

    name: str
    free: tuple[str, ...]
    after: str = ""
    starts: tuple[Mapping[str, float], ...] = ({},)
    fixed: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Travel:
    """How far an output went, and whether it was driven against an end of its range there."""

    least: float
    greatest: float
    ends_at_least: bool = False
    ends_at_greatest: bool = False


@dataclass(frozen=True, slots=True)
class Plant:
    """A plant: signals, parameters, hooks, and its page of equations.

    Attributes:
        equations: the page; returns the output followed by the `observed` signals.
        coefficients: (parameters, step_s) → coefficients of one sub-step. A step of infinity asks for the
            steady state: linear stages then pass their input through.
        initial: (parameters, first inputs, first output) → states that the steady state does not tell
            (the position of an integrating cylinder).
        states: scalars and their number of words; `lines_s`: delay lines and the time that they must hold,
            or the parameter that says it.
        sub_step_s: the longest sub-step at which the page is accurate.
        inputs: the first is the command; further ones are measured disturbances.
        observed: inner signals that a bench may record (spool position, supply pressure).
        structures: shapes to choose from by evidence, each after the one that it grows from; empty when the
            plant has one shape. `switches`: parameters that are 0 or 1, tried both ways beside them.
        observer: (parameters, interval_s) → by how much each of these states moves, from sample to sample, for one unit
            of output by which the simulation fell short. For plants that integrate: what is wrong at one moment
            then shows at that moment, and does not add up. None where states forget by themselves.
        integrates: parameters → whether the output goes on while the input stands, so that all later samples count
            from the first. None for a plant that never does, or always (then it has an observer).
        zero: (parameters, travel) → parameters that it tells: where a position counts from. Empty where it counts as
            the page does. None for an output with a zero of its own.
        rectifies: whether its first stage responds to a dither that ends at the command's range otherwise than to the
            mean of what is left of it. Such a plant is driven by the dither itself there.
    """

    name: str
    title: str
    inputs: tuple[Signal, ...]
    output: Signal
    parameters: tuple[Parameter, ...]
    hooks: tuple[Hook, ...]
    equations: Callable[..., Any]
    coefficients: Callable[[Mapping[str, float], float], Mapping[str, float | Array]]
    sub_step_s: float
    observed: tuple[Signal, ...] = ()
    states: Mapping[str, int] = field(default_factory=dict)
    lines_s: Mapping[str, float | str] = field(default_factory=dict)
    initial: Callable[[Mapping[str, float], tuple[float, ...], float], Mapping[str, float]] = field(
        default=lambda _parameters, _inputs, _output: {}
    )
    source: str = ""
    structures: tuple[Structure, ...] = ()
    switches: tuple[str, ...] = ()
    observer: Callable[[Mapping[str, float], float], Mapping[str, float]] | None = None
    integrates: Callable[[Mapping[str, float]], bool] | None = None
    zero: Callable[[Mapping[str, float], Travel], Mapping[str, float]] | None = None
    rectifies: bool = False

    @property
    def typical(self) -> dict[str, float]:
        """Every parameter at its typical value."""
        return {parameter.name: parameter.typical for parameter in self.parameters}

    @property
    def scalars(self) -> tuple[str, ...]:
        """The states of one word each, in the kernel's order."""
        return tuple(name for name, width in self.states.items() if width == 1)

    def line_words(self, parameters: Mapping[str, float], step_s: float, most: float = math.inf) -> list[int]:
        """How many words each delay line takes at these parameters and sub-steps; `most` sub-steps are looked back."""
        held_s = (parameters[length] if isinstance(length, str) else length for length in self.lines_s.values())
        return [math.ceil(min(time_s / step_s, most)) + 4 for time_s in held_s]

    def forgets(self, parameters: Mapping[str, float]) -> bool:
        """Whether where it stood at the start is forgotten after a while."""
        return self.observer is None and not (self.integrates is not None and self.integrates(parameters))

    def parameter(self, name: str) -> Parameter:
        """A parameter by its name; `KeyError` if there is none."""
        return {parameter.name: parameter for parameter in self.parameters}[name]

    @staticmethod
    def in_units(unit: str, input_heading: str, output_heading: str) -> str:
        """A unit of the plant's page when it drives these channels (`name [unit]`)."""
        of_output = split_heading(output_heading)[1]
        return of_output if unit == "any" else unit.format(input=split_heading(input_heading)[1], output=of_output)

    def units(self, input_heading: str, output_heading: str) -> dict[str, str]:
        """Units of all parameters by name when the plant drives these channels (`name [unit]`)."""
        return {p.name: self.in_units(p.unit, input_heading, output_heading) for p in self.parameters}

    def stage(self, parameter: str) -> str:
        """The stage of the chain on which a parameter acts; empty when it is no single one."""
        at = self.parameter(parameter).hook
        return self.hook(at).stage if at else ""

    def hook(self, name: str) -> Hook:
        """A hook by its name; `KeyError` if there is none."""
        return {hook.name: hook for hook in self.hooks}[name]
