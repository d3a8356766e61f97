"""Channels and stamps in a wrong unit are refused; what only looks like one is not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from hil.diagnosis.intake.check import check
from hil.errors import FileError
from hil.identification.grey_box.identify import fit_plant
from hil.identification.preparation.content import content_of
from hil.identification.preparation.experiment import experiment, for_model
from hil.identification.preparation.plausibility.time_unit import wrong_time
from hil.identification.preparation.plausibility.unit import unit_factors
from hil.physics.compose import plant
from hil.physics.model import Model, typical_model
from hil.physics.simulate import ActiveEffect, Drive, simulate
from hil.record.reading import Reading
from hil.record.recording import Recording, recording
from hil.record.table.named import with_stated_units
from tests.answers import answer
from tests.concealed import (
    DURATION_S,
    NOISE,
    PLANT,
    RATE_HZ,
    WORN,
    bound,
    changed,
    intake,
    noise,
    nominal,
    poor,
    records,
    with_rows,
)

STICKING = ActiveEffect("friction", "force", {"coulomb": 2.5, "stiction": 1.2, "stribeck": 5.0, "presliding": 0.05})
SLUGGISH = ActiveEffect("coil_lag", "command", {"lag": 0.1, "second": 0.0, "direct": 0.0, "saturating": 0.0})


@pytest.mark.parametrize(
    ("channel", "factor", "says"),
    [
        *(("flow", factor, rf"'flow \[l/min\]'.*factor near {factor:.4g}") for factor in (10.0, 0.1, 60.0, 1.0 / 60.0)),
        ("command", 0.1, r"'command \[%\]'.*multiplied by 10"),
        ("flow", -1.0, r"'flow \[l/min\]' runs the other way.* is its sign right"),
    ],
)
def test_a_channel_in_a_wrong_unit_or_the_other_way_is_refused(channel, factor, says):
    with pytest.raises(FileError, match=says):
        intake(scaled(records(seed=20), channel, factor))


@pytest.mark.parametrize("factor", [10.0, 0.1, 60.0])
def test_a_wrong_unit_is_refused_though_a_sticking_part_moves_less(factor):
    command = -50.0 + 10.0 * np.sin(2.0 * np.pi * 0.3 * np.arange(0.0, DURATION_S, 1.0 / RATE_HZ))
    off = NOISE * noise(np.random.default_rng(22), len(command))
    made = answer(plant(PLANT), command, 1.0 / RATE_HZ, STICKING, noise=off)
    with pytest.raises(FileError, match=rf"'flow \[l/min\]'.*factor near {factor:.4g}"):
        intake(scaled([made], "flow", factor))


@pytest.mark.parametrize("factor", [60.0, 10.0, 0.1, 1.0 / 60.0])
def test_a_wrong_unit_is_refused_though_the_supply_gives_way(factor):
    shape = {"droop": 0.5, "recovery": 0.3, "power": 1.0, "line": 0.0, "lean": 0.0}
    (made, *_) = records((ActiveEffect("supply_droop", "supply", shape),), seed=23)
    made.channels["flow"].values[:] *= factor
    with pytest.raises(FileError, match=r"'flow \[l/min\]'.*wrong unit"):
        intake([made])


@pytest.mark.parametrize("factor", [1000.0, 25.4, 10.0, 0.1])
def test_a_loop_whose_output_has_a_wrong_unit_is_refused(factor):
    loop = typical_model("hydraforce-sp08-47c")
    request = 125.0 + 40.0 * np.sin(2.0 * np.pi * 0.3 * np.arange(0.0, DURATION_S, 1.0 / RATE_HZ))
    off = 0.05 * noise(np.random.default_rng(24), len(request))
    (made,) = scaled([answer(loop.definition, request, 1.0 / RATE_HZ, noise=off, start=125.0)], "position", factor)
    with pytest.raises(FileError, match=r"'position \[mm\]'.*wrong unit"):
        check(loop, [for_model(loop, made)])


def test_an_offset_many_times_what_moves_is_no_unit():
    def offset(each):
        each.channels["flow"].values[:] += 130.0

    intake(changed(offset))


def scaled(made: Sequence[Recording], channel: str, factor: float) -> list[Recording]:
    return [
        replace(each, channels={n: replace(c, values=c.values * factor) if n == channel else c
                                for n, c in each.channels.items()})
        for each in made
    ]  # fmt: skip


def stretched(made: Sequence[Recording], factor: float) -> list[Recording]:
    return [replace(each, time_s=each.time_s * factor) for each in made]


def test_a_model_that_never_fitted_well_is_not_asked_for_more():
    model, made = poor(), records([WORN], seed=25)
    assert np.median(list(model.origin["fit_percent"].values())) < 60.0
    check(model, bound(model, made))
    for channel, factor in product(("command", "flow"), (10.0, 0.1, 1.0 / 60.0)):
        with pytest.raises(FileError, match=r"looks like a wrong unit"):
            check(model, bound(model, scaled(made, channel, factor)))


def test_a_recording_that_a_poor_model_cannot_follow_is_in_no_wrong_unit():
    """In another unit it would be as large as the model's answer, and no more like it."""
    good = nominal()
    unfit = replace(good, origin={**good.origin, "fit_percent": {"steps": 20.0}})

    def unlike(each):
        flow = each.channels["flow"].values
        flow[:] = 0.15 * (flow + np.std(flow) * np.sqrt(2.0) * np.sin(0.9 * each.time_s))

    check(unfit, bound(unfit, changed(unlike)))


def test_a_force_that_a_led_back_model_does_better_without_is_in_no_wrong_unit():
    """Led back to a slow motion it fits that well undriven, and so in any unit that makes its force small."""
    time_s = np.arange(0.0, 16.0, 1.0 / RATE_HZ)
    force = 40.0 * np.sin(2.0 * np.pi * 0.3 * time_s) + 20.0 * np.sin(2.0 * np.pi * 1.7 * time_s)
    position = 0.01 * np.sin(0.5 * time_s) + 2e-5 * noise(np.random.default_rng(26), len(time_s))
    axis = typical_model("linear-axis")
    check(axis, [for_model(axis, recording("loop", time_s, {"force [N]": force, "position [m]": position}))])


@pytest.mark.parametrize("factor", [1000.0, 100.0, 10.0])
def test_an_axis_that_moves_many_times_as_much_as_it_can_is_refused(factor):
    """Its friction is in no model yet, so that the right unit does not fit well either."""
    axis, time_s = plant("linear-axis"), np.arange(0.0, 16.0, 1.0 / RATE_HZ)
    force = 40.0 * np.sin(2.0 * np.pi * 0.3 * time_s) + 20.0 * np.sin(2.0 * np.pi * 1.7 * time_s)
    dry = ActiveEffect("friction", "force", {"coulomb": 20.0, "stiction": 1.2, "stribeck": 0.02, "presliding": 1e-4})
    off = 2e-5 * noise(np.random.default_rng(26), len(force))
    made = answer(axis, force, 1.0 / RATE_HZ, dry, noise=off, factor=4.0)
    start = typical_model("linear-axis")
    model = fit_plant(start, [experiment(made, axis)]).model
    check(model, [for_model(model, made)])
    with pytest.raises(FileError, match=rf"by {factor:g};.* It fits as well with 'position \[m\]' divided"):
        check(model, [for_model(model, *scaled([made], "position", factor))])
    (large,) = scaled([made], "position", factor)
    stated = with_stated_units(large, Reading(units={"force": "N", "position": "m"}))
    check(model, [for_model(model, stated)])


@pytest.mark.parametrize("factor", [1000.0, 60.0])
@pytest.mark.parametrize("effects", [(), (STICKING,), (SLUGGISH,)], ids=["healthy", "sticking", "sluggish"])
def test_a_time_in_a_wrong_unit_is_refused(effects, factor):
    made = stretched([with_rows(each, slice(1200)) for each in records(effects, seed=27)], factor)
    with pytest.raises(FileError, match=rf"time divided by {factor:g}; it looks like a wrong unit of time"):
        intake(made)
    stated = [with_stated_units(each, Reading(units={"time": "s"})) for each in made]
    assert wrong_time(nominal(), bound(nominal(), stated)) == []
    assert wrong_time(nominal(), [replace(e, is_timed=True) for e in bound(nominal(), made)]) == []  # by its bench


@pytest.mark.parametrize("effects", [(), (STICKING,), (SLUGGISH,)], ids=["healthy", "sticking", "sluggish"])
def test_a_recording_at_a_tenth_of_the_rate_is_none(effects):
    made = [with_rows(each, slice(None, None, 10)) for each in records(effects, seed=28)]
    intake(made)


def test_no_unit_of_time_is_ten_times_another():
    intake(stretched(records(seed=29), 10.0))


def test_an_interval_that_the_model_knows_is_no_wrong_unit():
    model = nominal()
    known: Model = replace(model, origin={**model.origin, "intervals_s": [1.0 / RATE_HZ, 60.0 / RATE_HZ]})
    check(known, bound(known, stretched(records(seed=29), 60.0)))


def test_moves_that_are_many_times_what_is_expected_at_the_right_level_are_no_unit():
    """A seal adds its friction to the small changes of force that the pressure makes."""
    cylinder, time_s = plant("pneumatic-cylinder"), np.arange(0.0, 20.0, 0.01)
    seal = ActiveEffect("seal_friction", "seal", {"share": 0.02, "constant": 0.002, "presliding": 0.3})
    start, made = typical_model("pneumatic-cylinder"), []
    for bar in (3.0, 7.0):
        displacement = 10.0 * np.sin(2.0 * np.pi * 0.2 * time_s)
        pressure = bar * (1.0 + 0.02 * np.tanh(5.0 * np.cos(2.0 * np.pi * 0.2 * time_s)))  # higher on the way out
        inputs = np.array([displacement, pressure])
        force = simulate(cylinder, cylinder.typical, Drive(inputs, 0.0, 0.01), (seal,))[0]
        force += 0.05 * noise(np.random.default_rng(30), len(force))
        rows = dict(zip((s.heading for s in (*cylinder.inputs, cylinder.output)), (*inputs, force), strict=True))
        made.append(for_model(start, recording(f"{bar:g} bar", time_s, rows)))
    check(fit_plant(start, made).model, made)


def test_factors_are_those_of_the_unit():
    gallon, psi_in_kpa, rate = 3.785, 6.895, 60.0

    def holds(unit, factor):
        return any(abs(found / factor - 1.0) < 0.01 for found in unit_factors(unit))

    assert holds("l/min", gallon) and holds("l/min", rate)
    assert holds("psi", psi_in_kpa)
    assert not any(holds("N", factor) for factor in (gallon, psi_in_kpa, rate))
    assert not any(holds("%", factor) for factor in (gallon, psi_in_kpa, rate, 57.3))


def test_what_a_model_was_made_of_is_never_refused():
    """However wrong it was: a model of a reversed, scaled channel fits it."""
    model = nominal()
    turned = scaled(records(seed=31), "flow", -1.0)
    content = {e.name: content_of(e) for e in bound(model, turned)}
    check(replace(model, origin={**model.origin, "content": content}), bound(model, turned))
