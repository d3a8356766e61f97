"""The loop closes: what is simulated, tested and identified comes back within its stated uncertainty."""

import math

import numpy as np
import pytest

from hil.identification.frequency.measuring_chain import MeasuringChain, corrected
from hil.identification.frequency.rational import Form
from hil.identification.frequency.sine_segments import frequency_responses
from hil.identification.frequency.transfer_function import fit_form
from hil.physics.published import tordal
from hil.physics.simulate import Drive, simulate
from hil.record.recording import recording
from hil.signals.stepped_sine import sine

RATE_HZ = 1000.0
NOISE_LPM = 0.2
LSB_LPM = 200.0 / 2**16  # ±100 l/min on a 16-bit converter


def stepped(run, frequencies, measure_periods):
    """The command of a stepped sine and the parts that a procedure would write down."""
    blocks, parts, at = [], [], 0
    for frequency_hz in frequencies:
        settle = max(2, math.ceil(1.5 * frequency_hz))
        block = sine(frequency_hz, run.amplitude, RATE_HZ, settle + measure_periods, bias=run.bias)
        first = round(settle * RATE_HZ / frequency_hz)
        parts.append({
            "kind": "sine", "frequency_hz": frequency_hz, "amplitude": run.amplitude, "bias": run.bias,
            "first": at + first, "count": len(block) - first,
        })  # fmt: skip
        blocks.append(block)
        at += len(block)
    return np.concatenate(blocks), parts


def bench(run, frequencies, measure_periods=1):
    """A function that measures a published model on a bench with noise and converters, once per seed."""
    command, parts = stepped(run, frequencies, measure_periods)
    clean = simulate(run.model.definition, run.model.values, Drive(command[None, :], math.nan, 1 / RATE_HZ))[0]
    time_s = np.arange(len(command)) / RATE_HZ

    def measure(seed):
        noisy = clean + NOISE_LPM * np.random.default_rng(seed).normal(size=len(clean))
        columns = {tordal.INPUT: command, tordal.OUTPUT: LSB_LPM * np.round(noisy / LSB_LPM)}
        made = recording(run.name, time_s, columns, {"parts": parts})
        (response,) = frequency_responses(made, "reference flow", "flow")
        return corrected(response, MeasuringChain(hold_s=1 / RATE_HZ))

    return measure


@pytest.mark.parametrize("run", tordal.RUNS, ids=lambda run: run.name)
def test_the_six_models_come_back_from_the_papers_own_test(run):
    response = bench(run, tordal.FREQUENCIES_HZ)(seed=1)
    fit = fit_form(response, Form(3, 1))
    truth = np.array([run.b1, run.b0, run.a2, run.a1, run.a0])
    assert np.all(np.abs(fit.coefficients - truth) < 3.5 * fit.coefficient_std)
    assert fit.fit_percent > run.fit_percent + 2
    assert 0.5 < fit.misfit < 1.6
    assert fit.converged


@pytest.mark.parametrize("run", tordal.RUNS, ids=lambda run: run.name)
def test_95_percent_intervals_cover(run):
    measure = bench(run, (0.3, 0.7, 1.1, 1.7, 2.3, 2.9, 3.5, 4.1, 4.9))
    truth = np.array([run.b1, run.b0, run.a2, run.a1, run.a0])
    covered = []
    for seed in range(40):
        fit = fit_form(measure(seed), Form(3, 1))
        covered.append(np.abs(fit.coefficients - truth) < 1.96 * fit.coefficient_std)
    assert 0.88 <= np.mean(covered) <= 0.99
