"""Long recordings are compared as means of neighbours: intervals stay, and memory does not follow the sample rate."""

from dataclasses import replace

import numpy as np
import pytest

from hil.identification.grey_box.estimate import estimate
from hil.identification.grey_box.free import unknown_of
from hil.identification.grey_box.identify import starting_model
from hil.identification.grey_box.residuals import Residuals
from hil.identification.preparation.averaged import means, with_means
from hil.identification.preparation.experiment import Experiment
from hil.physics.model import Model
from hil.physics.simulate import Drive, simulate
from hil.record.recording import Array


def _recorded(model: Model, command: Array, interval_s: float) -> Experiment:
    plant = model.definition
    drive = Drive(command[None, :], 0.0, interval_s, 0.0)
    noise = np.random.default_rng(7).normal(0.0, 0.3, len(command))
    output = simulate(plant, model.values, drive)[0] + noise
    time_s = interval_s * np.arange(len(command))
    return Experiment("sine", "command [%]", "flow [l/min]", time_s, drive, None, output, {}, reading_known=True)


def _sine(samples: int, interval_s: float, frequency_hz: float) -> Array:
    return np.asarray(60.0 * np.sin(2.0 * np.pi * frequency_hz * interval_s * np.arange(samples)))


def test_means_of_white_noise_have_the_variance_of_a_sample_also_where_the_last_mean_is_of_fewer():
    noise = np.random.default_rng(1).normal(size=80_001)

    made = means(noise, 8)

    assert len(made) == 10_001
    assert float(np.std(made)) == pytest.approx(1.0, abs=0.03)
    assert made[-1] == noise[-1]


def test_only_a_long_recording_of_slow_motion_is_compared_as_means():
    model = starting_model("brevini-hpv41")
    cases = ((140_000, 1e-3, 0.4), (20_000, 1e-3, 0.4), (140_000, 4e-3, 10.0))

    made, notes = with_means(model, [_recorded(model, _sine(*case), case[1]) for case in cases])

    assert [e.averaged for e in made] == [2, 1, 1]
    assert notes == ("sine: 2 neighbouring samples are compared as one mean: the plant moves little between them",)


def test_means_leave_estimates_and_their_uncertainties_as_they_are():
    model = starting_model("brevini-hpv41")
    recorded = _recorded(model, _sine(10_000, 1e-3, 0.4), 1e-3)
    unknowns = [unknown_of(model, name) for name in ("full_flow", "dead_time")]

    def fitted(count):
        of = Residuals(model.definition, [replace(recorded, averaged=count)], model.values, ())
        named = [u.name for u in unknowns]
        return estimate(lambda x: of.at(dict(model.values) | dict(zip(named, x.tolist(), strict=True)), ()), unknowns)

    each, mean = fitted(1), fitted(4)

    assert len(mean.residuals) == len(each.residuals) / 4
    assert mean.std == pytest.approx(each.std, rel=0.1)
    assert np.all(np.abs(mean.values - each.values) < 0.2 * each.std)
