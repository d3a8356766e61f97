"""Null bias, lap and saturation of curves by formula; the pressure drop beside a rated flow."""

import math

import numpy as np
import pytest

from hil.identification.steady.null import null_of
from hil.identification.steady.sweep_estimate import Sweep, sweep_estimate
from hil.record.measurement import Measured, Measurement
from hil.record.recording import Channel, Recording
from hil.signals.ramps import triangle
from procedures._characteristic import _lap_class
from procedures._pressure_drop import pressure_drops

RATE_HZ, LAG_S, NOISE = 100.0, 0.1, 0.3


def flow_of(command, edges, limit=math.inf, full=70.0):
    """Straight sides that begin at their edges: below these an underlap where they cross over."""
    at = np.clip(command, -limit, limit)
    below, above = edges
    return full / 100.0 * (np.maximum(at - above, 0.0) - np.maximum(below - at, 0.0))


def null(edges, seed=0, limit=math.inf, sign=1.0, draws=24):
    sweeps = []
    for cycle_s in (40.0, 80.0):
        command = triangle(-100.0, 100.0, cycle_s, RATE_HZ, start=-100.0)
        late = np.interp(np.arange(len(command)) / RATE_HZ - LAG_S, np.arange(len(command)) / RATE_HZ, command)
        noise = NOISE * np.random.default_rng([seed, int(cycle_s)]).normal(size=len(command))
        sweeps.append(Sweep(command, sign * flow_of(late, edges, limit) + noise, 400.0 / cycle_s))
    ends = sign * flow_of(np.array([-100.0, 100.0]), edges, limit)
    return null_of(sweep_estimate("sweep", sweeps, draws=draws), *ends)


def near(found, truth):
    assert abs(found[0] - truth) < 4.0 * found[1], (found, truth)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("edges", [(-18.0, 20.0), (0.5, 2.5), (3.0, -1.0)])
def test_null_and_lap_are_those_of_the_edges(edges, sign):
    found = null(edges, sign=sign)
    near(found.centre, sum(edges) / 2.0)
    near(found.lap, edges[1] - edges[0])
    assert found.lap[1] < 0.2
    assert found.slopes == pytest.approx((0.7 * sign, 0.7 * sign), rel=0.01)
    assert [math.isinf(value) for value, _ in found.saturated] == [True, True]


def test_intervals_of_null_and_lap_hold_the_truth_as_often_as_they_state():
    found = [null((-4.0, 6.0), seed) for seed in range(16)]
    held = [abs(one.centre[0] - 1.0) <= 2.0 * one.centre[1] for one in found]
    held += [abs(one.lap[0] - 10.0) <= 2.0 * one.lap[1] for one in found]
    assert sum(held) >= 26  # 32 at 95 %: fewer by chance in 1 of 1000
    assert np.std([one.centre[0] for one in found]) > 0.3 * np.mean([one.centre[1] for one in found])


def test_what_two_branches_keep_apart_is_no_noise_of_the_null():
    """A sweep of one speed whose branches no shift brings together; its mean curve is the straight sides."""
    command = triangle(-100.0, 100.0, 40.0, RATE_HZ, start=-100.0)
    apart = 2.0 * np.sign(np.gradient(command)) * np.sin(np.pi * command / 100.0)
    ends = flow_of(np.array([-100.0, 100.0]), (-4.0, 6.0))
    found = []
    for seed in range(12):
        noise = NOISE * np.random.default_rng(seed).normal(size=len(command))
        sweep = Sweep(command, flow_of(command, (-4.0, 6.0)) + apart + noise, 10.0)
        found.append(null_of(sweep_estimate("sweep", [sweep], draws=24), *ends).centre)
    assert sum(abs(value - 1.0) <= 2.0 * std for value, std in found) >= 10
    assert np.median([std for _, std in found]) < 3.0 * np.std([value for value, _ in found])


def test_a_curve_saturates_where_its_command_is_limited():
    found = null((-5.0, 5.0), limit=80.0)
    for (value, std), truth in zip(found.saturated, (-80.0, 80.0), strict=True):
        assert abs(value - truth) < 3.0 * std < 6.0


def test_a_response_that_does_not_pass_zero_has_no_null():
    assert null_of(sweep_estimate("s", [one_way()], draws=8), 10.0, 30.0) is None


def one_way():
    command = triangle(-100.0, 100.0, 40.0, RATE_HZ, start=-100.0)
    return Sweep(command, 20.0 + 0.1 * command, 10.0)


@pytest.mark.parametrize(
    ("lap", "dead", "text"),
    [
        (10.0, True, "Lap class: overlapped."),
        (-4.0, False, "Lap class: underlapped."),
        (0.1, False, "Lap class: zero lap within its uncertainty."),
        (10.0, False, "Lap class: none."),
        (-4.0, True, "Lap class: none."),
    ],
)
def test_a_lap_class_needs_the_lines_and_the_dead_band_to_agree(lap, dead, text):
    edge = Measured("dead_band_positive", 5.0, "%", 0.1, relation="=" if dead else "<")
    assert _lap_class(Measured("lap", lap, "%", 0.1), [edge]).startswith(text)


def test_a_lap_has_no_class_where_the_dead_band_is_unknown():
    edge = Measured("dead_band_positive", None, "%")
    assert _lap_class(Measured("lap", 10.0, "%", 0.1), [edge]) == ""


def test_the_pressure_drop_of_a_rated_flow_is_supply_less_return_less_load():
    command = np.concatenate((np.full(100, -100.0), np.linspace(-100.0, 100.0, 200), np.full(100, 100.0)))
    time_s = np.arange(len(command)) / RATE_HZ
    noise = np.random.default_rng(3).normal(size=(3, len(command)))
    upper = command > 0.0
    supply, back = np.where(upper, 68.0, 70.0) + 0.2 * noise[0], np.where(upper, 300.0, 200.0) + 10.0 * noise[1]
    channels = [
        Channel("command", "%", command), Channel("flow", "l/min", 0.7 * command),
        Channel("supply pressure", "bar", supply, calibration={"uncertainty": 1.0}),
        Channel("return pressure", "kPa", back, calibration={"uncertainty": 100.0}),
        Channel("load pressure", "bar", np.where(upper, 5.0, -4.0) + 0.1 * noise[2]),
    ]  # fmt: skip
    meta = {"roles": {"command": "command", "response": "flow"}}
    whole = Recording("run", time_s, {one.name: one for one in channels}, meta)
    of = {name: Measurement(name, "bar", name) for name in ("pressure_drop_low", "pressure_drop_high")}
    low, high = pressure_drops(whole, [{"first": 0, "count": len(command)}], of)
    assert (low.name, high.name) == ("pressure_drop_low", "pressure_drop_high")
    assert low.value == pytest.approx(64.0, abs=0.15)
    assert high.value == pytest.approx(60.0, abs=0.15)
    assert high.calibration_std == pytest.approx(math.hypot(0.5, 0.5))
    assert 0.01 < high.repeatability < 0.1
    alone = Recording("run", time_s, {one.name: one for one in channels[:3]}, meta)
    assert pressure_drops(alone, [{"first": 0, "count": len(command)}], of) == []
