"""A plant that takes any channel: what is said of it has the units of the recordings, not those of its page."""

import numpy as np
import pytest

from hil.diagnosis.intake.problem import pose
from hil.diagnosis.search.terms import all_terms
from hil.identification.preparation.experiment import experiment
from hil.physics.compose import plant
from hil.physics.model import Model, Value
from hil.physics.simulate import Drive, simulate
from hil.record.recording import recording

INPUT, OUTPUT = "pump speed [r/min]", "accumulator pressure [bar]"
TRANSFER = plant("transfer-function")


@pytest.fixture(scope="module")
def asked():
    values = TRANSFER.typical | {"gain": 0.02, "lag_time": 0.2}
    speed = 500.0 * np.sign(np.sin(0.05 * np.arange(200)))
    pressure = simulate(TRANSFER, values, Drive(speed[None, :], 0.0, 0.02))[0]
    pressure += 0.05 * np.random.default_rng(3).standard_normal(200)
    units = TRANSFER.units(INPUT, OUTPUT)
    model = Model(TRANSFER.name, {n: Value(v, units[n]) for n, v in values.items()}, input=INPUT, output=OUTPUT)
    made = recording("rig", 0.02 * np.arange(200), {INPUT: speed, OUTPUT: pressure})
    return pose(model, [experiment(made, TRANSFER, "pump speed", "accumulator pressure")])


def test_terms_have_units_of_the_channels(asked):
    units = {(t.name, t.hook, u.name): u.unit for t in all_terms(asked, asked.nominal_residuals) for u in t.unknowns}
    assert units["gain", "", "gain"] == "[bar]/[r/min]"
    assert units["deadband", "command", "width"] == units["backlash", "position", "half_width"] == "r/min"
    assert units["leakage", "flow", "leak"] == units["sensor_offset", "sensor", "offset"] == "bar"
    assert not {unit for unit in units.values() if "any" in unit or "{" in unit}


def test_what_is_left_is_in_the_unit_of_the_output(asked):
    assert asked.model.output_unit == "bar"
    assert asked.model.resolved_unit("{input}/s") == "r/min/s"
