import math

import numpy as np
import pytest

from hil.errors import InputError
from hil.identification.steady.characteristic import Side, largest_slope, loop, side, worst_departure
from hil.identification.steady.flow_curve import polynomial, spline
from hil.identification.steady.sweep_estimate import Sweep, sweep_estimate
from hil.identification.uncertainty.parametric_bootstrap import DRAWS
from hil.record.measurement import Measurement
from hil.signals.ramps import triangle
from hil.signals.rounding import rounding_of_means
from procedures._statistics import at_most_one

RATE_HZ = 100.0


def metered(command, positive=20.0, negative=-18.0, exponent=1.2, full=70.0):
    up = np.maximum(command - positive, 0) / (100 - positive)
    down = np.maximum(negative - command, 0) / (100 + negative)
    return full * (up**exponent - down**exponent)


def sweep(cycle_s=80.0, lag_s=0.0, noise=0.3, play=0.0, seed=0, lame=1.0, **curve):
    command = triangle(-100.0, 100.0, cycle_s, RATE_HZ, start=-100.0)
    time_s = np.arange(len(command)) / RATE_HZ
    shifted = np.interp(time_s - lag_s, time_s, command)
    flow = metered(shifted - play * np.sign(np.gradient(shifted)), **curve)
    flow = np.where(flow > 0, flow, lame * flow) + 0.1
    flow += noise * np.random.default_rng([seed, round(cycle_s)]).normal(size=len(command))
    return Sweep(command, flow, 400.0 / cycle_s)


def estimate(draws=DRAWS, **given):
    return sweep_estimate("sweep", [sweep(**given), sweep(cycle_s=160.0, **given)], draws=draws)


def sides(found, lame=1.0, end_std=0.0):
    zero, ends = (0.1, 0.0), ((70.1, end_std), (0.1 - 70.0 * lame, end_std))
    return side(found, 0.0, zero, ends[0], 1), side(found, 0.0, zero, ends[1], -1)


def test_figures_of_a_known_curve_lie_within_their_uncertainty():
    above, below = sides(estimate())
    for (value, std), truth in ((above.edge, 20.0), (below.edge, -18.0)):
        assert value == pytest.approx(truth, abs=4 * std)
        assert std < 0.3
    command = np.linspace(20.0, 100.0, 20001)
    share = metered(command) / 70.0
    body = (share >= 0.3) & (share <= 0.9)
    gain, level = np.polyfit(command[body], metered(command[body]), 1)
    departure = np.max(np.abs(metered(command[body]) - gain * command[body] - level)) / 70.0
    assert above.gain[0] == pytest.approx(gain, abs=4 * above.gain[1])
    assert above.departure[0] == pytest.approx(departure, abs=4 * above.departure[1])
    assert above.gain[1] < 0.002


def test_the_gain_of_a_curve_that_bends_is_that_of_all_commands_between():
    value, _ = sides(estimate(noise=0.003))[0].gain
    command = np.linspace(20.0, 100.0, 20001)
    body = (metered(command) >= 0.3 * 70.0) & (metered(command) <= 0.9 * 70.0)
    truth = np.polyfit(command[body], metered(command[body]), 1)[0]
    assert abs(value - truth) < 1.5e-5  # at 200 places alike, both ends weigh too much: 3.4e-5


def test_an_end_that_is_not_known_makes_the_gain_of_a_curve_that_bends_uncertain():
    found = estimate(exponent=1.8, noise=0.003)
    (gain, sure), (_, unsure) = sides(found)[0].gain, sides(found, end_std=2.0)[0].gain
    end = side(found, 0.0, (0.1, 0.0), (72.1, 0.0), 1).gain[0]
    assert unsure == pytest.approx(abs(end - gain), rel=0.1)
    assert unsure > 5.0 * sure
    assert sides(estimate(exponent=1.0), end_std=2.0)[0].gain[1] < 0.004  # a straight line has one slope


def test_equal_gains_are_told_as_a_bound_and_unequal_ones_as_their_ratio():
    what = Measurement("symmetry", "", "")
    near = [at_most_one(what, 1.0 - abs(off), 1e-3) for off in np.random.default_rng(0).normal(size=200) * 1e-3]
    assert all(found.relation == ">" and found.value is not None and found.value <= 1.0 - 2e-3 for found in near)
    far = at_most_one(what, 0.95, 1e-3)
    assert (far.relation, far.value, far.std) == ("=", 0.95, 1e-3)


def test_the_worse_of_two_sides_is_no_surer_than_either():
    rng = np.random.default_rng(0)
    each = [Side((0.0, 1.0), (1.0, 1.0), (v, 0.1), v + 0.1 * rng.normal(size=64)) for v in (1.0, 1.02)]
    value, std = worst_departure(each)
    assert value == 1.02
    assert std >= 0.1  # the worse of both redrawn scatters by 0.08
    apart = [each[0], Side((0.0, 1.0), (1.0, 1.0), (2.0, 0.1), 2.1 + 0.1 * rng.normal(size=64))]
    assert worst_departure(apart)[1] > 0.2  # what redrawn curves are off by counts twice


@pytest.mark.parametrize("lead", [0.0, 1.0, 2.0, 8.0])
def test_a_side_that_is_clearly_the_lesser_takes_no_part_in_the_uncertainty_of_the_worse(lead):
    rng, held, stds = np.random.default_rng(1), 0, []
    for _ in range(600):
        drawn = ((lead, 1.0), (0.0, 2.0))  # the lesser side is twice as uncertain
        found = [(true + std * rng.normal(), std) for true, std in drawn]
        each = [Side((0.0, 1.0), (1.0, 1.0), one, one[0] + one[1] * rng.normal(size=64)) for one in found]
        value, std = worst_departure(each)
        held += abs(value - lead) <= 1.96 * std
        stds.append(std)
    assert 0.93 <= held / 600 <= 0.985
    assert lead < 8.0 or np.mean(stds) < 1.1


def test_edges_are_as_uncertain_as_they_scatter():
    edges = [sides(estimate(noise=1.0, seed=s))[0].edge for s in range(12)]
    assert np.mean([std for _, std in edges]) == pytest.approx(np.std([value for value, _ in edges]), rel=0.6)


@pytest.mark.parametrize(("play", "lag_s"), [(0.0, 0.0), (2.0, 0.0), (0.0, 0.2), (2.0, 0.2)])
def test_hysteresis_is_the_width_along_the_command_and_lag_is_not_taken_for_it(play, lag_s):
    between = loop(estimate(play=play, lag_s=lag_s), 4.0, (5.0, 2.5))
    assert between.lag[0] == pytest.approx(lag_s, abs=4 * between.lag[1])
    assert between.is_friction == (play > 0.0)
    if play:
        assert between.width[0] == pytest.approx(2.0 * play, abs=4 * between.width[1])
    else:
        assert between.width[0] < 4.0 * between.width[1]


def test_one_speed_tells_no_lag():
    between = loop(sweep_estimate("sweep", [sweep()]), 4.0, (5.0,))
    assert (between.lag, between.width) == (None, None)


def test_asymmetry_and_curvature_show():
    above, below = sides(estimate(lame=0.8), lame=0.8)
    assert below.gain[0] / above.gain[0] == pytest.approx(0.8 * 80 / 82, abs=0.01)
    curved, straight = (sides(estimate(exponent=exponent))[0].departure[0] for exponent in (1.8, 1.0))
    assert curved > 3 * straight


def test_the_ninth_order_polynomial_ripples_in_the_dead_band_and_the_spline_does_not():
    command = np.linspace(-100, 100, 201)
    flow = np.sign(command) * np.maximum(np.abs(command) - 20, 0) * 70 / 80
    inside = np.linspace(-19, 19, 381)
    ninth, monotone = polynomial(command, flow), spline(command, flow)
    assert np.ptp(ninth(inside)) == pytest.approx(3.80, abs=0.01)  # l/min, where there is no flow
    slope = np.diff(ninth(np.linspace(-100, 100, 4001)))
    assert np.any(slope < 0)  # more command, less flow
    assert np.max(np.abs(monotone(inside))) == 0.0
    assert np.all(np.diff(monotone(np.linspace(-100, 100, 4001))) >= 0)
    assert np.max(np.abs(monotone(command) - flow)) < 1e-12
    assert np.max(np.abs(ninth(command) - flow)) > 1.0


def test_a_spline_of_a_curve_that_is_all_but_flat_warns_nobody():
    made = spline(np.arange(5.0), np.array([0.0, 1e-310, 2e-310, 1.0, 2.0]))
    assert made(1.5) == pytest.approx(0.0, abs=1e-300)
    assert made(3.0) == 1.0


def test_what_is_no_sweep_is_said():
    one = np.ones(4000)
    with pytest.raises(InputError, match="does not move"):
        sweep_estimate("r", [Sweep(one, one, 1.0)])
    up = np.linspace(-100, 100, 4000)
    with pytest.raises(InputError, match="both up and down"):
        sweep_estimate("r", [Sweep(up, up, 5.0)])
    dead = triangle(-10.0, 10.0, 40.0, RATE_HZ)
    noise = 1e-3 * np.random.default_rng(0).normal(size=len(dead))
    with pytest.raises(InputError, match="no flow beyond the noise"):
        side(sweep_estimate("r", [Sweep(dead, noise, 1.0)]), 0.0, (0.0, 0.0), (1e-4, 0.0), 1)


def test_what_a_slow_lag_takes_from_the_steepest_slope_is_granted():
    def swept(cycle_s, noise):
        command = triangle(0.0, 2.0, cycle_s, RATE_HZ)
        keep, late, state = np.exp(-1.0 / RATE_HZ / 0.1), np.empty_like(command), 0.0
        for i, given in enumerate(command):
            state = keep * state + (1.0 - keep) * given
            late[i] = state
        pressure = 200.0 / (1.0 + np.exp(-(late - 1.0) / 0.1))
        return Sweep(command, pressure + noise * np.random.default_rng(1).normal(size=len(command)), 4.0 / cycle_s)

    for noise in (0.02, 0.5):
        sweeps = [swept(10.0, noise), swept(20.0, noise)]
        (slope, std), at = largest_slope(sweep_estimate("sweep", sweeps), [s.speed_per_s for s in sweeps])
        assert slope == pytest.approx(200.0 / 4.0 / 0.1, abs=2.0 * std)
        assert at == pytest.approx(1.0, abs=0.05)
        assert std < 8.0


def test_half_widths_are_as_uncertain_as_the_slopes_and_the_noise_make_them():
    found = estimate(lag_s=0.2, draws=1000)
    points = found.points
    slopes = np.interp(points.command, found.command, found.slope)
    for number, stated in enumerate(np.std(found.resampled_half_widths, axis=0)):
        mine = (points.sweep == number) & points.both
        closed = 0.3 / math.sqrt(float(np.sum(slopes[mine] ** 2 * points.count[mine])))
        assert stated == pytest.approx(closed, rel=0.12)


def test_rounding_of_means_is_that_of_readings_that_move_on_evenly():
    values, passed, step = np.array([0.13, 0.4, 0.91]), np.array([0.0, 0.07, 0.33]), 0.2
    each = [np.linspace(v - p / 2.0, v + p / 2.0, 20_001) for v, p in zip(values, passed, strict=True)]
    rounded = [np.mean((np.rint(one / step + 0.3) - 0.3) * step) for one in each]
    assert values + rounding_of_means(values, passed, step, 0.0, 0.3) == pytest.approx(rounded, abs=1e-3)
    assert not rounding_of_means(values, passed, step, 0.21, 0.3).any()
