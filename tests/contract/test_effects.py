"""What every effect promises, at every hook of every plant that has it."""

from __future__ import annotations

import dataclasses
import inspect
import math
import re
import string
from collections.abc import Callable, Iterable
from functools import cache

import numpy as np
import pytest

from hil.catalog import entries
from hil.physics.compose import Site, effects, kernel, plant
from hil.physics.effect import Effect, Seen
from hil.physics.plant import Plant
from hil.physics.simulate import ActiveEffect, Drive, Twin, simulate
from hil.record.recording import Array
from hil.units import check_unit

INTERVAL_S = 1e-3
# Plants so slow that milliseconds show nothing.
SLOW = {"cascaded-tanks": 0.025, "electro-hydraulic-actuator": 0.01, "hydraforce-open-loop": 0.004}
# Plants that never rest under current: copper that warms.
WARMING = ("efc-drive", "efc-duty")
# Effects that are change itself: they go on while everything else rests.
RESTLESS = ("coil_heating", "periodic_disturbance", "sensor_drift")

PLANTS = [plant(entry.name) for entry in entries("plants")]


def stays_where_it_is_put(definition: Plant) -> bool:
    """Whether the input alone does not tell its rest: a load or an offset moves a position loop or a free carriage."""
    at_rest = (0.0,) * len(definition.inputs)
    goes_on = definition.integrates is None or definition.integrates(definition.typical)
    return goes_on and bool(definition.initial(definition.typical, at_rest, math.nan))


Place = tuple[Plant, Site]


@cache
def sites() -> list[Place]:
    return [(found, site) for found in PLANTS for site in kernel(found.name).sites]


def places(effect: Effect) -> list[Place]:
    return [(found, site) for found, site in sites() if site.effect is effect]


def rests(place: Place) -> bool:
    found, site = place
    return not stays_where_it_is_put(found) and found.name not in WARMING and site.effect.name not in RESTLESS


def where_not(holds: Callable[[Plant, Site], bool], at: Iterable[Place]) -> list[str]:
    """The plants and hooks where something does not hold."""
    return [f"{found.name}, {site.hook.name}" for found, site in at if not holds(found, site)]


for_every_effect = pytest.mark.parametrize("effect", effects(), ids=lambda effect: effect.name)


def interval_s(definition: Plant) -> float:
    return SLOW.get(definition.name, INTERVAL_S)


def course(definition: Plant) -> Array:
    """A command over the whole range: both directions, slow and quick, then steps; shape (inputs, n).

    Further inputs, measured disturbances, go along, each at another size.
    """
    time_s = np.arange(3000) * INTERVAL_S
    swing = np.where(time_s < 0.1, 0.0, 0.95 * np.sin(1.4 * np.pi * time_s) + 0.05 * np.sin(18 * np.pi * time_s))
    swing[2000:2500] = 0.95
    swing[2500:] = -0.8
    middle, half = {
        "brevini-hpv41": (0.0, 100.0),
        "cummins-efc": (1.6, 0.5),
        "efc-measured": (1.6, 0.5),
        "efc-drive": (1.6, 0.5),
        "efc-duty": (26.0, 8.0),
        "hydraforce-sp08-47c": (62.0, 60.0),
        "linear-axis": (0.0, 450.0),
        "cascaded-tanks": (3.6, 3.6),
        "electro-hydraulic-actuator": (0.0, 2000.0),
        "pneumatic-cylinder": (0.0, 40.0),
        "servo-axis": (0.0, 0.22),
        "servo-valve": (0.0, 25.0),
        "servo-valve-blocked": (0.0, 25.0),
    }.get(definition.name, (0.0, definition.inputs[0].full_scale))
    further = [signal.full_scale * (0.5 + 0.4 * swing / k) for k, signal in enumerate(definition.inputs[1:], start=1)]
    return np.vstack([middle + half * swing, *further])


def run(definition: Plant, *active: ActiveEffect, inputs: Array | None = None, trace: Array | None = None) -> Array:
    drive = Drive(course(definition) if inputs is None else inputs, math.nan, interval_s(definition))
    return simulate(definition, definition.typical, drive, active, trace=trace)


def at_typical(site: Site) -> ActiveEffect:
    return ActiveEffect(*site.key, {p.name: p.typical for p in site.effect.parameters_at(site.hook)})


@cache
def plain(name: str) -> tuple[Array, Array]:
    """What a plant gives without any effect, and what passes each of its hooks."""
    definition = plant(name)
    trace = np.zeros((len(definition.hooks), course(definition).shape[1]))
    return run(definition, trace=trace), trace


@for_every_effect
def test_at_null_it_does_nothing(effect):
    def holds(definition, site):
        null = run(definition, ActiveEffect(*site.key, effect.null_at(site.hook)))
        return np.allclose(null, plain(definition.name)[0], rtol=0.0, atol=1e-12 * definition.output.full_scale)

    assert where_not(holds, places(effect)) == []


@for_every_effect
def test_at_its_typical_size_it_shows(effect):
    def holds(definition, site):
        without, trace = plain(definition.name)
        arrives = trace[[hook.name for hook in definition.hooks].index(site.hook.name)]
        change = np.abs(run(definition, at_typical(site)) - without).max()
        one_sided = effect.name == "asymmetry" and arrives.min() >= 0.0  # nothing negative passes
        out_of_reach = definition.name == "servo-valve-blocked" and effect.name == "saturation"  # the supply is first
        return bool(change > 1e-6 * definition.output.full_scale) != (one_sided or out_of_reach)

    assert where_not(holds, places(effect)) == []


@for_every_effect
def test_the_same_twice_and_in_blocks(effect):
    def holds(definition, site):
        inputs, active = course(definition), at_typical(site)
        whole = run(definition, active)
        twin = Twin(definition, definition.typical, interval_s(definition), (active,))
        parts = [twin.advance(inputs[:, a:b]) for a, b in ((0, 1), (1, 700), (700, 701), (701, 3000))]
        return np.array_equal(whole, run(definition, active)) and np.array_equal(np.hstack(parts), whole)

    assert where_not(holds, places(effect)) == []


@for_every_effect
def test_at_rest_nothing_moves(effect):
    def holds(definition, site):
        still = np.repeat(course(definition)[:, 400:401], 1500, axis=1)
        moved = np.ptp(run(definition, at_typical(site), inputs=still), axis=1).max()
        return bool(moved < 1e-9 * definition.output.full_scale)

    assert where_not(holds, filter(rests, places(effect))) == []


@for_every_effect
def test_at_every_bound_it_stays_finite(effect):
    for definition, site in places(effect):
        typical = at_typical(site).parameters
        for parameter in effect.parameters_at(site.hook):
            for bound in (parameter.low, parameter.high):
                found = run(definition, ActiveEffect(*site.key, {**typical, parameter.name: bound}))
                at = f"{definition.name}, {site.hook.name}: {parameter.name} = {bound} {parameter.unit}"
                assert np.isfinite(found).all(), at


@for_every_effect
def test_some_plant_has_it(effect):
    assert any(site.effect is effect for _, site in sites())
    known = {hook.name for definition in PLANTS for hook in definition.hooks}
    assert set(effect.hooks) <= known


@for_every_effect
def test_its_parameters_are_sane(effect):
    assert effect.parameters[0].null is not None, "the first parameter says how strong it is, so it has a null"
    for parameter in effect.parameters:
        assert parameter.low <= parameter.typical <= parameter.high
        assert parameter.low < parameter.high
        assert math.isfinite(parameter.low) and math.isfinite(parameter.high)
        if parameter.null is not None:
            assert math.isinf(parameter.null) or parameter.low <= parameter.null <= parameter.high
        check_unit(parameter.unit.replace("{value}", "V").replace("{motion}", "mm"))
        assert parameter.meaning


@for_every_effect
def test_it_says_what_it_is(effect):
    entry = next(entry for entry in entries("effects") if entry.name == effect.name)
    assert entry.load().EFFECT is effect
    assert entry.summary
    for text in (effect.title, effect.equation, effect.signature, effect.source, effect.sentence):
        assert text.strip()
    assert re.search(r"\d{4}|GUM|Doebelin|Facts", effect.source), "a source that can be found"
    places = {name for _, name, _, _ in string.Formatter().parse(effect.sentence) if name}
    assert places and places <= {parameter.name for parameter in effect.parameters}


@for_every_effect
def test_its_fits_start_within_reach(effect):
    seen = Seen(-60.0, 80.0, 50.0, (10.0, 60.0, 200.0), ((7.0, 0.3, 0.5), (50.0, 0.1, -1.0)), 30.0, 1e-3)
    starts = effect.starts(seen)
    assert starts
    known = {parameter.name for parameter in effect.parameters}
    for start in starts:
        assert start and set(start) <= known
        assert all(math.isfinite(value) for value in start.values())


@for_every_effect
def test_its_coefficients_are_what_the_transform_takes(effect):
    hook = next(site.hook for _, site in sites() if site.effect is effect)
    site = Site(effect, hook)
    given = {parameter.name: parameter.typical for parameter in effect.parameters_at(hook)}
    if effect.coefficients is not None:
        given = dict(effect.coefficients(given, INTERVAL_S))
    assert set(site.arguments) <= set(given)
    if "state" in inspect.signature(effect.transform.py_func).parameters:
        assert effect.words_at(hook, INTERVAL_S) > 0
    assert dataclasses.is_dataclass(effect)
