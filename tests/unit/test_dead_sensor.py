"""An output that stands still where it should move is no valve: refused, or left out and said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil.diagnosis.intake.problem import pose
from hil.errors import FileError
from hil.identification.grey_box.identify import fit_plant
from hil.physics.model import typical_model
from hil.record.recording import Channel, Recording
from tests.concealed import PLANT, bound, intake, nominal, records


def dead(each: Recording) -> Recording:
    each.channels["flow"].values[:] = 3.0
    return each


def test_an_output_that_never_moves_is_refused():
    with pytest.raises(
        FileError, match=r"steps: channel 'flow \[l/min\]' stands at 3 .* in every recording: a dead sensor"
    ):
        intake([dead(each) for each in records(seed=20)])


def test_a_recording_whose_sensor_was_dead_is_left_out_and_said():
    made = records(seed=20)
    made[1] = dead(made[1])
    checked = intake(made)
    assert [e.name for e in checked.experiments] == ["steps", "sine"]
    assert len(checked.warnings) == 1
    assert "sweep: channel 'flow [l/min]' stands at 3 all the time, where the model moves by" in checked.warnings[0]


def test_a_coarse_channel_may_stand_still_while_little_moves():
    made = records(seed=20)
    still = made[2].channels["flow"].values
    for each in made[:2]:
        flow = each.channels["flow"].values
        flow[:] = 40.0 * np.round(flow / 40.0)
    still[:] = 40.0
    checked = intake(made)
    assert len(checked.experiments) == len(made)
    problem = pose(nominal(), checked.experiments)
    assert problem.noises[2] == problem.noises[1]  # it stands still because its converter is as coarse as the others'


def test_no_model_is_identified_from_a_dead_sensor():
    start = typical_model(PLANT)
    with pytest.raises(FileError, match="in every recording: a dead sensor"):
        fit_plant(start, bound(start, [dead(each) for each in records(seed=20)]))


def test_a_model_is_identified_from_the_recordings_whose_sensor_lived():
    start = typical_model(PLANT)
    steps, sweep, sine = records(seed=20)
    with_it, without = (fit_plant(start, bound(start, made)) for made in ((steps, dead(sweep), sine), (steps, sine)))
    assert with_it.model == without.model
    assert any("sweep: channel 'flow [l/min]' stands at 3 all the time" in note for note in with_it.notes)


def with_gauge(each: Recording, bar: float) -> Recording:
    gauge = Channel("supply pressure", "bar", np.full(len(each), bar))
    return replace(each, channels={**each.channels, "supply pressure": gauge})


def test_a_gauge_whose_needle_sticks_has_no_say():
    start, made = typical_model(PLANT), records(seed=20)
    stuck = bound(start, [with_gauge(each, 105.0) for each in made])
    assert fit_plant(start, stuck).model.parameters == fit_plant(start, bound(start, made)).model.parameters
    assert all(not own for own in pose(nominal(), stuck).observed_noise)


def test_what_is_left_must_still_tell_something():
    start = typical_model(PLANT)
    steps, sweep, _ = records(seed=20)
    sweep.channels["command"].values[:] = 50.0
    with pytest.raises(FileError, match="sweep: the input never changes"):
        fit_plant(start, bound(start, [dead(steps), sweep]))
    with pytest.raises(FileError, match="sweep: the input never changes"):
        intake([dead(steps), sweep])
