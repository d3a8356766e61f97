"""Channels that are not in the unit that their heading says."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hil.errors import UnitError
from hil.identification.preparation.criteria import CRITERIA
from hil.identification.preparation.experiment import Experiment
from hil.identification.preparation.plausibility.suspicion import (
    Suspicion,
    fit_but_for_gain,
    good_fit,
    moves,
    spoken_of,
    stating_units,
    times,
)
from hil.identification.uncertainty.fit import fit_percent
from hil.language.note import Note
from hil.physics.model import Model
from hil.record.recording import Array, split_heading
from hil.units import scale_and_offset

# Units in which channels of one kind are written; one of them taken for another is off by their ratio.
_CONFUSED = (
    ("l/min", "ml/min", "l/s", "m^3/h", "m^3/s", "gallon/minute", "cm^3/s"),
    ("bar", "mbar", "kPa", "MPa", "Pa", "psi"),
    ("m", "cm", "mm", "um", "inch"),
    ("N", "kN", "kgf", "lbf"),
    ("A", "mA"),
    ("V", "mV"),
    ("%", "1"),
    ("N*m", "kgf*m", "lbf*ft"),
    ("rad", "deg"),
    ("m/s", "mm/s", "mm/min", "m/min"),
    ("rpm", "rad/s", "Hz"),
)
_BARE = ("%", "rad", "rpm")  # kinds that arithmetic of units does not tell from other numbers
# Decimals that were lost.
_DECIMALS = frozenset(10.0**power for power in range(-3, 4) if power)


def unit_factors(unit: str) -> tuple[float, ...]:
    """Factors that a wrong unit brings to a channel of this one."""
    factors = set(_DECIMALS)
    for group in _CONFUSED:
        try:
            sizes = [scale_and_offset(other, unit)[0] for other in group]
        except UnitError:
            continue
        belongs = any(abs(np.log(size)) < CRITERIA.same_factor for size in sizes)
        if belongs or group[0] not in _BARE:
            both = {factor for size in sizes for factor in (size, 1.0 / size)}
            large = {f for f in both if CRITERIA.same_factor < abs(np.log(f)) < np.log(CRITERIA.largest_factor)}
            factors |= {f for f in large if all(abs(np.log(f / known)) > 1e-6 for known in factors)}
    return tuple(sorted(factors, key=lambda f: float(f"{f:.12g}")))


def wrong_unit(model: Model, e: Experiment, simulated: Array) -> Suspicion | None:
    """A channel that is what the model expects but for the factor of a unit; `simulated` of `suspicion.expected`."""
    before, led_back = fit_percent(e.output, simulated), model.definition.observer is not None
    if not (before < CRITERIA.poor_fit or led_back):  # led back, a model fits half of anything
        return None
    of_moves, fit_of_moves = moves(simulated, e.output)
    level, fit_of_level = times(simulated, e.output)  # small moves may be smaller for a reason, a level hardly is
    also_moves = abs(of_moves / level - 1.0) < CRITERIA.also_moves if level else False
    name = split_heading(e.output_heading)[0]
    slopes = ((of_moves, fit_of_moves), (level, fit_of_level if also_moves else 0.0))
    for slope, fit in () if name in e.stated_units else slopes:
        beyond_effects = also_moves and not led_back and not CRITERIA.too_small < slope < CRITERIA.too_large
        factor = _unit_factor(e.output_heading, slope, np.inf if beyond_effects else CRITERIA.same_factor)
        if factor and fit > CRITERIA.good_fit:
            found = Note(
                "channel '{channel}' is {slope:.3g} times what {model} gives; a factor near {factor:.4g} looks like a "
                "wrong unit. If it is right, {option} says so",
                channel=e.output_heading, slope=slope, model=spoken_of(model), factor=factor,
                option=stating_units(e.output_heading),
            )  # fmt: skip
            return Suspicion(e.name, found.of(e.name), fit)
    return _fits_in_another_unit(model, e, before)


def _fits_in_another_unit(model: Model, e: Experiment, before: float) -> Suspicion | None:
    headings = [e.input, *(signal.heading for signal in model.definition.inputs[1:]), e.output_heading]
    tried = [
        _InAnotherUnit(heading, factor, fit_but_for_gain(model, _in_another_unit(e, channel, factor)))
        for channel, heading in enumerate(headings)
        if split_heading(heading)[0] not in e.stated_units
        for factor in unit_factors(split_heading(heading)[1])
    ]

    def how(one: _InAnotherUnit) -> Note:
        return Note("divided") if one.channel == e.output_heading else Note("multiplied")

    if not tried:
        return None
    best = max(tried, key=lambda found: np.nan_to_num(found.fit, nan=-np.inf))
    if not best.fit > _enough(model, max(before, _undriven(model, e)), best.factor):
        return None
    first, *others = [
        found for found in tried if found.factor == best.factor and found.fit >= best.fit - CRITERIA.same_fit
    ]
    found = Note(
        "channel '{channel}' fits {model} only when {how} by {factor:.4g}; it looks like a wrong unit. If it is right, "
        "{option} says so",
        channel=first.channel, model=spoken_of(model), how=how(first), factor=first.factor,
        option=stating_units(first.channel),
    )  # fmt: skip
    if others:
        also = tuple(Note("'{channel}' {how}", channel=other.channel, how=how(other)) for other in others)
        found = Note("{found}. It fits as well with {also}", found=found, also=also)
    return Suspicion(e.name, found.of(e.name), first.fit)


@dataclass(frozen=True, slots=True)
class _InAnotherUnit:
    """The fit of the model with an input multiplied by a factor, or with the output divided by it."""

    channel: str
    factor: float
    fit: float


def _in_another_unit(e: Experiment, channel: int, factor: float) -> Experiment:
    """`channel`: of the inputs, in their order; the output after them."""
    if channel < len(e.drive.inputs):
        inputs = e.drive.inputs.copy()
        inputs[channel] *= factor
        return e.driven(inputs)
    # a loop that starts at its first reading starts somewhere else
    begins = replace(e.drive, first_output=e.drive.first_output / factor)
    return replace(e, drive=begins, output=e.output / factor)


def _undriven(model: Model, e: Experiment) -> float:
    """The fit without a command: a mean has none, and what is led back to a recording owes no model that much."""
    return 0.0 if model.definition.observer is None else fit_but_for_gain(model, _in_another_unit(e, 0, 0.0))


def _enough(model: Model, before: float, factor: float) -> float:
    """The fit in another unit from which no physics is looked for.

    What integrates does not move many times as much as expected for any reason: friction stops it from moving.
    """
    halved = 100.0 - CRITERIA.half * (100.0 - before)
    if model.definition.observer is None:
        return max(halved, good_fit(model))
    if factor > CRITERIA.too_large:
        return halved
    return CRITERIA.good_fit if before < CRITERIA.poor_fit else 100.0 - CRITERIA.much_less * (100.0 - before)


def _unit_factor(heading: str, slope: float, tolerance: float) -> float | None:
    """The factor of a wrong unit of this channel that is nearest, within a tolerance of its logarithm."""
    if slope <= 0.0:
        return None
    near = min(unit_factors(split_heading(heading)[1]), key=lambda factor: abs(np.log(slope / factor)))
    return near if abs(np.log(slope / near)) < tolerance else None
