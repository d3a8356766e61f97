"""Noise is what shows with no input in it; what a model leaves beyond that is a discrepancy."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from hil.identification.grey_box.compare import compare
from hil.identification.grey_box.identify import fit_plant
from hil.identification.preparation.experiment import Experiment
from hil.identification.uncertainty.noise import Measured, measured_noise, noise_of, white_floor
from hil.physics.model import Model, typical_model
from hil.record.recording import Array
from hil.signals.recursion import filtered
from tests.flap import FLAP, NOISE_V, recorded


def coloured(pole: float, count: int, seed: int) -> Array:
    """Noise of standard deviation 1."""
    white = np.random.default_rng(seed).standard_normal(count + 500)
    return np.asarray(filtered([np.sqrt(1.0 - pole**2)], [1.0, -pole], white)[500:], dtype=np.float64)


def measured(pole: float, misfit: Array, rests: list[Array]) -> Measured:
    noise = coloured(pole, len(misfit), 1)
    return measured_noise([10.0 * misfit + noise], rests, [misfit + noise], 0.01)


def slow(size: float) -> Array:
    return size * np.sin(np.arange(8000) * 0.01)


@pytest.mark.parametrize("pole", [0.0, 0.5, 0.8, 0.95])
def test_noise_of_holds_the_level_of_noise_at_rest(pole):
    held = 0
    for seed in range(40):
        found = noise_of([coloured(pole, 400, 4 * seed + k) for k in range(4)], 0.01)
        held += abs(found.std - 1.0) < 1.96 * found.std_uncertainty
    assert held >= 34


@pytest.mark.parametrize("steps", [0.5, 0.8, 1.0, 1.6, 5.0])
def test_the_floor_of_a_coarse_channel_lies_between_the_multiples_of_its_step(steps):
    """`steps`: noise over the converter's step; without interpolation 0.8 and 1.6 are off by five standard errors."""
    moving = 200.0 * np.sin(np.arange(40_000) * 0.005)
    read = [np.round(moving + steps * coloured(0.0, len(moving), seed)) for seed in range(4)]
    floor = np.mean([white_floor(values) for values in read])
    assert floor == pytest.approx(np.hypot(steps, np.sqrt(1.0 / 12.0)), rel=0.025 if steps < 0.8 else 0.01)


def test_a_misfit_counts_as_discrepancy_and_not_as_noise():
    found = measured(0.0, slow(2.0), [])
    assert found.noise.std == pytest.approx(1.0, rel=0.05)
    assert found.discrepancy == pytest.approx(np.sqrt(2.0), rel=0.05)
    assert not found.is_witnessed


def test_coloured_noise_is_believed_at_rest_alone():
    rest = [coloured(0.9, 1000, seed) for seed in (5, 6, 7)]
    assert measured(0.9, slow(0.0), []).discrepancy > 0.8
    seen = measured(0.9, slow(0.0), rest)
    assert seen.discrepancy == 0.0
    assert seen.noise.colour
    misfit = measured(0.9, slow(3.0), rest)
    assert misfit.is_witnessed
    assert misfit.noise.std == pytest.approx(1.0, rel=0.2)
    assert misfit.discrepancy == pytest.approx(3.0 / np.sqrt(2.0), rel=0.1)


def flap(coulomb: float, seed: int) -> Experiment:
    return recorded(f"flap-{seed}", coulomb, seed, levels=20)


@cache
def frictionless() -> Model:
    """As identified on a unit that the plant describes."""
    return fit_plant(typical_model(FLAP.name), [flap(0.0, 1), flap(0.0, 2)]).model


def test_identification_says_what_a_model_leaves_beyond_the_noise():
    found = fit_plant(typical_model(FLAP.name), [flap(3.0, 1), flap(3.0, 2)])
    assert found.model.noise is not None
    assert found.model.noise.std == pytest.approx(NOISE_V, rel=0.1)
    assert found.model.origin["discrepancy"]["rms"] > NOISE_V
    assert any(note.startswith("the model leaves ") and " times the noise" in note for note in found.notes)
    assert "discrepancy" not in frictionless().origin


def test_a_comparison_has_the_noise_of_the_model_and_a_ceiling_that_nothing_exceeds():
    found = frictionless()
    one = compare(found, flap(0.0, 3).reading_at(found.read_at))
    assert found.noise is not None
    assert one.noise_std == found.noise.std
    assert one.fit is not None
    assert one.ceiling is not None
    assert one.ceiling >= one.fit


def test_what_leaves_nothing_at_all_has_the_noise_of_its_numbers():
    level = np.round(slow(20.0), 3)
    found = measured_noise([level], [], [np.zeros(8000)], 0.01)
    assert found.noise.std == pytest.approx(1e-3 / np.sqrt(12.0), rel=1e-3)
    assert found.discrepancy == 0.0
