"""Samples that were not measured anew, and the noise of a channel that has many of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil.diagnosis.events.repeats import held_outputs, misfit_while_stale, without_stale
from hil.diagnosis.intake.problem import pose
from hil.diagnosis.search.fitted import nothing
from hil.identification.uncertainty.noise import channel_floor, white_floor
from hil.physics.simulate import ActiveEffect
from hil.record.recording import Recording
from tests.concealed import NOISE, RATE_HZ, bound, nominal, posed, records

SECOND = round(RATE_HZ)


def noisy() -> np.ndarray:
    return NOISE * np.random.default_rng(5).standard_normal(4000)


@pytest.mark.parametrize("share", [0.2, 0.45, 0.48, 0.55])
def test_a_recorder_that_stops_once_for_long_is_recognised_by_that_alone(share):
    """However much of the recording that is: the noise of what was measured is asked."""
    made = records(seed=23)
    flow = made[1].channels["flow"].values
    flow[:] = np.round(flow / (NOISE / 4.0)) * (NOISE / 4.0)
    measured = round((1.0 - share) * len(flow))
    flow[measured:] = flow[measured]
    kept, intervals = without_stale(bound(nominal(), made))
    assert [(s.recording, s.start_s) for s in intervals] == [("sweep", measured / SECOND)]
    assert kept[1].invalid["output"].mean() == pytest.approx(share, abs=0.001)


def test_a_short_run_alone_is_nothing():
    made = records(seed=23)
    flow = made[1].channels["flow"].values
    flow[5 * SECOND : 5 * SECOND + 20] = flow[5 * SECOND]
    assert without_stale(bound(nominal(), made))[1] == ()


def test_a_unit_that_rests_before_the_first_command_repeats_one_value():
    made = records(seed=23)
    command, flow = (made[1].channels[name].values for name in ("command", "flow"))
    command[: 2 * SECOND], flow[: 2 * SECOND] = command[0], flow[0]
    assert without_stale(bound(nominal(), made))[1] == ()
    flow[5 * SECOND : 7 * SECOND] = flow[5 * SECOND]
    assert [s.start_s for s in without_stale(bound(nominal(), made))[1]] == [5.0]


def test_a_channel_that_comes_back_to_few_values_repeats_them_by_itself():
    """A counter's speed has few levels; resampled it shows some between, and its finest step is none of them."""
    made = records(seed=23)
    flow, rng = made[1].channels["flow"].values, np.random.default_rng(8)
    flow[:] = np.round(flow) + rng.integers(-1, 2, len(flow))
    between = rng.random(len(flow)) < 0.3
    flow[between] += 0.01 * rng.integers(1, 50, int(between.sum()))
    assert without_stale(bound(nominal(), made))[1] == ()


@pytest.mark.parametrize("at", ["where it was", "at its lowest"])
def test_the_noise_of_a_channel_that_stands_still_for_long_is_that_of_the_rest(at):
    values = noisy()
    values[1500:] = values[1500] if at == "where it was" else values.min()
    assert channel_floor(values) == pytest.approx(NOISE, rel=0.1)


def test_a_coarse_channel_at_rest_has_the_noise_of_its_resolution():
    values = np.round(np.sin(np.arange(4000) / 500.0) / 0.01) * 0.01
    values[1500:] = values[1500]
    assert white_floor(values) == 0.0
    assert channel_floor(values) == pytest.approx(0.01 / np.sqrt(12.0))


def test_coarse_steps_above_a_level_are_no_samples_that_were_not_measured():
    """A meter that reads finely below a level and coarsely above it: repeats, but never for long at one value."""
    rising = np.linspace(0.0, 20.0, 4000) + 0.002 * np.random.default_rng(6).standard_normal(4000)
    values = np.where(rising < 4.0, np.round(rising, 4), 0.38 * np.round(rising / 0.38))
    assert white_floor(values) == 0.0


def coarse(made: list[Recording], step: float) -> list[Recording]:
    for each in made:
        flow = each.channels["flow"].values
        flow[:] = step * np.round(flow / step)
    return made


def test_a_coarse_channel_that_catches_up_at_once_was_not_measured_anew():
    made = coarse(records(seed=24), NOISE)
    sweep = made[1].channels["flow"].values
    lost = [SECOND * k for k in (5, 6, 7, 10, 11)]
    for start in lost:
        sweep[start : start + 40] = sweep[start]
    kept, intervals = without_stale(bound(nominal(), made))
    assert intervals == ()  # chance may repeat a reading for as long
    problem = pose(nominal(), kept)
    found = held_outputs(problem, nothing(problem))
    assert found is not None
    assert [round(s.start_s * SECOND) for s in found.intervals] == pytest.approx(lost, abs=3)
    assert problem.excess(problem.nominal_residuals @ problem.nominal_residuals) > 0.5
    assert problem.excess(found.chi2) < 1.0 / 12.0 + 0.05  # a twelfth is what rounding adds


def test_samples_that_were_not_measured_anew_take_no_misfit_with_them():
    """A model that is off at a constant output was explained by readings that repeat there."""
    made = records(seed=24)
    problem = posed(made)
    lost = np.zeros(len(problem.experiments[1].output), dtype=bool)
    lost[500:540] = True
    rest = [e.without(lost) if k == 1 else e for k, e in enumerate(problem.experiments)]
    residuals = np.full(len(problem.nominal_residuals), 7.0)
    counted = problem.outputs_of(misfit_while_stale(problem, rest, residuals))
    assert np.flatnonzero(counted[1]).tolist() == list(range(500, 540))
    assert np.all(counted[1][lost] == 7.0)
    assert not any(other.any() for k, other in enumerate(counted) if k != 1)


def test_a_spool_that_sticks_does_not_catch_up_at_once():
    stuck = ActiveEffect("friction", "force", {"coulomb": 6.0, "stiction": 2.0, "stribeck": 5.0, "presliding": 0.01})
    problem = posed(coarse(records((stuck,), seed=25), 4.0 * NOISE))
    start = nothing(problem)
    assert problem.excess(start.chi2) > 10.0
    assert held_outputs(problem, start) is None


def test_a_channel_without_noise_repeats_by_itself_and_may_jump():
    """A pressure that a spool's edge lets rise within a sample after a slow start, read in steps and without noise."""
    problem = posed(records(seed=26))
    still = problem.experiments[1].output.copy()
    still[:] = still[0]
    still[2000:] = still[0] + 40.0
    e = replace(problem.experiments[1], output=still)
    alone = replace(problem, experiments=(problem.experiments[0], e, problem.experiments[2]))
    assert held_outputs(alone, nothing(alone)) is None


def test_what_stands_in_samples_that_say_nothing_is_felt_nowhere():
    """Noise with a memory is whitened by a filter, which must not carry a stale reading on to the samples after it."""
    healthy = nominal()
    known = healthy.noise
    assert known is not None
    colour = tuple(0.05 * 0.97**k for k in range(60))
    model = replace(healthy, noise=replace(known, colour=colour, interval_s=1.0 / RATE_HZ))
    problem = pose(model, [e.without(np.arange(len(e.output)) // 40 % 7 == 3) for e in bound(model, records(seed=25))])
    assert problem.noises[0].colour == colour
    other = tuple(replace(e, output=np.where(e.valid, e.output, 1e3)) for e in problem.experiments)
    assert np.array_equal(replace(problem, experiments=other).nominal_residuals, problem.nominal_residuals)
