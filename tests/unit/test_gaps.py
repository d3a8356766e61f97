"""Samples that are missing say nothing, and nothing is made of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil.diagnosis.events.repeats import without_stale
from hil.diagnosis.intake.problem import pose
from hil.errors import FileError
from hil.identification.grey_box.compare import compare
from hil.identification.grey_box.identify import fit_plant
from hil.identification.preparation.experiment import Experiment, experiment
from hil.identification.preparation.gaps import filled
from hil.identification.uncertainty.noise import channel_floor, white_floor
from hil.physics.compose import plant
from hil.physics.model import typical_model
from hil.record.recording import Array
from tests.answers import answer
from tests.concealed import NOISE, PLANT, RATE_HZ, bound, diagnosed, intake, nominal, records, with_rows

SECOND = round(RATE_HZ)


def residuals(e: Experiment) -> Array:
    model = nominal()
    error: Array = e.output - e.respond(model.definition, model.values)[0]
    return error[e.valid]


def test_a_healthy_unit_fits_beside_a_long_gap():
    made = [with_rows(each, np.delete(np.arange(len(each)), slice(800, 1200))) for each in records(seed=41)]
    checked = intake(made)
    for e in checked.experiments:
        assert e.grid_s is None and len(e.output) == 16 * SECOND
        assert e.invalid["output"][800:1250].all() and not e.invalid["output"][:800].any()
        assert e.invalid["output"].mean() < 0.25
        assert np.std(residuals(e)) < 1.05 * NOISE
    for said in ("gaps in the samples: 1, the longest 1.6 s", "where the command is unknown (1 ×)"):
        assert all(said in text for text in checked.warnings)


def test_a_healthy_unit_fits_with_a_fifth_of_its_samples_missing_anywhere():
    rng, made = np.random.default_rng(42), []
    for each in records(seed=42):
        kept = rng.random(len(each)) > 0.2
        kept[[0, -1]] = True
        made.append(with_rows(each, np.flatnonzero(kept)))
    for e in intake(made).experiments:
        assert e.grid_s is None and e.invalid["output"].mean() > 0.19
        assert np.std(residuals(e)) < 1.05 * NOISE
        assert white_floor(e.output) > 0.85 * NOISE  # what is drawn looks nearly as noisy as the rest


def test_what_is_drawn_through_a_gap_is_not_taken_for_samples_that_repeat():
    made = [with_rows(each, np.delete(np.arange(len(each)), slice(700, 950))) for each in records(seed=46)]
    for each in made:
        flow = each.channels["flow"].values
        flow[:] = np.rint(flow / 0.02) * 0.02
    assert without_stale(intake(made).experiments)[1] == ()


def test_a_command_that_jumps_in_a_hole_is_unknown_and_one_that_moves_on_is_not():
    steps, sweep, _ = bound(nominal(), [with_rows(each, np.delete(np.arange(len(each)), 2 * SECOND))
                                        for each in records(seed=43)])  # fmt: skip
    jumped, said = filled(steps, 0.1, forgets=True)
    assert jumped.invalid["output"].sum() == 1 + 0.5 * SECOND
    assert "where the command is unknown (1 ×)" in said[0]
    moved, said = filled(sweep, 0.1, forgets=True)
    assert moved.invalid["output"].sum() == 1
    assert "drawn straight through" in said[0]


def test_what_integrates_keeps_the_longest_stretch():
    axis, time_s = plant("linear-axis"), np.arange(0.0, 8.0, 1.0 / RATE_HZ)
    force = 250.0 * np.sin(2.0 * np.pi * 0.5 * time_s)
    whole = answer(axis, force, 1.0 / RATE_HZ)
    e = experiment(with_rows(whole, np.delete(np.arange(len(whole)), slice(500, 600))), axis)
    kept, said = filled(e, 0.0, forgets=False)
    assert kept.time_s[0] == pytest.approx(time_s[600]) and len(kept.output) == len(time_s) - 600
    assert kept.drive.first_output == whole.values("position")[600]
    assert "are used" in said[0]


def test_a_recording_that_never_settles_between_its_holes_is_refused():
    steps = records(seed=43)[0]
    holed = with_rows(steps, np.flatnonzero((np.arange(len(steps)) + 115) % SECOND < 125))
    (e,) = bound(nominal(), [holed])
    assert filled(e, 0.05, forgets=True)[0].valid.any()
    with pytest.raises(
        FileError, match=r"steps: gaps in the samples: 16.*: 10 samples are left; at least 20 are needed"
    ):
        filled(e, 10.0, forgets=True)


def test_stamps_on_no_grid_are_left_as_they_are():
    (each, *_) = records(seed=44)
    shifts = np.random.default_rng(44).uniform(-0.3, 0.3, len(each)) / RATE_HZ
    (e,) = bound(nominal(), [replace(each, time_s=each.time_s + shifts)])
    assert filled(e, 0.1, forgets=True) == (e, [])


def test_an_inner_signal_says_nothing_in_a_gap_either():
    made = records(seed=47, with_spool=True)
    gapped = [with_rows(each, np.delete(np.arange(len(each)), slice(800, 1200))) for each in made]
    problem = pose(nominal(), intake(gapped).experiments)
    r = problem.nominal_residuals
    assert problem.size == np.count_nonzero(r)
    assert float(r @ r) < 1.1 * problem.size


def test_samples_that_said_nothing_before_say_nothing_on_the_even_grid():
    (each, *_) = records(seed=48, with_spool=True)
    (e,) = bound(nominal(), [with_rows(each, np.delete(np.arange(len(each)), slice(800, 810)))])
    until, inner = np.arange(len(e.output)) < 50, np.arange(len(e.output)) >= 900
    even, _ = filled(e.without_all(until).without(inner, "spool position"), 0.0, forgets=True)
    assert len(even.output) == len(e.output) + 10
    spool = even.invalid["spool position"]
    for lost in (even.invalid["output"], spool):
        assert lost[:50].all() and not lost[50:800].any() and lost[800:810].all()
    assert not spool[810:910].any() and spool[910:].all()


def test_a_stretch_that_is_kept_keeps_what_said_nothing_before():
    (each, *_) = records(seed=48, with_spool=True)
    (e,) = bound(nominal(), [with_rows(each, np.delete(np.arange(len(each)), slice(200, 600)))])
    late = np.arange(len(e.output)) >= len(e.output) - 30
    cut, _ = filled(e.without(late).without(late, "spool position"), 0.0, forgets=False)
    assert len(cut.invalid["spool position"]) == len(cut.output) < len(e.output) + 400
    assert cut.invalid["spool position"].sum() == 30 and cut.invalid["output"][-30:].all()


@pytest.mark.parametrize("kept", ["all but a second", "four of five"])
def test_missing_samples_do_not_bend_what_is_identified(kept):
    rng, start = np.random.default_rng(48), typical_model(PLANT)
    made = []
    for each in records(seed=48):
        one = rng.random(len(each)) > 0.2 if kept == "four of five" else np.ones(len(each), dtype=np.bool_)
        one[900:1150] &= kept == "four of five"
        one[[0, -1]] = True
        made.append(with_rows(each, np.flatnonzero(one)))
    whole, found = (fit_plant(start, bound(start, each)) for each in (records(seed=48), made))
    for name, value in found.model.parameters.items():
        assert abs(value.value - whole.model.parameters[name].value) <= 3.0 * (value.std or 0.0), name
    assert found.model.noise is not None and abs(found.model.noise.std / NOISE - 1.0) < 0.05
    assert sum("missing" in note or "gap" in note for note in found.notes) == 3


def test_a_comparison_is_made_where_the_recording_says_something():
    whole = records(seed=49)[0]
    gapped = with_rows(whole, np.delete(np.arange(len(whole)), slice(900, 1150)))
    beside, alone = (compare(nominal(), *bound(nominal(), [each])) for each in (gapped, whole))
    assert abs(beside.fit - alone.fit) < 0.1
    assert len(beside.notes) == 1 and alone.notes == ()


def test_what_is_drawn_through_a_gap_is_not_shown_as_recorded():
    made = [with_rows(each, np.delete(np.arange(len(each)), slice(800, 1200))) for each in records(seed=45)]
    (strip, *_) = diagnosed(made).diagnosis.strips
    assert np.isnan(strip.measured[800:1200]).all()
    assert np.isfinite(strip.measured[:800]).all()
    assert (strip.off(strip.nominal)[800:1200] == 0.0).all()


def test_noise_is_measured_where_samples_say_something():
    (made,) = records(seed=8)[:1]
    flow = made.channels["flow"].values
    for start in range(200, len(flow) - 200, 400):
        flow[start : start + 100] = flow[start]
    kept, _ = without_stale(bound(nominal(), [made]))
    assert channel_floor(kept[0].output) < 0.85 * NOISE
    (noise,) = pose(replace(nominal(), noise=None), kept).noises
    assert noise.std == pytest.approx(NOISE, rel=0.05)
