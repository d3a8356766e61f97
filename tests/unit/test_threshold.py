"""Thresholds of motions by formula: onward, after reversal, beneath the noise, beyond the reach, beside drift."""

import math

import numpy as np
import pytest

from hil.errors import SettingError
from hil.record.recording import Channel, Recording
from hil.session.procedure import load_procedure
from hil.session.setting import parse_settings
from procedures.threshold import evaluate

RATE_HZ, GAIN, NOISE, WAIT = 100.0, 0.9, 0.1, 200
REACH, SPEED, FULL = 3.0, 0.2, 100.0
LABEL = "+50 %"


def recorded(play=0.0, lag_s=0.0, seed=0, noise=NOISE, drift_per_s=0.0, gain=GAIN, repeats=2, speed=SPEED):
    """A spool that follows its command with play: it goes on at once after a stop, and rests for `play` at reversal."""
    ways = [(0, 1, "onward"), (1, 0, "reversal"), (0, -1, "onward"), (-1, 0, "reversal")] * repeats
    pieces, parts, first = [], [], 0
    for start, end, way in [(-1, 0, "approach"), *ways, (0, 0, "end")]:
        slope = np.linspace(start, end, round(REACH / speed * RATE_HZ) + 1)[1:] if start != end else np.empty(0)
        pieces.append(50.0 + REACH * np.concatenate((np.full(WAIT, start), slope)))
        parts.append({"kind": "threshold", "way": way, "from": start, "to": end, "waited": WAIT, "bias": 50.0,
                      "full": FULL, "label": LABEL, "first": first, "count": len(pieces[-1])})  # fmt: skip
        first += len(pieces[-1])
    command = np.concatenate(pieces)
    time_s = np.arange(len(command)) / RATE_HZ
    spool = np.empty_like(command)
    at = command[0] - play / 2.0
    for i, given in enumerate(command):
        at = min(max(at, given - play / 2.0), given + play / 2.0)
        spool[i] = at
    late = np.interp(time_s - lag_s, time_s, spool)
    flow = gain * late + drift_per_s * time_s + noise * np.random.default_rng(seed).normal(size=len(time_s))
    channels = {"command": Channel("command", "%", command), "flow": Channel("flow", "l/min", flow)}
    meta = {"roles": {"command": "command", "response": "flow"}, "parts": parts, "conditions": {}}
    return Recording("run", time_s, channels, meta)


def thresholds(**given):
    found = {m.name.partition(LABEL)[0] + m.name.partition(LABEL)[2]: m for m in evaluate(recorded(**given)).measured}
    return found["threshold_onward, "], found["threshold_reversal, "], found["counted_change, , reversal"].value


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_play_shows_after_reversal_and_not_after_a_stop(sign):
    onward, reversal, counted = thresholds(play=0.8, lag_s=0.15, gain=sign * GAIN)
    assert (onward.relation, reversal.relation) == ("<", "=")
    assert onward.value < 0.3
    assert abs(reversal.value - 0.8 - counted / GAIN) < 3.0 * reversal.std
    assert reversal.std < 0.05


def test_intervals_hold_the_truth_as_often_as_they_state():
    held = []
    for seed in range(24):
        _, reversal, counted = thresholds(play=0.6, seed=seed)
        assert reversal.relation == "="
        held.append(abs(reversal.value - 0.6 - counted / GAIN) <= 2.0 * reversal.std)
    assert sum(held) >= 19  # at 95 %: fewer by chance in 1 of 1000


def test_a_valve_without_friction_has_a_bound_on_both():
    for seed in range(6):
        onward, reversal, counted = thresholds(seed=seed)
        assert (onward.relation, reversal.relation) == ("<", "<")
        assert counted / GAIN < min(onward.value, reversal.value) < 0.3


def test_what_does_not_move_within_the_reach_is_beyond_it():
    _, reversal, _ = thresholds(play=2.0 * REACH / 2.0 + 0.2)
    assert (reversal.relation, reversal.value) == (">", REACH)


def test_a_reading_that_drifts_is_no_motion():
    _, still, _ = thresholds(drift_per_s=0.02)
    _, moved, counted = thresholds(play=0.8, drift_per_s=0.02)
    assert still.relation == "<"
    assert abs(moved.value - 0.8 - counted / GAIN) < 3.0 * moved.std


def test_a_response_that_does_not_follow_has_no_threshold():
    findings = evaluate(recorded(gain=0.0))
    assert {m.name: m.value for m in findings.measured} == {
        f"threshold_onward, {LABEL}": None, f"threshold_reversal, {LABEL}": None
    }  # fmt: skip


def test_more_noise_counts_larger_changes():
    assert thresholds(noise=0.5)[2] > 2.0 * thresholds(noise=0.05)[2] > 0.0


def test_the_averaged_motion_is_a_curve():
    (onward, reversal) = evaluate(recorded(play=0.8)).curves["threshold"]
    assert (onward["label"], reversal["label"]) == (f"{LABEL}, onward", f"{LABEL}, reversal")
    assert np.interp(2.0, reversal["command"], reversal["measured"]) == pytest.approx(GAIN * 1.2, abs=0.05)
    assert math.isclose(np.interp(2.0, onward["command"], onward["measured"]), GAIN * 2.0, abs_tol=0.05)


@pytest.mark.parametrize(("setting", "value"), [("speed", "1.5"), ("speed", "0"), ("reach", "0"), ("repeats", "1")])
def test_settings_out_of_range_are_refused_by_name(setting, value):
    with pytest.raises(SettingError, match=setting):
        parse_settings(load_procedure("threshold").settings, {setting: value})
