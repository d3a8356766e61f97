"""Load steps of responses by formula: one that goes elsewhere, one that overshoots, one that comes back, none."""

import math

import numpy as np
import pytest

from hil.record.recording import Channel, Recording
from procedures.load_step import KIND, evaluate

RATE_HZ, HELD, REPEATS, LABEL = 1000.0, 300, 5, "+50 %, load 100 → 0 %"
SETTLED = math.log(20.0)  # time constants until 5 % of a first order are left


def answered(answer, seed=0, channel="flow", known=0.0, rate_hz=RATE_HZ):
    """20 l/min, and from there `answer` over the time since each step; findings by name."""
    rng, count = np.random.default_rng(seed), 2 * HELD
    once = np.concatenate((np.full(HELD, 20.0), 20.0 + answer(np.arange(HELD) / rate_hz)))
    load = np.repeat([3.0, 60.0], HELD)

    def read(name, unit, values, noise, known=0.0):
        samples = np.tile(values, REPEATS)
        calibration = {"uncertainty": known} if known else {}
        return Channel(name, unit, samples + noise * rng.normal(size=len(samples)), calibration=calibration)

    channels = {
        "command": read("command", "%", np.full(count, 50.0), 0.0),
        "flow": read("flow", "l/min", once if channel == "flow" else np.full(count, 20.0), 0.05, known),
        "spool position": read("spool position", "%", once if channel != "flow" else np.full(count, 50.0), 0.05),
        "load pressure": read("load pressure", "bar", load, 0.2),
    }
    parts = [{"kind": KIND, "label": LABEL, "held": HELD, "first": k * count, "count": count} for k in range(REPEATS)]
    meta = {"roles": {"command": "command", "response": "flow"}, "parts": parts, "conditions": {},
            "settings": {"band": 5.0}}  # fmt: skip
    findings = evaluate(Recording("run", np.arange(count * REPEATS) / rate_hz, channels, meta))
    return findings, {one.quantity: one for one in findings.measured}


def holds(measured, truth, most_std):
    assert measured.relation == "="
    assert measured.value == pytest.approx(truth, abs=3.0 * measured.repeatability)
    assert measured.repeatability < most_std


@pytest.mark.parametrize("change", [-8.0, 8.0])
def test_a_response_that_goes_elsewhere_departs_by_its_change_and_settles_as_a_first_order_does(change):
    for seed in range(3):
        _, one = answered(lambda at_s: change * -np.expm1(-at_s / 0.03), seed)
        holds(one["load_deviation"], 8.0, 0.02)
        holds(one["load_settling"], 30.0 * SETTLED, 1.0)
        holds(one["load_step"], 57.0, 0.03)
        assert one["load_settling"].unit == "ms"


def test_a_response_that_overshoots_departs_by_more_than_its_change():
    def ringing(at_s):  # damping ratio 0.5, 10 ms between crossings of the final value
        return 8.0 * (1.0 - np.exp(-at_s / 0.01) * np.cos(at_s / 0.01))

    dense_s = np.linspace(0.0, 0.3, 300_001)
    away = np.abs(ringing(dense_s) - 8.0) > 0.05 * ringing(dense_s).max()
    for seed in range(3):
        _, one = answered(ringing, seed)
        holds(one["load_deviation"], ringing(dense_s).max(), 0.05)
        holds(one["load_settling"], 1e3 * dense_s[np.flatnonzero(away)[-1]], 1.5)


@pytest.mark.parametrize(("channel", "prefix"), [("flow", "load"), ("spool position", "spool")])
def test_what_comes_back_departs_for_a_while_and_settles_where_it_was(channel, prefix):
    def dip(at_s):
        return -2.0 * at_s / 0.02 * np.exp(1.0 - at_s / 0.02)

    for seed in range(3):
        _, one = answered(dip, seed, channel)
        holds(one[f"{prefix}_deviation"], 2.0, 0.03)
        holds(one[f"{prefix}_settling"], 20.0 * 5.744, 4.0)  # x · e^(1 − x) = 0.05 at x = 5.744


@pytest.mark.parametrize("interval_s", [0.01, 0.02, 0.05])
def test_a_response_that_settles_between_two_samples_has_that_in_its_uncertainty(interval_s):
    for seed in range(3):
        _, one = answered(lambda at_s: -8.0 * -np.expm1(-at_s / 0.006), seed, rate_hz=1.0 / interval_s)
        found = one["load_settling"]
        most = found.value + 2.0 * found.std
        assert 6.0 * SETTLED <= most <= 4e3 * interval_s
        if interval_s < 0.02:
            assert found.value - 2.0 * found.std <= 6.0 * SETTLED
        else:
            assert found.relation == "<"  # two samples tell no time


def test_a_peak_between_two_samples_has_that_in_its_uncertainty():
    def dip(at_s):
        return -2.0 * at_s / 0.02 * np.exp(1.0 - at_s / 0.02)

    for seed in range(3):
        found = answered(dip, seed, rate_hz=1.0 / 0.05)[1]["load_deviation"]
        assert 2.0 <= found.value + 2.0 * found.std <= 6.0


def test_a_peak_that_noise_may_hide_has_that_in_its_uncertainty():
    def peak(at_s):
        return -0.5 * np.expm1(-at_s / 0.04) + 0.06 * np.exp(-(((at_s - 0.13) / 0.045) ** 2))

    truth = peak(np.linspace(0.0, 1.0, 10_001)).max()
    found = [answered(peak, seed, rate_hz=20.0)[1]["load_deviation"] for seed in range(20)]
    assert sum(abs(one.value - truth) <= 2.0 * one.std for one in found) >= 18
    assert max(one.std for one in found) < 0.04


def test_what_the_load_does_not_move_has_a_bound_and_nothing_to_settle():
    for seed in range(5):
        _, one = answered(lambda at_s: 0.0 * at_s, seed)
        assert (one["load_deviation"].relation, one["load_settling"].value) == ("<", None)
        assert 0.0 < one["load_deviation"].value < 0.15


def test_the_meters_calibration_is_in_the_departure_and_not_in_the_time():
    findings, one = answered(lambda at_s: -20.0 * -np.expm1(-at_s / 0.03), known=0.4)
    assert one["load_deviation"].std == pytest.approx(0.2, rel=0.05)  # of 20 l/min, half of 0.4 at the largest reading
    assert one["load_settling"].std == one["load_settling"].repeatability
    (curve,) = findings.curves["load_step"]
    assert (curve["before"], curve["final"]) == (pytest.approx(20.0, abs=0.02), pytest.approx(0.0, abs=0.03))
