"""Of a settled sine one mean period tells what all of its periods tell, in less time."""

from dataclasses import replace

import numpy as np
import pytest

from hil.identification.grey_box.estimate import Estimate, estimate
from hil.identification.grey_box.free import unknown_of
from hil.identification.grey_box.identify import starting_model
from hil.identification.grey_box.residuals import Residuals
from hil.identification.preparation.experiment import Experiment, Sine
from hil.identification.preparation.mean_period import with_mean_periods
from hil.physics.model import Model
from hil.physics.simulate import Drive, simulate
from hil.record.recording import Array

_INTERVAL_S, _SETTLING, _MEASURED = 1e-3, 2000, 10_000
_FREQUENCIES_HZ = (0.7, 1.3, 2.1)  # their periods are no whole numbers of samples


def _recorded(plant: str = "brevini-hpv41", disturbance: Array | float = 0.0) -> tuple[Model, Experiment]:
    """One sine after another, each settling before it is measured, in a recording that is long enough for means."""
    model = starting_model(plant)
    count = _SETTLING + _MEASURED
    turns = np.repeat(_FREQUENCIES_HZ, count) * _INTERVAL_S
    command = 60.0 + 20.0 * np.sin(2.0 * np.pi * np.cumsum(turns))
    drive = Drive(command[None, :], 0.0, _INTERVAL_S)
    noise = np.random.default_rng(7).normal(0.0, 0.3, len(command))
    output = simulate(model.definition, model.values, drive)[0] + noise + disturbance
    sines = tuple(Sine(hz, k * count + _SETTLING, _MEASURED) for k, hz in enumerate(_FREQUENCIES_HZ))
    time_s = _INTERVAL_S * np.arange(len(command))
    made = Experiment("sines", "command [%]", "flow [l/min]", time_s, drive, None, output, {}, reading_known=True)
    return model, replace(made, averaged=8, sines=sines)


def _fitted(model: Model, e: Experiment) -> Estimate:
    unknowns = [unknown_of(model, name) for name in ("full_flow", "dead_time", "pilot_rate", "spool_frequency")]
    of = Residuals(model.definition, [e], model.values, ())
    names = [u.name for u in unknowns]
    return estimate(lambda x: of.at(dict(model.values) | dict(zip(names, x.tolist(), strict=True)), ()), unknowns)


def test_a_mean_period_leaves_estimates_and_their_uncertainties_as_they_are():
    model, every = _recorded()

    (short,), notes = with_mean_periods(model, [every])
    by_every, by_mean = _fitted(model, every), _fitted(model, short)

    assert notes == ("sines: 3 settled sines are compared as one mean period each: 28 % of the samples are simulated",)
    assert len(short.output) < 0.3 * len(every.output)
    assert by_mean.std == pytest.approx(by_every.std, rel=0.1)
    assert np.all(np.abs(by_mean.values - by_every.values) < 0.2 * by_every.std)
    assert by_mean.mean_square == pytest.approx(1.0, abs=0.1)


def test_the_command_goes_on_in_step_where_periods_are_left_out():
    model, every = _recorded()

    (short,), _ = with_mean_periods(model, [every])

    largest = float(np.abs(np.diff(every.drive.inputs)).max())
    assert float(np.abs(np.diff(short.drive.inputs)).max()) < 1.25 * largest  # less than half a sample late


def test_samples_that_lie_between_those_of_the_first_period_are_read_there():
    model, every = _recorded()
    without_noise = replace(every, output=every.simulated(model)[0], whole=every)

    (short,), _ = with_mean_periods(model, [without_noise])

    settled = short.root_counts > 1.0
    assert float(np.abs(short.simulated(model)[0] - short.output)[settled].max()) < 0.01


@pytest.mark.parametrize(
    "disturbance",
    [
        pytest.param(np.linspace(0.0, 2.0, 36_000), id="drift"),
        pytest.param(np.sin(2.0 * np.pi * 0.31 * 1e-3 * np.arange(36_000)), id="another tone"),
    ],
)
def test_every_sample_counts_where_periods_differ_by_more_than_noise(disturbance):
    model, every = _recorded(disturbance=disturbance)

    (same,), notes = with_mean_periods(model, [every])

    assert same is every
    assert notes == ()


def test_a_sine_with_a_lost_sample_keeps_all_of_its_periods():
    model, every = _recorded()
    lost = np.arange(len(every.output)) == _SETTLING + 5000

    (short,), _ = with_mean_periods(model, [every.without(lost)])

    assert np.array_equal(short.output[:_MEASURED], every.output[:_MEASURED])


def test_a_short_recording_stays_as_it_is():
    model, every = _recorded()
    short = replace(every, averaged=1)

    assert with_mean_periods(model, [short]) == ([short], ())


def test_a_plant_that_remembers_its_start_is_compared_in_every_period():
    model, every = _recorded("hydraulic-actuator")

    assert with_mean_periods(model, [every])[0] == [every]
