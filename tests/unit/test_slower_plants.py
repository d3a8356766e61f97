"""What is slower than a valve has effects whose times are longer by as much."""

from __future__ import annotations

import math

from hil.physics.compose import effect
from hil.physics.effect import Seen
from hil.physics.plant import Hook

VALVE = Hook("sensor", "sensor", "1", 3.0)
CRANE = Hook("sensor", "sensor", "1", 3.0, slower=20.0)
SEEN = Seen(-2.0, 3.0, 2.0, (0.5, 2.0, 4.0), ((0.04, 0.3, 0.5),), 500.0, 1.0)


def parameters(name: str, hook: Hook):
    return {p.name: p for p in effect(name).parameters_at(hook)}


def test_times_grow_and_rates_fall():
    for name, parameter, factor in (
        ("dead_time", "delay", 20.0),
        ("resonance", "period", 20.0),
        ("resonance", "damping", 1.0),
        ("periodic_disturbance", "frequency", 1 / 20.0),
        ("rate_limit", "rate", 1 / 20.0),
        ("friction", "stribeck", 1 / 20.0),
        ("saturation", "limit", 1.0),
    ):
        in_a_valve, slower = parameters(name, VALVE)[parameter], parameters(name, CRANE)[parameter]
        for bound in ("low", "typical", "high"):
            assert math.isclose(getattr(slower, bound), factor * getattr(in_a_valve, bound))


def test_a_dead_time_of_some_samples_is_within_reach():
    starts = [start["delay"] for start in effect("dead_time").starts_at(CRANE, SEEN)]
    assert min(starts) < 1.0 < max(starts) <= parameters("dead_time", CRANE)["delay"].high


def test_what_was_seen_is_started_from_as_it_was_seen():
    (line,) = effect("periodic_disturbance").starts_at(CRANE, SEEN)
    assert math.isclose(line["frequency"], 0.04) and line["amplitude"] == 0.3
    rates = [start["rate"] for start in effect("rate_limit").starts_at(CRANE, SEEN)]
    assert rates == [start["rate"] for start in effect("rate_limit").starts_at(VALVE, SEEN)]
