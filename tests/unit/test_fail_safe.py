"""Fail-safe: the closing time of a first-order valve by its formula, what stays open, drift that is none."""

import math

import numpy as np
import pytest

import hil
from hil.bench.fault import BenchError
from hil.bench.read import read_bench
from hil.errors import SettingError
from hil.record.recording import Channel, Recording
from hil.rig import RoleChannel
from procedures._scale import Scale
from procedures.fail_safe import evaluate

RATE_HZ, HELD, LAG_S, NOISE, BAND = 200.0, 400, 0.1, 0.3, 5.0


def recorded(open_=0.0, drift_per_s=0.0, seed=0, repeats=2):
    """From ±100 % to 0: 0.7 l/min per %, first order; `open_` stays on the side that the valve came from."""
    pieces, parts, level = [np.zeros(HELD)], [{"kind": "neutral", "first": 0, "count": HELD}], [np.zeros(HELD)]
    first, decay = HELD, np.exp(-np.arange(HELD) / RATE_HZ / LAG_S)
    for end in (100.0, -100.0) * repeats:
        rest = math.copysign(open_, end)
        level.append(np.repeat([end, 0.0], HELD))
        pieces.append(np.concatenate((np.full(HELD, 0.7 * end), rest + (0.7 * end - rest) * decay)))
        parts.append({"kind": "fail-safe", "level": end, "held": HELD, "label": f"{end:g} %", "first": first,
                      "count": 2 * HELD})  # fmt: skip
        first += 2 * HELD
    for part in parts:
        part |= {"start_s": part["first"] / RATE_HZ, "stop_s": (part["first"] + part["count"] - 1) / RATE_HZ}
    flow = np.concatenate(pieces)
    time_s = np.arange(len(flow)) / RATE_HZ
    flow = flow + drift_per_s * time_s + NOISE * np.random.default_rng(seed).normal(size=len(flow))
    channels = {"command": Channel("command", "%", np.concatenate(level)), "flow": Channel("flow", "l/min", flow)}
    meta = {"roles": {"command": "command", "response": "flow"}, "settings": {"band": BAND}, "parts": parts,
            "conditions": {}}  # fmt: skip
    return Recording("run", time_s, channels, meta)


def found(**given):
    return {m.name: m for m in evaluate(recorded(**given)).measured}


@pytest.mark.parametrize("drift_per_s", [0.0, 0.02])
def test_closing_time_and_what_stays_open_are_those_of_the_formula(drift_per_s):
    measured = found(open_=1.5, drift_per_s=drift_per_s)
    for label, side in (("100 %", 1.0), ("-100 %", -1.0)):
        closing, left = measured[f"closing_time, {label}"], measured[f"left_open, {label}"]
        assert abs(closing.value - 1e3 * LAG_S * math.log(100.0 / BAND)) < 4.0 * closing.std < 60.0
        assert abs(left.value - 1.5 * side) < 4.0 * left.std < 1.0


def test_a_valve_that_closes_leaves_nothing_open():
    held = [abs(m.value) <= 2.0 * m.std for s in range(3) for n, m in found(seed=s, repeats=2).items() if "left" in n]
    assert sum(held) >= 4  # of 6


def test_the_curve_begins_at_the_loss_of_the_command():
    curve = evaluate(recorded()).curves["fail_safe"][0]
    before = curve["time_s"] < 0.0
    assert curve["measured"][before].mean() == pytest.approx(70.0, abs=0.2)
    assert abs(curve["measured"][curve["time_s"] > 1.0].mean()) < 0.2


def test_levels_are_the_ends_of_the_range_and_none_is_neutral():
    scale = Scale(RoleChannel("command", "%", -100.0, 80.0), 100.0)
    assert scale.levels("levels", None) == [80.0, -100.0]
    assert scale.levels("levels", None, 0.5) == [40.0, -50.0]
    with pytest.raises(SettingError, match="levels"):
        scale.levels("levels", (50.0, 0.0))


RELAY = """based_on = "four-way-lab"
[channels.relay]
role = "electronics supply"
device = "daq"
terminal = "do1"
unit = "1"
safe = 0.0
on = 1.0
settles_s = 0.05
[simulation.instruments.relay]
signal = ""
"""


@pytest.mark.parametrize("powers", [True, False])
def test_a_supply_of_the_electronics_is_lost_by_its_relay(tmp_path, powers):
    bench = tmp_path / "relay.toml"
    bench.write_text(RELAY + 'powers = "command"\n' * powers, encoding="utf-8")
    settings = {"levels": (80.0,), "repeats": 2, "losses": ("command", "electronics supply")}
    measured = {m.name: m for m in hil.run("fail_safe", bench, tmp_path / "run", **settings).findings.measured}
    closing, left = (measured[f"{name}, 80 %, electronics supply lost"] for name in ("closing_time", "left_open"))
    if powers:  # the coil loses its current either way
        command = measured["closing_time, 80 %"]
        assert abs(closing.value - command.value) < 4.0 * math.hypot(closing.std, command.std) < 5.0
        assert abs(left.value) < 0.1
    else:  # the relay is not in the valve's supply
        assert closing.value is None
        assert left.value > 10.0
    relay = hil.read(tmp_path / "run").values("relay")
    assert np.count_nonzero(np.diff(relay) > 0.5) == 3  # on, and again after each loss


@pytest.mark.parametrize("losses", [(), ("feedback",), ("command", "command")])
def test_losses_that_cannot_be_driven_are_refused_by_name(tmp_path, losses):
    with pytest.raises(SettingError, match=r'role = "feedback"|setting losses'):
        hil.run("fail_safe", "four-way-lab", tmp_path / "run", losses=losses)


def test_a_relay_of_a_supply_is_not_set_by_hand(tmp_path):
    text = RELAY.partition("safe = ")[0].replace('"do1"', '"di0"')
    text += (
        "by_hand = { low = 0.0, high = 1.0, usual = 1.0, tolerance = 0.1 }\n[simulation.instruments.relay]\nvalue = 1.0"
    )
    (tmp_path / "relay.toml").write_text(text, encoding="utf-8")
    with pytest.raises(BenchError, match="by_hand: only an input has this"):
        read_bench(tmp_path / "relay.toml")
