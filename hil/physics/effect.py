"""What a physical effect is: one small file that says what it adds, where, and how it shows.

An effect's `transform` is compiled into every plant that has one of its hooks. It names what it needs and
nothing else; the composer passes by name:

    value       what passes the hook
    mobility    (force hooks) velocity gained per unit of force over one sub-step
    flow        (supply hook) flow demand as a share of full flow
    time_s      time since the start of the recording
    step_s      the sub-step
    opening     (flow hook) opening as a share of full opening
    travel      (load pressure hook) place of the load as a share of half its stroke
    full_scale  of the hook
    state       the effect's own memory, an array of `memory` words
    …           its own parameters, or the names that its `coefficients` returns
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, Literal, TypeVar, cast

from hil.kernel import Compiled
from hil.physics.plant import Hook, Parameter

F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F) -> F:
    """Mark a function as part of the compiled core (numba, numpy's rules for division by zero)."""
    return cast(F, Compiled(function, {"error_model": "numpy"}))


@compiled
def hold_first(value: float, state: Any) -> float:
    """The usual way to settle: the memory is filled with the first value, which passes unchanged."""
    state[:] = value
    return value


@compiled
def at_rest(value: float, state: Any) -> float:
    """To settle where the second word is a speed: at rest at the first value."""
    state[:] = value
    state[1] = 0.0
    return value


@dataclass(frozen=True, slots=True)
class EffectParameter:
    """A parameter of an effect. Where `unit` contains `{value}`, size and bounds are shares of full scale.

    Times, and what is counted per second, are as in a valve; a slower plant says at its hooks how much slower it is.

    `{motion}` stands for the unit of travel at a force hook; it is that of the value unless the hook says otherwise.

    `null` is the value at which the effect does nothing (infinity for a limit); None for shape parameters,
    which may have any value while the effect is null (a Stribeck velocity, a frequency).

    A `telling` shape is what tells the effect from others: at an end of its range, either of them or the upper one, it
    is something else.

    `by_law`: relative standard uncertainty of the value because nature's law is not quite this one (GUM 4.3, type B);
    from what the concealment proof found where noise left no doubt.
    """

    name: str
    unit: str
    null: float | None
    typical: float
    low: float
    high: float
    meaning: str
    telling: Literal["", "ends", "upper end"] = ""
    by_law: float = 0.0

    def at(self, hook: Hook) -> Parameter:
        """The parameter in the units of a hook of a plant."""
        scale = self.scale_at(hook)
        unit = self.unit.replace("{value}", hook.unit).replace("{motion}", hook.motion_unit or hook.unit)
        return Parameter(self.name, unit, self.typical * scale, self.low * scale, self.high * scale, self.meaning)

    def possible_at(self, hook: Hook) -> Parameter:
        """The parameter with bounds that no value passes: a share may be of more than the full scale of a hook."""
        there = self.at(hook)
        if "{value}" not in self.unit and "{motion}" not in self.unit:
            return there
        return replace(there, low=there.low if self.low >= 0.0 else -math.inf, high=math.inf)

    def scale_at(self, hook: Hook) -> float:
        """What a share of one is at a hook; for parameters that are no shares, what one is there."""
        time = self._time_at(hook)
        if "{motion}" in self.unit:
            return (hook.motion_scale or hook.full_scale) * time
        return hook.full_scale * time if "{value}" in self.unit else time

    def start_scale_at(self, hook: Hook) -> float:
        """What a start of one is at a hook: it counts the value as it is, and travel as if it were the value."""
        if "{motion}" in self.unit:
            return self.scale_at(hook) / hook.full_scale
        return self._time_at(hook)

    def _time_at(self, hook: Hook) -> float:
        if self.unit == "s":
            return hook.slower
        return 1.0 / hook.slower if self.unit == "Hz" or self.unit.endswith("/s") else 1.0


@dataclass(frozen=True, slots=True)
class Seen:
    """What passes a hook in the model's own simulation, from which fits of an effect start.

    Attributes:
        low, high: extremes of the value. `amplitude`: half its typical peak-to-peak, at least a little.
        speeds: quantiles (50, 90, 99 %) of its rate of change, per second.
        tones: (frequency in Hz, amplitude at the output, phase) of lines in what the model leaves unexplained.
        duration_s, interval_s: of the recordings.
    """

    low: float
    high: float
    amplitude: float
    speeds: tuple[float, float, float]
    tones: tuple[tuple[float, float, float], ...]
    duration_s: float
    interval_s: float

    def as_in_a_valve(self, slower: float) -> Seen:
        """The same in the time of a valve that is so many times faster."""
        typical, quick, quickest = (speed * slower for speed in self.speeds)
        return replace(
            self,
            speeds=(typical, quick, quickest),
            tones=tuple((frequency * slower, amplitude, phase) for frequency, amplitude, phase in self.tones),
            duration_s=self.duration_s / slower,
            interval_s=self.interval_s / slower,
        )

    @property
    def size(self) -> float:
        """The largest magnitude."""
        return max(abs(self.low), abs(self.high))

    def periods_s(self, *usual: float) -> list[float]:
        """Usual periods and those of the tones, as far as they have four samples at least."""
        periods = (*usual, *(1.0 / frequency for frequency, _, _ in self.tones if frequency > 0.0))
        return [period for period in periods if period >= 4.0 * self.interval_s]


Start = Mapping[str, float]
Values = Callable[[Seen], Sequence[float]]


def shares(of: Literal["size", "amplitude", "duration_s"], *values: float) -> Values:
    """Values as shares of what is seen."""
    return lambda seen: [value * getattr(seen, of) for value in values]


def grid(**values: Sequence[float] | Values) -> Callable[[Seen], list[Start]]:
    """Starts of fits: every combination of values of these parameters."""

    def starts(seen: Seen) -> list[Start]:
        found = [one(seen) if callable(one) else one for one in values.values()]
        return [dict(zip(values, point, strict=True)) for point in product(*found)]

    return starts


@dataclass(frozen=True, slots=True)
class Effect:
    """A physical effect and everything that the tool says about it.

    Attributes:
        name: one of the contract's names, or a new one. `known_as`: the name that a diagnosis uses, where one cause
            has several files because it acts in different ways in different plants.
        title: as a fitter would say it.
        hooks: where it can sit; a plant has it wherever it has a hook of that name.
        parameters: the first is the one whose size says how strong the effect is.
        transform: compiled; returns what leaves the hook.
        memory: words of state, or how many for (parameter bounds at the hook, sub-step).
        settle: compiled; like transform, for the steady state before the first sample.
        starts: where fits start, given what the model shows at the hook (`grid`): a limit that nothing reaches has no
            slope to follow. Parameters that are left out start at their typical value.
        coefficients: (parameters, step_s) → what `transform` takes, when that is not the parameters.
        equation: for the engineer; `signature`: what it looks like in data; `source`: literature.
        sentence: for the operator, with {parameter} places; {parameter:%} tells a share in percent, {parameter:?}
            nothing but what recordings have reached.
        multimodal: whether the misfit has many valleys over the parameters, so that a fit ends in any of them.
    """

    name: str
    title: str
    hooks: tuple[str, ...]
    parameters: tuple[EffectParameter, ...]
    transform: Callable[..., Any]
    equation: str
    signature: str
    source: str
    sentence: str
    starts: Callable[[Seen], Sequence[Start]]
    memory: int | Callable[[Mapping[str, Parameter], float], int] = 0
    settle: Callable[..., Any] | None = None
    coefficients: Callable[[Mapping[str, float], float], Mapping[str, float]] | None = None
    known_as: str = ""
    multimodal: bool = False

    @property
    def reported_name(self) -> str:
        """The name by which a diagnosis tells it."""
        return self.known_as or self.name

    def parameters_at(self, hook: Hook) -> tuple[Parameter, ...]:
        """The parameters in the units of a hook."""
        return tuple(parameter.at(hook) for parameter in self.parameters)

    def words_at(self, hook: Hook, step_s: float) -> int:
        """Words of state at a hook."""
        memory = self.memory
        return memory if isinstance(memory, int) else memory({p.name: p for p in self.parameters_at(hook)}, step_s)

    def null_at(self, hook: Hook) -> dict[str, float]:
        """Values at which the effect does nothing, in the units of a hook."""
        nulls = {}
        for own, there in zip(self.parameters, self.parameters_at(hook), strict=True):
            nulls[own.name] = there.typical if own.null is None else own.null * own.scale_at(hook)
        return nulls

    def starts_at(self, hook: Hook, seen: Seen) -> list[dict[str, float]]:
        """Starts in the units of a hook: `starts` counts travel in the unit of the value, and time as in a valve."""
        scales = {p.name: p.start_scale_at(hook) for p in self.parameters}
        found = self.starts(seen.as_in_a_valve(hook.slower))
        return [{name: value * scales[name] for name, value in start.items()} for start in found]
