"""Conditions that a bench adjusts beside the command: by role, within limits, back in the order of the bench file."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hil.bench.fault import BenchError
from hil.bench.find import benches
from hil.bench.open import open_rig
from hil.bench.read import read_bench
from hil.errors import RangeError, RehearsalError, SettingError, StoppedError
from hil.record.measurement import Findings
from hil.record.read import read_recording
from hil.safety.operator import Operator
from hil.session.procedure import load_procedure
from hil.session.run import rehearse_procedure, run_procedure
from procedures._conditions import adjusted
from tests.driven import silent_rig

LAB = benches()["four-way-lab"].read_text(encoding="utf-8")
ORDER = 'shutdown_order = ["supply setting", "command", "load orifice"]'


def bench(tmp_path: Path, *changes: tuple[str, str]):
    text = LAB
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "bench.toml"
    path.write_text(text, encoding="utf-8")
    return read_bench(path)


def test_a_condition_is_adjusted_at_its_slew_while_the_command_stands_and_comes_back(tmp_path):
    with silent_rig(bench(tmp_path), tmp_path / "run") as rig:
        assert set(rig.adjustable) == {"supply pressure", "load orifice", "tank pressure", "oil temperature"}
        assert rig.adjustable["supply pressure"].operating_point == 70.0
        rig.ramp_to(20.0)
        made = rig.adjust({"supply pressure": 110.0, "load orifice": 0.0})
        with adjusted(rig, {"tank pressure": 4.0}, rig.rate_hz):
            rig.hold(0.1)
        back = rig.hold(0.1)
    supply = made.values("supply setting")
    assert supply[-1] == pytest.approx(110.0) == supply.max()
    assert np.diff(supply).max() == pytest.approx(0.2)  # 200 bar/s at 1 kHz
    assert len(made) == 200 + 200  # the way, and the valve's settling time
    assert set(made.values("load orifice")) == {0.0}
    assert np.ptp(made.values("command")) == 0.0
    assert made.values("supply pressure")[-100:].mean() == pytest.approx(110.0, abs=0.2)
    assert back.values("tank setting")[-1] == 2.0
    kinds = [part for part in read_recording(tmp_path / "run").meta["parts"] if part["kind"] == "adjusted"]
    assert kinds[0]["supply pressure"] == 110.0
    assert read_recording(tmp_path / "run").meta["roles"]["tank pressure"] == "tank setting"


def test_a_condition_beyond_its_limits_moves_nothing(tmp_path):
    with silent_rig(bench(tmp_path), tmp_path / "run") as rig:
        with pytest.raises(RangeError, match="supply setting"):
            rig.adjust({"supply pressure": 211.0})
        assert rig.hold(0.01).values("supply setting")[-1] == 70.0


@pytest.mark.parametrize("ordered", [True, False])
def test_outputs_go_to_their_safe_values_in_the_order_of_the_bench_file(tmp_path, ordered):
    with silent_rig(bench(tmp_path, *(() if ordered else ((ORDER, ""),))), tmp_path / "run") as rig:
        rig.ramp_to(50.0)
    run = read_recording(tmp_path / "run")
    supply, command, load = (run.values(name) for name in ("supply setting", "command", "load orifice"))
    assert (supply[-1], command[-1], load[-1]) == (0.0, 0.0, 0.0)
    if ordered:
        assert command[np.flatnonzero(supply > 0.0)[-1]] == 50.0  # stands until there is no pressure
        assert load[np.flatnonzero(command > 0.0)[-1]] == 100.0
        assert np.flatnonzero(load > 0.0)[0] < np.flatnonzero(supply > 0.0)[0]  # open before there is pressure
    else:
        assert command[np.flatnonzero(supply > 0.0)[-1]] < 1.0  # both went down at once


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (ORDER, 'shutdown_order = ["pump"]', "pump"),
        (ORDER, 'shutdown_order = ["flow"]', "'flow' is an input"),
        (ORDER, 'shutdown_order = ["command", "command"]', "named twice"),
        ('role = "tank pressure"', 'role = "supply pressure"', "is the supply pressure already"),
        (
            '[channels."load pressure"]',
            '[channels."load pressure"]\nrole = "oil temperature"',
            "oil temperature already",
        ),
    ],
)
def test_what_makes_no_sense_is_a_fault_of_the_bench_file(tmp_path, old, new, message):
    with pytest.raises(BenchError, match=message):
        bench(tmp_path, (old, new))


@pytest.mark.parametrize(
    "name",
    [
        "pressure_gain",
        "internal_leakage",
        "flow_over_pressure_drop",
        "limiting_power",
        "null_shift",
        "load_step",
        "proof_pressure",
    ],
)
def test_a_test_that_lacks_a_role_is_refused_by_name(tmp_path, name):
    hpv41 = read_bench(benches()["brevini-hpv41"])
    with pytest.raises(SettingError, match=r'needs an output with role = "[a-z ]+"; this bench adjusts: nothing'):
        run_procedure(load_procedure(name), hpv41, {}, tmp_path / "run")


def test_the_rehearsal_judges_adjusted_conditions_too(tmp_path):
    def run(rig):
        rig.adjust({"supply pressure": 140.0})

    file = bench(tmp_path, ('high = 230.0\nfor_s = 0.02\naction = "trip"', 'high = 130.0\naction = "trip"'))
    procedure = replace(load_procedure("jog"), run=run, settings={})
    with pytest.raises(RehearsalError, match="supply pressure"):
        rehearse_procedure(procedure, file, {})


HAND = """role = "supply pressure"
by_hand = { low = 0.0, high = 210.0, usual = 100.0, tolerance = 2.0 }
"""


def by_hand(tmp_path: Path, change: tuple[str, str] | None = None):
    """The HPV41's bench, whose supply pressure somebody sets; it reads 100 bar all the time."""
    text = benches()["brevini-hpv41"].read_text(encoding="utf-8")
    text = text.replace('[channels."supply pressure"]\n', f'[channels."supply pressure"]\n{HAND}', 1)
    path = tmp_path / "bench.toml"
    path.write_text(text.replace(*change, 1) if change else text, encoding="utf-8")
    return read_bench(path)


@pytest.mark.parametrize(("asked", "message"), [(100.5, ""), (110.0, "supply pressure 110 bar was confirmed, ± 2 is")])
def test_somebody_sets_a_condition_by_hand_and_the_reading_is_held_against_it(tmp_path, asked, message):
    operator, heard = Operator(), []

    def told(_done, text):
        heard.append(text)

    with (
        pytest.raises(StoppedError, match=message) if message else nullcontext(),
        open_rig(by_hand(tmp_path), tmp_path / "run", {}, told, operator=operator) as rig,
    ):
        operator.holding = lambda holds: operator.ask("resume") if holds else None  # who goes on at once
        assert rig.adjustable["supply pressure"].operating_point == 100.0
        rig.adjust({"supply pressure": asked})
        rig.ramp_to(10.0)
    run = read_recording(tmp_path / "run")
    events = [event["event"] for event in run.meta["events"]]
    assert events.index("set by hand") < events.index("hold") < events.index("resume")
    assert any(text.startswith(f"HOLDS: set supply pressure {asked:.4g} bar by hand") for text in heard)
    assert (run.values("command").max() > 0.0) == (not message)  # what contradicts moves no valve


def test_nobody_is_asked_where_nobody_is_and_a_value_beyond_the_range_is_refused(tmp_path):
    with silent_rig(by_hand(tmp_path), tmp_path / "run") as rig:
        rig.adjust({"supply pressure": 150.0})
        with pytest.raises(RangeError, match="cannot be set by hand"):
            rig.adjust({"supply pressure": 250.0})
    assert "hold" not in [event["event"] for event in read_recording(tmp_path / "run").meta["events"]]


def test_nobody_is_asked_on_a_simulated_bench_without_a_terminal(tmp_path):
    def run(rig):
        rig.adjust({"supply pressure": 101.0})
        rig.hold(0.1)

    procedure = replace(load_procedure("jog"), run=run, settings={}, evaluate=lambda _recording: Findings(()))
    run_procedure(procedure, by_hand(tmp_path), {}, tmp_path / "run")
    events = {event["event"]: event["details"] for event in read_recording(tmp_path / "run").meta["events"]}
    assert events["set by hand"] == {"channel": "supply pressure", "value": 101.0, "asked": False}
    assert "hold" not in events


def test_only_what_reads_a_condition_is_set_by_hand(tmp_path):
    with pytest.raises(BenchError, match="by_hand: only an input has this"):
        by_hand(tmp_path, ('role = "supply pressure"\n', ""))
    with pytest.raises(BenchError, match="or an input with by_hand"):
        by_hand(tmp_path, ("usual = 100.0", "usual = 300.0"))  # beyond what can be set
