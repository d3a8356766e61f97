"""The world behind simulated devices, as a bench file describes it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Literal

from pydantic import Field, FiniteFloat, PositiveFloat

from hil.catalog import models
from hil.errors import HilError, UnitError
from hil.physics.compose import effects as installed_effects
from hil.physics.effect import Effect
from hil.physics.model import Model, ModelEffect, Value, load_model, typical_model
from hil.physics.plant import Hook, Parameter, Plant
from hil.physics.pwm import CurrentLoop, PwmCoil, PwmDrive
from hil.strict import Strict
from hil.units import scale_and_offset
from sim_devices._lines import Line, lines_of

Place = tuple[str | int, ...]

_WIDEST_RAD_S, _SHARE_OF_CARRIER = 500.0, 0.5  # bandwidth of a current loop that reads once per period
_FAULT_OHM, _FAULT_H = {"open": 1e5, "short": 0.02}, {"open": 0.09, "short": 1e-4}


class SimulatedEffect(Strict):
    """An effect that is switched on; parameters not given are typical, `hook` may be left out if one fits."""

    name: str
    hook: str = ""
    parameters: dict[str, FiniteFloat] = Field(default_factory=dict)


class Coil(Strict):
    """The coil on a PWM current output, and its power stage: what flows has the carrier's ripple, and limits.

    Attributes:
        resistance_ohm, inductance_h: of the coil. `nominal_v`: of it.
        supply_v: of the power stage.
        rated_a: no demand is followed beyond it; half as much again opens the switch (short).
        bandwidth_rad_s: of the current loop; by the carrier, not above 500 rad/s, when not given.
        fault: the coil is `open` or `short` from the start.
    """

    resistance_ohm: PositiveFloat
    inductance_h: PositiveFloat
    supply_v: PositiveFloat
    nominal_v: PositiveFloat = 12.0
    rated_a: PositiveFloat = 2.5
    bandwidth_rad_s: PositiveFloat | None = None
    fault: Literal["", "open", "short"] = ""

    def drive(self, carrier_hz: float, rest_a: float) -> PwmDrive:
        """Its power stage at a carrier, at rest under a demand."""
        nominal = PwmCoil(self.resistance_ohm, self.inductance_h, self.supply_v, self.nominal_v, carrier_hz)
        bandwidth = self.bandwidth_rad_s or min(_WIDEST_RAD_S, _SHARE_OF_CARRIER * carrier_hz)
        there = nominal
        if self.fault:
            there = replace(nominal, resistance_ohm=_FAULT_OHM[self.fault], inductance_h=_FAULT_H[self.fault])
        return PwmDrive(CurrentLoop(bandwidth, nominal, self.rated_a), there, rest_a)


class Instrument(Strict):
    """What really hangs on a terminal: raw = (signal − offset) / slope, whatever the bench believes.

    Attributes:
        direction: `out` drives the plant, `in` reads it.
        signal: the plant's signal that it carries. An input may have a `value` instead, which just stands still;
            an output without a signal goes nowhere.
        powers: of an output: the plant's input that acts only while this output is not 0, as a relay's in its supply.
        pressed_s: of a contact, an input with a `value`: from then on it reads 0, as if somebody had pressed an
            emergency stop; on the device's own time.
        unit: in which `slope`, `offset` and `noise` are given.
        noise: standard deviation of its white noise.
        coil: of an output that is a PWM current: without one what is asked for flows.
    """

    direction: Literal["out", "in"] = "in"
    signal: str = ""
    powers: str = ""
    value: FiniteFloat | None = None
    pressed_s: FiniteFloat | None = Field(None, ge=0.0)
    unit: str = "1"
    slope: FiniteFloat = 1.0
    offset: FiniteFloat = 0.0
    noise: FiniteFloat = Field(0.0, ge=0.0)
    coil: Coil | None = None


class Simulation(Strict):
    """A plant, its effects, and the instruments on it, by the name of their channel.

    `plant` is the name of an installed plant or a model file; `parameters` are changed from its values, and
    `effects` added to its own, or put in the place of one that it has. The same `seed` gives the same noise,
    sample by sample.
    """

    plant: str
    parameters: dict[str, FiniteFloat] = Field(default_factory=dict)
    effects: tuple[SimulatedEffect, ...] = ()
    seed: int = Field(0, ge=0)
    instruments: dict[str, Instrument] = Field(default_factory=dict)


def faults(simulation: Simulation) -> Iterator[tuple[Place, str]]:
    """What cannot be simulated: unknown plants, parameters, effects and signals, each with its place."""
    try:
        base = _base(simulation)
    except HilError as error:
        yield ("plant",), str(error)
        return
    plant, lines = base.definition, lines_of(base)
    own = [replace(one, unit=base.resolved_unit(one.unit)) for one in plant.parameters]
    yield from _parameter_faults((), simulation.parameters, own)
    for i, effect in enumerate(simulation.effects):
        yield from _effect_faults(("effects", i), plant, effect)
    for name, instrument in simulation.instruments.items():
        yield from _instrument_faults(("instruments", name), plant, lines, instrument)
    yield from _driven_faults(plant, lines, simulation.instruments)


def model_of(simulation: Simulation) -> Model:
    """The plant with its values and every effect that is switched on, for a simulation without faults."""
    base = _base(simulation)
    changed = {name: replace(base.parameters[name], value=value) for name, value in simulation.parameters.items()}
    added = tuple(_switched_on(base.definition, effect) for effect in simulation.effects)
    return replace(base, parameters={**base.parameters, **changed}, effects=(*base.effects, *added))


def _base(simulation: Simulation) -> Model:
    name = simulation.plant
    return load_model(Path(name)) if name.endswith(".json") or name in models() else typical_model(name)


def _sites(plant: Plant, asked: SimulatedEffect) -> list[tuple[Effect, Hook]]:
    """Where an effect can sit: one place, or the choice is not clear."""
    return [(effect, hook) for hook in plant.hooks for effect in installed_effects()
            if effect.name == asked.name and hook.name in effect.hooks and asked.hook in ("", hook.name)]  # fmt: skip


def _switched_on(plant: Plant, asked: SimulatedEffect) -> ModelEffect:
    ((effect, hook),) = _sites(plant, asked)
    values = {parameter.name: Value(parameter.typical, parameter.unit) for parameter in effect.parameters_at(hook)}
    values |= {name: replace(values[name], value=value) for name, value in asked.parameters.items()}
    return ModelEffect(asked.name, hook.name, values)


def _effect_faults(place: Place, plant: Plant, asked: SimulatedEffect) -> Iterator[tuple[Place, str]]:
    sites = _sites(plant, asked)
    if not sites:
        known = ", ".join(f"{effect.name} at {hook.name}" for hook in plant.hooks for effect in installed_effects()
                          if hook.name in effect.hooks)  # fmt: skip
        where = f" at '{asked.hook}'" if asked.hook else ""
        yield (*place, "name"), f"plant {plant.name} takes no '{asked.name}'{where}; it takes: {known}"
    elif len(sites) > 1:
        hooks = ", ".join(hook.name for _, hook in sites)
        yield place, f"'{asked.name}' fits more than one place; say hook = one of {hooks}"
    else:
        ((effect, hook),) = sites
        yield from _parameter_faults(place, asked.parameters, [one.possible_at(hook) for one in effect.parameters])


def _instrument_faults(
    place: Place, plant: Plant, lines: Mapping[str, Line], instrument: Instrument
) -> Iterator[tuple[Place, str]]:
    is_out = instrument.direction == "out"
    known = {name: line for name, line in lines.items() if line.driven or not is_out}
    if instrument.signal in known:
        yield from _unit_faults(place, instrument.unit, known[instrument.signal].unit)
    elif instrument.signal:
        otherwise = 'signal = "" goes nowhere' if is_out else "value = … stands still"
        text = f"there is no signal '{instrument.signal}' of plant {plant.name} here, only {', '.join(known)}"
        yield place, f"{text}; in [simulation.{'.'.join(map(str, place))}] say which one it carries, or {otherwise}"
    if instrument.powers and (not is_out or instrument.powers not in {signal.name for signal in plant.inputs}):
        inputs = ", ".join(signal.name for signal in plant.inputs)
        yield place, f"powers = '{instrument.powers}': an output powers an input of plant {plant.name}: {inputs}"
    if instrument.pressed_s is not None and instrument.value is None:
        yield place, "pressed_s opens a contact: an input with a value, closed until then (value = …)"
    if not is_out and bool(instrument.signal) == (instrument.value is not None):
        yield place, "an input reads either a signal of the plant (signal = …) or a value that stands still (value = …)"


def _unit_faults(place: Place, unit: str, of_plant: str) -> Iterator[tuple[Place, str]]:
    try:
        if of_plant != "any":
            scale_and_offset(unit, of_plant)
    except UnitError as error:
        yield place, f"{error}; correct the channel's unit, or say which signal it carries"


def _driven_faults(
    plant: Plant, lines: Mapping[str, Line], instruments: Mapping[str, Instrument]
) -> Iterator[tuple[Place, str]]:
    driven = [lines[i.signal].signal for i in instruments.values() if i.direction == "out" and i.signal in lines]
    for signal in plant.inputs:
        if (count := driven.count(signal.name)) != 1:
            text = f"{count} outputs drive the input '{signal.name}' of plant {plant.name}, it needs one"
            yield ("instruments",), f'{text}: name a channel so, or say signal = "{signal.name}" in its instrument'


def _parameter_faults(
    place: Place, given: Mapping[str, float], known: Iterable[Parameter]
) -> Iterator[tuple[Place, str]]:
    by_name = {parameter.name: parameter for parameter in known}
    for name, value in given.items():
        if name not in by_name:
            yield (*place, "parameters", name), f"no parameter '{name}'; there are: {', '.join(by_name)}"
        elif refusal := by_name[name].refusal(value):
            yield (*place, "parameters", name), refusal
