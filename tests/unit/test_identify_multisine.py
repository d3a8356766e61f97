from dataclasses import replace

import numpy as np
import pytest

from hil.errors import InputError
from hil.identification.frequency.best_linear_approximation import best_linear_approximation
from hil.identification.uncertainty.parametric_bootstrap import about
from hil.physics.transfer_function import transfer_function
from hil.record.recording import recording
from hil.signals.multisine import odd_multisine

RATE_HZ = 200.0
MODEL = transfer_function([40.0], [1.0, 12.0, 50.0])
SINES = odd_multisine(0.1, 4.9, 0.1, RATE_HZ, 20.0, seed=2)
PERIODS = 8


def answer(sines, curve):
    """Steady periodic response: the model's exact line by line, then a static curve."""
    lines = np.fft.rfft(sines.period)
    frequency_hz = np.fft.rfftfreq(len(sines.period), 1 / RATE_HZ)
    return curve(np.fft.irfft(lines * MODEL.at(frequency_hz), len(sines.period)))


def bench(curve, noise, seed=0, sines=SINES):
    command = sines.signal(PERIODS, bias=50.0)
    output = np.tile(answer(sines, curve), PERIODS) + noise * np.random.default_rng(seed).normal(size=len(command))
    part = sines.as_part() | {"first": 0, "count": len(command), "bias": 50.0}
    columns = {"command [%]": command, "flow [l/min]": output}
    return recording("bench", np.arange(len(command)) / RATE_HZ, columns, {"parts": [part]})


def approximated(curve, noise, seed=0, sines=SINES):
    (found,) = best_linear_approximation(bench(curve, noise, seed, sines), "command", "flow")
    return found


def test_a_linear_plant_comes_back_with_noise_alone():
    errors, stated = [], []
    for seed in range(40):
        found = approximated(lambda v: v, 0.3, seed)
        errors.append(found.response.response - MODEL.at(found.response.frequency_hz))
        stated.append(found.response.covariance[:, 0, 0])
    assert found.periods == PERIODS - 1
    assert np.allclose(found.response.frequency_hz, SINES.excited * 0.1)
    assert np.allclose(np.var(np.real(errors), axis=0).mean(), np.mean(stated), rtol=0.5)
    # rms of the mean of 7 periods at a line: σ·√(2·2/N)/√7 in the amplitude spectrum
    expected = 0.3 * np.sqrt(4 / len(SINES.period) / 7)
    assert np.median(found.noise_std) == pytest.approx(expected, rel=0.3)
    assert found.verdicts.count("noise") > 0.6 * len(found.verdicts)


@pytest.mark.parametrize(
    ("curve", "verdict"),
    [
        (lambda v: v + 0.01 * v**2, "even nonlinearity"),
        (lambda v: v - 0.002 * v**3, "odd nonlinearity"),
    ],
)
def test_distortion_is_told_even_from_odd(curve, verdict):
    found = approximated(curve, 0.05)
    assert found.verdicts.count(verdict) > 0.8 * len(found.verdicts)
    assert found.sentence.startswith(f"{verdict} dominates")
    odd = verdict.startswith("odd")
    assert (np.median(found.odd_std) > np.median(found.even_std)) == odd


def test_odd_distortion_widens_the_uncertainty_to_what_other_phases_give():
    def realisation(seed):
        made = odd_multisine(0.1, 4.9, 0.02, RATE_HZ, 20.0, seed=seed, crest_iterations=0)
        return replace(made, period=made.period * 5.0 / np.std(made.period))

    found = [approximated(lambda v: v - 0.002 * v**3, 0.001, sines=realisation(seed)) for seed in range(16)]
    errors, stated = [], []
    for f in found:
        linear = MODEL.at(f.response.frequency_hz)
        at = np.searchsorted(f.response.frequency_hz, np.linspace(0.3, 4.5, 15))
        errors.append(f.response.response[at] / linear[at])
        stated.append(2 * f.response.covariance[at, 0, 0] / np.abs(linear[at]) ** 2)
    # The linear approximation scatters over realisations by what the silent lines of each one foretell.
    scatter = np.var(errors, axis=0)
    assert np.mean(stated) == pytest.approx(scatter.mean(), rel=0.3)
    assert scatter[-1] > 5 * scatter[0] and np.mean(stated, axis=0)[-1] > 5 * np.mean(stated, axis=0)[0]


def test_what_is_missing_is_said():
    plain = recording(
        "plain", np.arange(100) / RATE_HZ, {"command [%]": np.arange(100.0), "flow [l/min]": np.arange(100.0)}
    )
    with pytest.raises(InputError, match="kind 'multisine'"):
        best_linear_approximation(plain, "command", "flow")
    with pytest.raises(InputError, match="two must remain"):
        best_linear_approximation(bench(lambda v: v, 0.0), "command", "flow", settle_periods=7)


def test_rounding_that_is_alike_in_every_period_is_no_distortion(monkeypatch):
    step = 0.5  # of the converter, beside which the noise is small
    made = bench(lambda v: v, 0.01)
    read = step * np.round(made.values("flow") / step)
    rounded = recording("bench", made.time_s, {"command [%]": made.values("command"), "flow [l/min]": read}, made.meta)
    (found,) = best_linear_approximation(rounded, "command", "flow")
    level = float(np.median(found.odd_std))
    assert level < 4.0 * about(np.median(found.resampled_odd, axis=1), level)  # a bound, where it would be a value
    monkeypatch.setattr("hil.identification.frequency.best_linear_approximation.rounding_step", lambda _values: 0.0)
    (taken,) = best_linear_approximation(rounded, "command", "flow")
    level = float(np.median(taken.odd_std))
    assert level > 4.0 * about(np.median(taken.resampled_odd, axis=1), level)
