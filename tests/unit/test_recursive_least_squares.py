"""Recursive least squares: against the batch solution, its uncertainty, forgetting, and commands that stand still."""

import numpy as np
import pytest

from hil.errors import InputError
from hil.identification.papers.recursive_least_squares import ArxForm, RecursiveLeastSquares, excitation_order
from hil.signals.recursion import filtered

A, B = np.array([1.0, -1.5, 0.7]), np.array([0.5, 0.2])
TRUE = np.array([*A[1:], *B])
FORM = ArxForm(2, 2)


def driven(command, rng, noise=0.05):
    """An ARX system: the noise passes 1/A."""
    return filtered(B, A, command) + filtered([1.0], A, noise * rng.normal(size=len(command)))


def binary(rng, samples):
    return np.sign(rng.normal(size=samples))


def regressors(command, output):
    y, u = np.concatenate((np.zeros(2), output)), np.concatenate((np.zeros(2), command))
    return np.column_stack((-y[1:-1], -y[:-2], u[2:], u[1:-1]))


@pytest.mark.parametrize("memory", [1.0, 0.97])
def test_same_as_weighted_batch_least_squares(memory):
    rng = np.random.default_rng(0)
    u = binary(rng, 400)
    y = driven(u, rng)
    online = RecursiveLeastSquares(FORM, memory=memory, forgetting="exponential", prior_std=1e5)
    online.run(u, y)
    weight = np.sqrt(memory ** np.arange(399, -1, -1.0))
    batch = np.linalg.lstsq(weight[:, None] * regressors(u, y), weight * y, rcond=None)[0]
    assert online.parameters == pytest.approx(batch, rel=1e-6)


def test_sample_by_sample_is_the_same_as_in_blocks():
    rng = np.random.default_rng(1)
    u = binary(rng, 60)
    y = driven(u, rng)
    whole, single = RecursiveLeastSquares(FORM, 0.98), RecursiveLeastSquares(FORM, 0.98)
    path = whole.run(u, y)
    one_by_one = [single.run(u[k : k + 1], y[k : k + 1])[0] for k in range(len(u))]
    assert np.array_equal(path, one_by_one) and np.array_equal(whole.std, single.std)


@pytest.mark.parametrize(("memory", "forgetting"), [(1.0, "exponential"), (0.98, "exponential"), (0.98, "directional")])
def test_uncertainty_is_the_spread(memory, forgetting):
    rng = np.random.default_rng(2)
    scores, noise = [], []
    for _ in range(80):
        u = binary(rng, 400)
        made = RecursiveLeastSquares(FORM, memory, forgetting)
        made.run(u, driven(u, rng))
        scores.append((made.parameters - TRUE) / made.std)
        noise.append(made.noise_std)
    assert np.std(scores, axis=0) == pytest.approx(1.0, abs=0.2)
    assert np.mean(noise) == pytest.approx(0.05, rel=0.1)


@pytest.mark.parametrize("forgetting", ["exponential", "directional"])
def test_a_change_of_the_valve_is_followed(forgetting):
    rng = np.random.default_rng(3)
    u = binary(rng, 1800)
    y = np.concatenate((driven(u[:1000], rng, 0.01), filtered([1.0], [1.0, -0.5], u[1000:])))
    made = RecursiveLeastSquares(ArxForm(1, 1), 0.98, forgetting)
    made.run(u[:1000], y[:1000])
    assert made.parameters[1] == pytest.approx(0.5, abs=0.1)
    made.run(u[1000:], y[1000:])
    assert made.parameters == pytest.approx([-0.5, 1.0], abs=0.01)


def test_a_command_that_stands_still_blows_up_only_exponential_forgetting():
    still, size = {}, {}
    for forgetting in ("exponential", "directional"):
        rng = np.random.default_rng(4)
        u = np.concatenate((binary(rng, 500), np.ones(3000)))
        made = RecursiveLeastSquares(FORM, 0.98, forgetting)
        made.run(u, driven(u, rng, 0.001))
        still[forgetting] = np.abs(made.parameters - TRUE).max()
        size[forgetting] = made.gain_matrix.max()
    assert still["directional"] < 0.05
    assert size["exponential"] > 1e3 * size["directional"]


def test_differences_remove_an_offset():
    rng = np.random.default_rng(5)
    u = binary(rng, 400)
    y = filtered(B, A, u) + 7.0
    found = {}
    for difference in (False, True):
        made = RecursiveLeastSquares(ArxForm(2, 2, difference=difference), 0.95, "exponential")
        made.run(u, y)
        found[difference] = np.abs(made.parameters - TRUE).max()
    assert found[True] < 0.05 < found[False]


def test_delay_moves_the_input():
    rng = np.random.default_rng(6)
    u = binary(rng, 400)
    late = np.concatenate((np.zeros(3), u[:-3]))
    made = RecursiveLeastSquares(ArxForm(2, 2, delay=3))
    made.run(u, filtered(B, A, late))
    assert made.parameters == pytest.approx(TRUE, abs=1e-3)
    assert made.numerator == pytest.approx([0, 0, 0, *B], abs=1e-3)
    assert np.abs(made.poles) == pytest.approx([0.7**0.5] * 2, abs=1e-3)


def test_what_was_not_told_is_named():
    made = RecursiveLeastSquares(FORM, prior_std=10.0)
    assert made.excitation.unknown == ("a1", "a2", "b0", "b1") and not made.excitation.enough
    made.run(np.zeros(100), np.zeros(100))
    assert made.excitation.informed == 0
    rng = np.random.default_rng(7)
    u = binary(rng, 500)
    made.run(u, driven(u, rng))
    assert made.excitation.enough and made.excitation.unknown == ()


T = np.arange(1000)


@pytest.mark.parametrize(
    ("command", "order"),
    [
        (np.zeros(1000), 0),
        (np.ones(1000), 1),
        (np.sin(0.3 * T), 2),
        (5.0 + np.sin(0.3 * T), 3),
        (np.sin(0.3 * T) + np.sin(0.7 * T), 4),
        (np.random.default_rng(0).normal(size=1000), 8),
    ],
)
def test_excitation_order(command, order):
    assert excitation_order(command, 8) == order


def test_excitation_order_of_changes_leaves_out_the_constant():
    assert excitation_order(5.0 + np.sin(0.3 * T), 8, difference=True) == 2


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: ArxForm(2, 0), "at least one input"),
        (lambda: ArxForm(2, 1, -1), "may not be negative"),
        (lambda: RecursiveLeastSquares(FORM, memory=1.1), "memory 1.1"),
        (lambda: RecursiveLeastSquares(FORM, memory=0.0), "memory 0"),
        (lambda: RecursiveLeastSquares(FORM, prior_std=0.0), "prior_std 0"),
        (lambda: excitation_order(np.ones(10), 8), "10 samples"),
    ],
)
def test_bad_input(make, says):
    with pytest.raises(InputError, match=says):
        make()
