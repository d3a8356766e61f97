"""Draws of a recording: the same for the same samples, others for others, whatever a processor does to the last bit."""

from __future__ import annotations

import numpy as np
import pytest

from hil.identification.uncertainty.parametric_bootstrap import DRAWS, about, draws_of

SAMPLES = np.random.default_rng(3).normal(size=500)


def drawn(samples: np.ndarray) -> float:
    return float(draws_of(samples).normal())


@pytest.mark.parametrize("samples", [SAMPLES, SAMPLES[:250] + 1j * SAMPLES[250:], np.zeros(5)])
def test_same_samples_give_the_same_draws(samples):
    assert drawn(samples) == drawn(samples.copy()) == drawn(samples * (1.0 + 2e-16))


def test_other_noise_gives_other_draws():
    again = SAMPLES.copy()
    again[7] += 1e-4
    assert drawn(again) != drawn(SAMPLES)


def test_missing_samples_do_not_keep_it_from_drawing():
    assert np.isfinite(drawn(np.where(np.arange(500) == 3, np.nan, SAMPLES)))


def test_chance_of_few_draws_is_not_the_same_in_every_recording():
    spreads = []
    for seed in range(200):
        noise = draws_of(np.random.default_rng(seed).normal(size=50)).normal(size=DRAWS)
        spreads.append(about(noise - noise.mean(), 0.0))
    assert np.sqrt(np.mean(np.square(spreads))) == pytest.approx(1.0, abs=0.03)
    assert np.std(spreads) > 0.05
