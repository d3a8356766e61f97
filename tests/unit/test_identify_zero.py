"""Where a position counts from: a cylinder's transducer may read 0 at an end, in mid-stroke, or anywhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil.identification.grey_box.identify import fit_plant, starting_model
from hil.identification.preparation.experiment import Experiment, experiment
from hil.identification.preparation.plausibility.suspicion import can_be_held_against
from hil.physics.compose import plant
from hil.physics.model import Model
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


def test_another_zero_moves_the_reading_and_nothing_else() -> None:
    one, other = recorded(0.0), recorded(400.0)
    np.testing.assert_allclose(other.output - one.output, 400.0, atol=1e-9)
    assert np.max(one.output) > 120.0  # an end of the stroke is reached


@pytest.mark.parametrize(
    ("least", "greatest", "mid"),
    [(-20.0, 90.0, None), (-126.0, 126.0, None), (0.0, 250.0, 125.0), (110.0, 251.0, 125.0), (-251.0, -10.0, -125.0),
     (300.0, 500.0, 400.0)],
)  # fmt: skip
def test_the_zero_is_at_mid_stroke_at_an_end_or_amid_what_was_read(
    least: float, greatest: float, mid: float | None
) -> None:
    cylinder = plant(CYLINDER)
    found = cylinder.zero(cylinder.typical, least, greatest)
    assert found == ({} if mid is None else {"mid_reading": mid})


def test_a_position_from_an_end_of_the_stroke_is_identified() -> None:
    found = fit_plant(starting_model(CYLINDER), [recorded(125.0)])
    assert found.model.values["mid_reading"] == 125.0
    assert min(found.fits.values()) > 99.0
    assert [str(note) for note in found.notes if "mid_reading is taken as 125" in str(note)]


def test_a_model_that_followed_none_of_its_recordings_says_nothing_of_units() -> None:
    model: Model = starting_model(CYLINDER)
    assert can_be_held_against(replace(model, origin={"fit_percent": {"a": -30.0, "b": 82.0}}))
    assert not can_be_held_against(replace(model, origin={"fit_percent": {"a": -146.0, "b": -30.0}}))
