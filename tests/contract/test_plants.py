"""What every plant promises."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hil.catalog import entries
from hil.errors import InputError
from hil.physics.compose import kernel, plant
from hil.physics.plant import Plant
from hil.physics.simulate import Drive, simulate, sub_steps
from hil.record.recording import Array
from hil.units import check_unit

INTERVAL_S = 1e-3
PLANTS = [plant(entry.name) for entry in entries("plants")]
for_every_plant = pytest.mark.parametrize("definition", PLANTS, ids=lambda definition: definition.name)

# Where a plant stands still, and a step from there that it answers for more than a second.
REST = {
    "cummins-efc": (1.5, 0.2),
    "efc-measured": (1.5, 0.2),
    "hpv41-measured": (50.0, 20.0),
    "hydraforce-sp08-47c": (50.0, 20.0),
    "brevini-hpv41": (50.0, 20.0),
    "cascaded-tanks": (math.sqrt(5.0), 1.0),  # the typical upper level is 5 V
    "hydraulic-actuator": (0.0, -0.5),
    "servo-axis": (0.0, 5.0),
}
# Plants so slow that milliseconds show nothing.
SLOW = {"cascaded-tanks": 1.0}


def interval_s(definition: Plant) -> float:
    return SLOW.get(definition.name, INTERVAL_S)


def step(definition: Plant, samples: int = 1500) -> Array:
    """A step of every input after 300 samples, shape (inputs, n)."""
    rest, size = REST.get(definition.name, (0.0, 0.5 * definition.inputs[0].full_scale))
    command = np.full((len(definition.inputs), samples), rest)
    command[0, 300:] += size
    for row, signal in zip(command[1:], definition.inputs[1:], strict=True):
        row[300:] += 0.5 * signal.full_scale
    return command


def run(definition: Plant, inputs: Array, **changed: float) -> Array:
    return simulate(definition, definition.typical | changed, Drive(inputs, math.nan, interval_s(definition)))


@for_every_plant
def test_its_file_name_is_its_name(definition):
    entry = next(entry for entry in entries("plants") if entry.name == definition.name)
    assert entry.load().PLANT is definition
    assert entry.summary
    assert definition.title


@for_every_plant
def test_its_parameters_are_sane(definition):
    names = [parameter.name for parameter in definition.parameters]
    assert len(set(names)) == len(names)
    for parameter in definition.parameters:
        assert parameter.low <= parameter.typical <= parameter.high
        assert math.isfinite(parameter.low) and math.isfinite(parameter.high)
        assert parameter.scale > 0.0
        assert parameter.meaning
    for unit in definition.units("command [V]", "flow [l/min]").values():
        check_unit(unit.replace("[", "(").replace("]", ")"))


@for_every_plant
def test_its_signals_and_hooks_carry_units(definition):
    signals = (*definition.inputs, definition.output, *definition.observed)
    assert len({signal.name for signal in signals}) == len(signals)
    for unit in [signal.unit for signal in signals] + [hook.unit for hook in definition.hooks]:
        check_unit(definition.in_units(unit, "command [V]", "flow [l/min]"))
    for hook in definition.hooks:
        assert hook.full_scale > 0.0
        assert hook.stage


@for_every_plant
def test_its_coefficients_keep_their_layout(definition):
    steady = definition.coefficients(definition.typical, math.inf)
    stepped = definition.coefficients(definition.typical, INTERVAL_S)
    assert list(steady) == list(stepped) == list(kernel(definition.name).coefficients)
    for name in steady:
        assert np.shape(steady[name]) == np.shape(stepped[name])
        assert np.isfinite(steady[name]).all() and np.isfinite(stepped[name]).all()


@for_every_plant
def test_known_effects_are_named_where_a_parameter_stands_for_one(definition):
    known = {entry.name for entry in entries("effects")}
    for parameter in definition.parameters:
        assert {parameter.growth, parameter.change} - {""} <= known


@for_every_plant
def test_at_rest_nothing_moves(definition):
    found = run(definition, step(definition)[:, :300])
    assert np.ptp(found, axis=1).max() < 1e-9 * definition.output.full_scale


@for_every_plant
def test_it_answers_after_the_command_and_not_before(definition):
    found = run(definition, step(definition))[0]
    assert np.ptp(found[:301]) < 1e-9 * definition.output.full_scale
    assert found[-1] - found[0] > 0.02 * definition.output.full_scale


@for_every_plant
def test_at_every_bound_it_stays_finite(definition):
    for parameter in definition.parameters:
        for bound in (parameter.low, parameter.high):
            found = run(definition, step(definition), **{parameter.name: bound})
            assert np.isfinite(found).all(), f"{parameter.name} = {bound} {parameter.unit}"


@for_every_plant
def test_finer_sub_steps_hardly_change_it(definition):
    step_s = definition.sub_step_s if definition.sub_step_s < 0.1 else interval_s(definition)
    drive = Drive(step(definition), math.nan, step_s)
    coarse = simulate(definition, definition.typical, drive)
    fine = simulate(definition, definition.typical, drive, factor=8.0)
    assert np.abs(fine - coarse).max(axis=1)[0] < 2e-3 * np.ptp(fine[0])


def test_sub_steps_follow_the_sampling_interval():
    valve = plant("brevini-hpv41")
    assert sub_steps(valve, 1e-3) == 1
    assert sub_steps(valve, 1e-4) == 1
    assert sub_steps(valve, 1e-2) == 10
    assert sub_steps(valve, 1e-2, 0.5) == 5


@for_every_plant
def test_the_sampling_interval_hardly_changes_it(definition):
    near = 1e-9 if definition.sub_step_s > 0.1 else 2e-3  # a linear plant is exact at any step
    slow_inputs = step(definition)[:, ::10].copy()
    fast_inputs = np.repeat(slow_inputs, 10, axis=1)
    slow = simulate(definition, definition.typical, Drive(slow_inputs, math.nan, 10 * interval_s(definition)))[0]
    fast = simulate(definition, definition.typical, Drive(fast_inputs, math.nan, interval_s(definition)))[0, ::10]
    assert np.abs(slow - fast).max() < near * np.ptp(fast)


@pytest.mark.parametrize("definition", [p for p in PLANTS if p.observer], ids=lambda definition: definition.name)
def test_its_observer_leads_a_simulation_back_where_something_was_measured(definition):
    inputs, interval = step(definition, 20_000), interval_s(definition)
    away = 0.1 * definition.output.full_scale
    there, elsewhere = (Drive(inputs, first, interval) for first in (0.0, away))
    measured = simulate(definition, definition.typical, there)[0]
    led = simulate(definition, definition.typical, elsewhere, measured=measured)[0]
    assert led[0] - measured[0] > 0.9 * away
    assert abs(led[-1] - measured[-1]) < 1e-3 * away
    blind = simulate(definition, definition.typical, elsewhere, measured=np.full(len(measured), np.nan))
    assert np.array_equal(blind, simulate(definition, definition.typical, elsewhere))


@for_every_plant
def test_a_measured_output_that_cannot_be_followed_is_refused(definition):
    drive = Drive(step(definition), 0.0, interval_s(definition))
    wanted = "measured output" if definition.observer else "observer"
    with pytest.raises(InputError, match=wanted):
        simulate(definition, definition.typical, drive, measured=np.zeros(1499 if definition.observer else 1500))
