"""Exchanges that take too long: when a device acted or measured within them is in the ± of every figure."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hil.record.late_exchanges import LateExchanges, late_exchanges
from hil.record.measurement import Findings, Measurement
from hil.record.recording import Recording, recording
from hil.session.sample_sensitivity import measured_findings
from procedures import step_response

RATE_HZ, HELD, USUAL_S, LATE_S, LAG_S = 25.0, 50, 0.001, 0.12, 0.15
RISE_MS = 1e3 * LAG_S * math.log(9.0)


def stepped(late: range, *, at_the_request: bool = True, seed: int = 1) -> Recording:
    """Steps up and down on a link of which some readings take longer, as the host stamps them.

    Args:
        late: samples whose reading is answered 0.12 s after it was asked for.
        at_the_request: the device measures then, else when it answers.
        seed: of the noise.
    """
    command = np.repeat([0.0, 50.0, 0.0], HELD)
    took_s = np.full(len(command), USUAL_S)
    took_s[late] += LATE_S
    time_s, free_s = np.empty(len(command)), 0.0
    for i in range(len(command)):
        time_s[i] = max(i / RATE_HZ, free_s)
        free_s = time_s[i] + took_s[i]
    measured_s = time_s + (0.0 if at_the_request else took_s)
    flow = np.zeros(len(command))
    for first in (HELD, 2 * HELD):
        change = command[first] - command[first - 1]
        flow += change * -np.expm1(-np.maximum(measured_s - time_s[first], 0.0) / LAG_S)
    flow += 0.2 * np.random.default_rng(seed).normal(size=len(flow))
    parts = [{"kind": "level", "from": a, "to": b, "first": HELD * i, "count": HELD, "start_s": 0.0, "stop_s": 0.0}
             for i, (a, b) in enumerate([(0.0, 0.0), (0.0, 50.0), (50.0, 0.0)])]  # fmt: skip
    sampling = {"timing": "polled", "delay_channels": {"flow": "delay of io"}}
    meta = {"sampling": sampling, "roles": {"command": "command", "response": "flow"}, "parts": parts,
            "settings": {"band": 2.0}}  # fmt: skip
    columns = {"command [%]": command, "flow [l/min]": flow, "delay of io [s]": 0.5 * took_s}
    return recording("linked", time_s, columns, meta)


def exchanges(run: Recording) -> LateExchanges:
    found = late_exchanges(run)
    assert found is not None
    return found


def rises(run: Recording) -> list[tuple[float, float]]:
    """(away from the truth, standard uncertainty) of each rise."""
    found = measured_findings(step_response.evaluate, run).measured
    return [(m.value - RISE_MS, m.std or 0.0) for m in found if m.quantity == "rise" and m.value is not None]


@pytest.mark.parametrize("at_the_request", [True, False])
@pytest.mark.parametrize("first", [HELD, HELD + 1])
def test_a_rise_holds_the_truth_whenever_a_late_device_measured(first, at_the_request):
    run = stepped(range(first, 3 * HELD, 10), at_the_request=at_the_request)
    late = exchanges(run)
    assert (late.count, late.longest_s) == (len(range(first, 3 * HELD, 10)), pytest.approx(LATE_S))
    found = rises(run)
    assert len(found) == 2 and all(abs(off) < 2.5 * std for off, std in found), found


def test_without_what_lateness_leaves_open_it_would_not():
    run = stepped(range(HELD, 3 * HELD, 10))
    naive = step_response.evaluate(run).measured
    (off, std), *_ = [(m.value - RISE_MS, m.std) for m in naive if m.quantity == "rise"]
    assert abs(off) > 4.0 * std
    (note, *_) = measured_findings(step_response.evaluate, run).notes
    assert note.startswith("In 10 of 150 samples an exchange with the device took up to 0.12 s longer than usual")
    assert "rise, 0 → 50 %" in note


def test_usual_exchanges_are_left_alone():
    run = stepped(range(0))
    assert late_exchanges(run) is None
    assert measured_findings(step_response.evaluate, run).measured == step_response.evaluate(run).measured


def test_no_time_is_supposed_past_its_neighbours_and_late_is_behind_early():
    run = stepped(range(5, 3 * HELD, 7))
    early, late = exchanges(run).early, exchanges(run).late
    for one in (early, late):
        assert (np.diff(one.time_s) > 0.0).all() and (np.diff(one.stamps("flow")) > 0.0).all()
    assert (late.stamps("flow") > early.stamps("flow") - 1e-9).all() and (late.time_s <= early.time_s).all()


def test_a_value_that_a_supposition_does_not_have_is_not_given_and_a_limit_is_judged_again():
    run, lag = stepped(range(5, 3 * HELD, 7)), Measurement("lag", "ms", "", high=31.0)

    def evaluate(told):
        delay_ms = 1e3 * float(np.max(told.values("delay of io")))
        return Findings((lag.of(30.0 if told is run else delay_ms, 0.1), lag.at("b").of(1.0 if told is run else None)))

    (kept, gone) = measured_findings(evaluate, run).measured
    assert kept.value == 30.0 and kept.std is not None and kept.std > 10.0 and kept.verdict == "cannot tell"
    assert (gone.value, gone.verdict) == (None, "cannot tell")
