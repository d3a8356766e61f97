"""Where a position counts from: a cylinder's transducer may read 0 at an end, in mid-stroke, or anywhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil.identification.grey_box.identify import fit_plant, starting_model
from hil.identification.preparation.experiment import Experiment, experiment
from hil.identification.preparation.plausibility.suspicion import can_be_held_against
from hil.identification.preparation.travel import travelled
from hil.physics.compose import plant
from hil.physics.model import Model
from hil.physics.plant import Travel
from hil.record.table.frame import from_memory

CYLINDER = "hydraforce-open-loop"


def recorded(mid_mm: float) -> Experiment:
    """The typical cylinder driven out to an end of its stroke and back, read from another zero."""
    time_s = np.arange(0.0, 6.0, 0.01)
    current = np.select([time_s < 3.0, time_s < 4.5], [1.0, -0.9], 0.8)
    model = starting_model(CYLINDER)
    at_rest = from_memory({"time [s]": time_s, "current [A]": current, "position [mm]": np.full(len(time_s), mid_mm)})
    position = experiment(at_rest, model.definition).respond(model.definition, model.values | {"mid_reading": mid_mm})[
        0
    ]
    position += np.random.default_rng(1).normal(0.0, 0.05, len(position))
    read = from_memory({"time [s]": time_s, "current [A]": current, "position [mm]": position})
    return experiment(read, model.definition)


def test_another_zero_moves_the_reading_and_nothing_else():
    one, other = recorded(0.0), recorded(400.0)
    np.testing.assert_allclose(other.output - one.output, 400.0, atol=1e-9)
    assert np.max(one.output) > 120.0  # an end of the stroke is reached


@pytest.mark.parametrize(
    ("travel", "mid"),
    [
        (Travel(-20.0, 90.0), None),
        (Travel(-126.0, 126.0), None),
        (Travel(0.0, 250.0), 125.0),
        (Travel(110.0, 251.0), 125.0),
        (Travel(-251.0, -10.0), -125.0),
        (Travel(300.0, 500.0), 400.0),
        (Travel(377.0, 508.0, ends_at_least=True), 502.0),
        (Travel(377.0, 508.0, ends_at_greatest=True), 383.0),
        (Travel(130.0, 240.0, ends_at_least=True), 255.0),  # no end of a stroke that counts from 0
        (Travel(-0.5, 235.0, ends_at_least=True), 125.0),
        (Travel(378.0, 612.0, ends_at_least=True, ends_at_greatest=True), 495.0),  # of a shorter stroke
    ],
)
def test_the_zero_is_at_mid_stroke_at_an_end_by_an_end_or_amid_what_was_read(travel, mid):
    cylinder = plant(CYLINDER)
    assert cylinder.zero is not None
    assert cylinder.zero(cylinder.typical, travel) == ({} if mid is None else {"mid_reading": mid})


def test_an_end_is_where_it_stands_under_a_command_that_moves_it_elsewhere():
    travel = travelled([recorded(400.0)])  # out to the end of the stroke, then in by less than all of it
    assert travel is not None
    assert travel.ends_at_greatest and not travel.ends_at_least


@pytest.mark.parametrize("late_s", [0.0, 0.12])
def test_where_a_command_rests_or_turns_there_is_no_end(late_s):
    time_s = np.arange(0.0, 12.0, 0.01)
    current = np.where(time_s < 6.0, 0.8 * np.sin(4.0 * time_s), np.where(time_s < 7.0, 0.7, 0.3))
    at_rest = from_memory({"time [s]": time_s, "current [A]": current, "position [mm]": np.full(len(time_s), 300.0)})
    model = starting_model(CYLINDER)
    values = model.values | {"mid_reading": 300.0, "dead_time": late_s}
    position = experiment(at_rest, model.definition).respond(model.definition, values)[0]
    position += np.random.default_rng(1).normal(0.0, 0.05, len(position))
    read = from_memory({"time [s]": time_s, "current [A]": current, "position [mm]": position})
    travel = travelled([experiment(read, model.definition)])
    assert travel is not None and travel.greatest < 424.0
    assert not (travel.ends_at_least or travel.ends_at_greatest)


def test_a_position_from_an_end_of_the_stroke_is_identified():
    found = fit_plant(starting_model(CYLINDER), [recorded(125.0)])
    assert found.model.values["mid_reading"] == 125.0
    assert min(found.fits.values()) > 99.0
    assert [str(note) for note in found.notes if "mid_reading is taken as 125" in str(note)]


def test_a_model_that_followed_none_of_its_recordings_says_nothing_of_units():
    model: Model = starting_model(CYLINDER)
    assert can_be_held_against(replace(model, origin={"fit_percent": {"a": -30.0, "b": 82.0}}))
    assert not can_be_held_against(replace(model, origin={"fit_percent": {"a": -146.0, "b": -30.0}}))
