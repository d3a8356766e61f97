"""What an estimate says of its uncertainty."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from hil.identification.grey_box.estimate import Estimate, Unknown, estimate
from hil.identification.uncertainty.identifiability import Curvature, identifiability
from hil.record.recording import Array


def two_that_act_as_their_sum(count: int = 4000, noise: float = 0.1) -> Estimate:
    rng = np.random.default_rng(1)
    design = rng.standard_normal(count)
    measured = 3.0 * design + noise * rng.standard_normal(count)

    def residuals(values: Array) -> Array:
        left: Array = ((values[0] + values[1]) * design - measured) / noise
        return left

    return estimate(residuals, [Unknown("a", "s", 1.0, -10.0, 10.0, 1.0), Unknown("b", "s", 1.0, -10.0, 10.0, 1.0)])


def test_what_acts_as_a_sum_cannot_be_told_apart_but_is_there():
    found = two_that_act_as_their_sum()
    assert found.values.sum() == pytest.approx(3.0, abs=0.01)
    assert np.all(np.isinf(found.std))


def test_samples_that_say_nothing_make_no_interval_narrower():
    rng = np.random.default_rng(3)
    measured = 2.0 + rng.standard_normal(4000)
    says = rng.random(4000) < 0.2
    level = [Unknown("level", "V", 1.0, -10.0, 10.0, 1.0)]
    masked = estimate(lambda values: np.where(says, values[0] - measured, 0.0), level)
    alone = estimate(lambda values: values[0] - measured[says], level)
    assert masked.std == pytest.approx(alone.std, rel=0.05)
    assert masked.mean_square == pytest.approx(alone.mean_square)


class Counted:
    """Residuals of a curved valley, lowest where every value is one, and how often they were asked for."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self, values: Array) -> Array:
        self.calls += 1
        return np.concatenate([values - 1.0, 3.0 * (values[1:] - values[:-1] ** 2), 0.1 * np.sin(values - 1.0)])


def test_secants_lead_where_differences_lead_with_fewer_simulations():
    valley = Counted()
    found = estimate(valley, [Unknown(f"x{k}", "1", 0.3, -5.0, 5.0, 1.0) for k in range(8)], tolerance=1e-10)
    assert found.converged
    assert found.values == pytest.approx(np.ones(8), abs=1e-4)
    assert valley.calls < 70  # 85 by differences alone


def test_nobody_pays_for_an_uncertainty_that_is_not_asked_for():
    valley = Counted()
    found = estimate(valley, [Unknown(f"x{k}", "1", 0.3, -5.0, 5.0, 1.0) for k in range(8)])
    before = valley.calls
    assert found.chi2 < 1e-6 and valley.calls == before
    assert np.all(np.isfinite(found.std)) and valley.calls == before + 8
    assert found.covariance.shape == (8, 8) and valley.calls == before + 8


def test_a_sketch_is_asked_for_slopes_and_the_whole_for_what_they_bring():
    valley, rough = Counted(), Counted()

    def sketch(values):
        nearly: Array = 1.05 * rough(values) + 0.2
        return nearly

    unknowns = [Unknown(f"x{k}", "1", 0.3, -5.0, 5.0, 1.0) for k in range(8)]
    found = estimate(valley, unknowns, sketch=sketch, tolerance=1e-10)
    assert found.converged
    assert found.values == pytest.approx(np.ones(8), abs=1e-4)
    assert valley.calls < 40 < rough.calls
    before = valley.calls
    assert np.all(np.isfinite(found.std)) and valley.calls == before + 8  # uncertainties are of the whole


def along_a_bent_valley(*, careful: bool) -> Estimate:
    """Three values of which only (1 − a/2 − b)/c shows, to a hundred-thousandth, and curved."""
    noise = np.random.default_rng(2).standard_normal(3000)
    at = np.linspace(0.0, 1.0, 3000)

    def residuals(values: Array) -> Array:
        share = (1.0 - values[0] / 2.0 - values[1]) / values[2]
        left: Array = 1e4 * (np.sqrt(share) - np.sqrt(0.4)) * np.sin(3.0 * at) + noise
        return left

    starts = {"a": (0.04, 0.3), "b": (0.4, 1.0), "c": (1.4, 3.0)}
    unknowns = [Unknown(name, "A", start, 0.0, high, start) for name, (start, high) in starts.items()]
    return estimate(residuals, unknowns, careful=careful)


def test_the_bend_of_a_valley_is_no_information_about_the_way_along_it():
    found = along_a_bent_valley(careful=True)
    assert found.identifiability.is_shared_beyond_noise.all()
    assert found.std[0] == np.inf
    assert np.all(found.std[1:] > 0.1)
    # Without care the bend is a difference of rounded numbers, others on each BLAS; the samples alone give 1e-10.
    assert np.all(along_a_bent_valley(careful=False).identifiability.whole.diagonal()[1:] > 1e-3)


def test_what_bounds_leave_of_a_valley_is_no_matter_of_rounding_or_order():
    """One sum of three values shows: whatever rounding leaves of their slopes, and however they are listed."""
    rng, slopes, widths = np.random.default_rng(7), np.array([0.5, 1.0, 0.4]), np.array([0.3, 1.0, 3.0])
    found = []
    for order in itertools.permutations(range(3)):
        listed = list(order)
        for _ in range(5):
            alike = np.outer(slopes[listed], slopes[listed]) * 1e8 * (1.0 + 1e-15 * rng.standard_normal((3, 3)))
            known = identifiability(Curvature(0.5 * (alike + alike.T)), 1.0, widths[listed])
            found.append(np.sqrt(np.diag(known.whole))[np.argsort(listed)])
    assert np.allclose(found, found[0], rtol=1e-6)
    assert found[0] == pytest.approx([0.0866, 0.289, 0.722], rel=0.2)


def test_what_is_no_more_certain_than_its_bounds_is_not_told():
    noise = np.random.default_rng(3).standard_normal(400)

    def residuals(values):
        left: Array = noise + values[0] * 0.05 + values[1]
        return left

    weak, strong = Unknown("weak", "1", 0.1, 0.0, 1.0, 1.0), Unknown("strong", "1", 0.0, -9.0, 9.0, 1.0)
    found = estimate(lambda v: np.concatenate([residuals(v), 50.0 * (v[1:] - 0.0)]), [weak, strong])
    assert found.std[0] == np.inf  # ± 1 by the samples, where its bounds leave ± 0.29
    assert found.std[1] < 0.05


def test_a_step_to_where_the_plant_runs_away_is_taken_back_without_a_word():
    def residuals(values):
        far = np.full(2, 1e200)
        return far if values[0] < -3.0 else np.array([np.arctan(values[0]), 0.0])

    found = estimate(residuals, [Unknown("a", "1", 2.0, -10.0, 10.0, 1.0)])
    assert found.values[0] == pytest.approx(0.0, abs=1e-3)


def test_all_of_something_is_the_natural_end_of_a_share_and_no_other_bound():
    share, ratio = Unknown("share", "1", 0.5, 0.0, 1.0, 1.0), Unknown("ratio", "1", 1.0, 0.3, 3.0, 1.0)
    assert share.at_natural_end(1.0) and share.at_natural_end(0.0) and not share.at_natural_end(0.5)
    assert ratio.at_bound(3.0) and not ratio.at_natural_end(3.0)
