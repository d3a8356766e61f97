"""Recordings that cannot be what their headings say are refused, or warned of, before any physics is blamed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from hil.diagnosis.intake.check import check
from hil.errors import FileError
from hil.physics.compose import plant
from hil.physics.model import Model
from tests.concealed import PLANT, WORN, bound, changed, intake, noise, nominal, poor, records, with_rows


def test_swapped_columns_are_refused():
    def swap(each):
        command, flow = each.channels["command"].values, each.channels["flow"].values
        kept = command.copy()
        command[:], flow[:] = flow, kept

    with pytest.raises(FileError, match="look swapped"):
        intake(changed(swap))


def test_columns_that_look_swapped_are_taken_where_their_units_are_stated():
    def swap(each):
        command, flow = each.channels["command"].values, each.channels["flow"].values
        command[:], flow[:] = flow.copy(), command.copy()

    stated = frozenset({"command", "flow"})
    check(nominal(), [replace(e, stated_units=stated) for e in bound(nominal(), changed(swap))])


@pytest.mark.parametrize("gain", [1.0, 1.4])
def test_swapped_columns_are_refused_where_the_model_never_fitted_well(gain):
    """Of a unit that may have changed besides, and whose command was measured with more noise than its flow."""
    made = records([WORN], {"full_flow": gain * plant(PLANT).typical["full_flow"]}, seed=25)
    for each in made:
        command, flow = each.channels["command"].values, each.channels["flow"].values
        kept = command + 0.3 * noise(np.random.default_rng(32), len(command))
        command[:], flow[:] = gaussian_filter1d(flow, 20.0), kept
    with pytest.raises(FileError, match="look swapped"):
        check(poor(), bound(poor(), made))


def test_a_recording_shorter_than_a_time_constant_is_refused():
    with pytest.raises(FileError, match="at least one time constant"):
        intake([with_rows(each, slice(20)) for each in records(seed=21)])


def test_recordings_may_be_as_short_as_those_of_identification():
    """A cylinder's piston creeps with 44 s; it was identified from recordings of 20 s, and is diagnosed on as many."""
    model = nominal()
    assert model.origin["longest_s"] == max(e.duration_s for e in bound(model, records(seed=21)))
    short = bound(model, [with_rows(each, slice(20)) for each in records(seed=21)])
    known: Model = replace(model, origin={**model.origin, "longest_s": max(e.duration_s for e in short)})
    assert len(check(known, short).experiments) == len(short)


def test_a_constant_command_is_refused():
    def stand_still(each):
        each.channels["command"].values[:] = 50.0

    with pytest.raises(FileError, match="never changes"):
        intake(changed(stand_still))


def test_a_clipped_channel_is_left_out_and_said():
    def clip(each):
        flow = each.channels["flow"].values
        flow[:] = np.clip(flow, -20.0, 20.0)

    checked = intake(changed(clip))
    assert any("clipped at" in text for text in checked.warnings)
    assert all(e.invalid["output"].any() for e in checked.experiments)


def test_a_slow_channel_is_clipped_where_noise_lets_it_go_for_a_moment_too():
    def clip(each):
        flow = each.channels["flow"].values
        flow[:] = np.minimum(flow, np.quantile(flow, 0.9))

    made = changed(clip)
    for e, each in zip(intake(made).experiments, made, strict=True):
        flow = each.channels["flow"].values
        at_the_end = np.flatnonzero(flow == flow.max())
        ignored = e.invalid["output"][at_the_end]
        assert ignored.mean() > 0.98  # a sample at the end is half a noise too low, wherever it lies


def test_good_recordings_pass_without_a_word():
    assert intake(records(seed=23)).warnings == ()
