"""Classes from features: probabilities, thresholds, intervals; the EFC population by physics and as the thesis does."""

from itertools import product

import numpy as np
import pytest

from hil.errors import InputError
from hil.identification.papers.classification import (
    by_thresholds,
    learn,
    leave_one_out,
    ordered_thresholds,
)
from hil.identification.papers.efc_condition import (
    FEATURES,
    FREQUENCIES_HZ,
    Instruments,
    ValveTest,
    evaluated_test,
    good_ranges,
    simulated_tests,
)
from hil.identification.papers.efc_condition import tested as run_test
from hil.identification.steady.pressure_curve import pressure_curve
from hil.identification.steady.sweep_estimate import Sweep
from hil.physics.published.efc_population import population, valve
from hil.physics.published.tugsal import CLASSES
from tests.warm import TESTED_HZ

NAMES = ("low", "middle", "high")


def three(rng, count=90, apart=2.0):
    labels = np.arange(count) % 3
    return rng.normal(size=(count, 2)) + apart * labels[:, None] * np.array([1.0, 0.0]), labels


# -- the class model ---------------------------------------------------------------------------------------


def test_probabilities_are_calibrated():
    rng = np.random.default_rng(0)
    features, labels = three(rng, 3000)
    model = learn(features, labels, NAMES)
    fresh, truth = three(rng, 6000)
    shares = model.probabilities(fresh)
    assert shares.sum(axis=1) == pytest.approx(1.0)
    best = shares.max(axis=1)
    right = shares.argmax(axis=1) == truth
    for low, high in ((0.5, 0.7), (0.7, 0.9), (0.9, 1.0)):
        some = (best >= low) & (best < high)
        assert right[some].mean() == pytest.approx(best[some].mean(), abs=0.04)


def test_leaving_out_is_not_seeing():
    rng = np.random.default_rng(1)
    features, labels = rng.normal(size=(60, 2)), np.arange(60) % 3  # nothing to learn
    found = leave_one_out(features, labels, NAMES).argmax(axis=1)
    assert np.mean(found == labels) < 0.5
    seen = learn(features, labels, NAMES).probabilities(features).argmax(axis=1)
    assert np.sum(seen == labels) >= np.sum(found == labels)


def test_a_unit_unlike_any_is_flagged():
    rng = np.random.default_rng(2)
    features, labels = three(rng, 300)
    model = learn(features, labels, NAMES)
    assert model.is_unlike(np.array([[2.0, 8.0]])).all()
    assert model.is_unlike(features).mean() < 0.02


def test_the_scatter_of_worn_units_does_not_excuse_one_far_from_the_good():
    rng = np.random.default_rng(5)
    labels = np.repeat([0, 1], 200)
    features = np.concatenate((0.1 * rng.normal(size=(200, 2)), 5.0 + 3.0 * rng.normal(size=(200, 2))))
    usual = learn(features, labels, ("good", "worn")).usual(np.array([[0.6, 0.0]]))[0]
    assert usual[0] < 1e-6 and usual[1] > 0.01


def test_how_usual_is_the_share_that_lies_farther():
    rng = np.random.default_rng(6)
    shares = [learn(rng.normal(size=(20, 2)), np.zeros(20, dtype=np.int64), ("one",)).usual(rng.normal(size=(50, 2)))
              for _ in range(60)]  # fmt: skip
    assert np.mean(np.array(shares) < 0.1) == pytest.approx(0.1, abs=0.02)


def test_too_few_units_are_refused():
    with pytest.raises(InputError, match="high 1 units"):
        learn(np.zeros((7, 2)), np.array([0, 0, 0, 1, 1, 1, 2]), NAMES)


# -- thresholds --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(6))
def test_thresholds_are_the_best_of_all(seed):
    rng = np.random.default_rng(seed)
    labels = rng.integers(0, 3, size=14)
    values = labels + rng.normal(size=14)
    found = ordered_thresholds(values, labels, 3)
    right = np.count_nonzero(by_thresholds(values, found) == labels)
    cuts = [-np.inf, *(np.sort(values) + 1e-9), np.inf]
    best = max(np.count_nonzero(by_thresholds(values, np.array(pair)) == labels)
               for pair in product(cuts, cuts) if pair[0] <= pair[1])  # fmt: skip
    assert right == best
    assert found[0] <= found[1]


# -- the EFC -----------------------------------------------------------------------------------------------


def test_a_test_finds_what_the_valve_has():
    model = valve("return", friction_a=0.02)
    found = run_test(model, np.random.default_rng(0), Instruments(), FREQUENCIES_HZ)
    assert found.friction_a == pytest.approx(0.02, rel=0.15)
    assert found.leakage_ml_min == pytest.approx(100.0, rel=0.03)
    assert len(found.features) == len(FEATURES)


def test_a_worse_valve_is_slower_without_noise_too():
    silent = Instruments(0.0, 0.0, 0.0, 0.0, 0.0)
    found = run_test(valve("good"), np.random.default_rng(0), silent, FREQUENCIES_HZ)
    worse = run_test(valve("return"), np.random.default_rng(0), silent, FREQUENCIES_HZ)
    assert worse.rise_s > found.rise_s and worse.bandwidth_hz < found.bandwidth_hz


def test_a_pressure_that_stands_has_no_condition():
    still = np.full((3, 1000), 60.0)
    sweep = [Sweep(np.concatenate((np.linspace(0, 2, 4000), np.linspace(2, 0, 4000))), np.full(8000, 60.0), speed)
             for speed in (0.4, 0.2)]  # fmt: skip
    with pytest.raises(InputError, match="less than 10 psi"):
        evaluated_test(pressure_curve("still", sweep), still, 80.0, (6.0, 0.1))


def test_populations_repeat_and_differ():
    one, labels = population(9, 3)
    again, _ = population(9, 3)
    other, _ = population(9, 4)
    assert [m.values for m in one] == [m.values for m in again] != [m.values for m in other]
    assert labels.tolist() == [0, 1, 2] * 3


def test_physics_separates_200_valves():
    tests, labels = simulated_tests(200, 1)
    shares = leave_one_out(np.array([test.features for test in tests]), labels, CLASSES)
    right, sure = shares.argmax(axis=1) == labels, shares.max(axis=1) >= 0.95
    assert right.mean() > 0.9
    assert right[sure].mean() > 0.95 and sure.sum() > 120
    found_s, stated_s = np.array([t.rise_s for t in tests])[labels == 0], good_ranges(TESTED_HZ).by_feature["rise"]
    assert np.mean(found_s > stated_s.high) < 0.08  # one in forty, from 67
    assert [np.count_nonzero(labels == k) for k in range(len(CLASSES))] == [67, 67, 66]


def test_features_are_logarithms_with_a_floor():
    silent = ValveTest(-1e-4, 0.05, 0.0, 6.0)
    assert np.isfinite(silent.features).all()
