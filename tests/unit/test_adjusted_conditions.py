"""Conditions that a bench adjusts beside the command: by role, within limits, back in the order of the bench file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hil.bench.fault import BenchError
from hil.bench.find import benches
from hil.bench.open import open_rig
from hil.bench.read import read_bench
from hil.errors import RangeError, RehearsalError, SettingError
from hil.record.read import read_recording
from hil.rig import Rig
from hil.session.procedure import load_procedure
from hil.session.run import rehearse_procedure, run_procedure
from procedures._conditions import adjusted

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


def opened(file, out: Path):
    return open_rig(file, out, {}, lambda _done, _text: None)


def test_a_condition_is_adjusted_at_its_slew_while_the_command_stands_and_comes_back(tmp_path: Path) -> None:
    with opened(bench(tmp_path), tmp_path / "run") as rig:
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


def test_a_condition_beyond_its_limits_moves_nothing(tmp_path: Path) -> None:
    with opened(bench(tmp_path), tmp_path / "run") as rig:
        with pytest.raises(RangeError, match="supply setting"):
            rig.adjust({"supply pressure": 211.0})
        assert rig.hold(0.01).values("supply setting")[-1] == 70.0


@pytest.mark.parametrize("ordered", [True, False])
def test_outputs_go_to_their_safe_values_in_the_order_of_the_bench_file(tmp_path: Path, ordered: bool) -> None:
    with opened(bench(tmp_path, *(() if ordered else ((ORDER, ""),))), tmp_path / "run") as rig:
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
def test_what_makes_no_sense_is_a_fault_of_the_bench_file(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(BenchError, match=message):
        bench(tmp_path, (old, new))


@pytest.mark.parametrize("name", ["pressure_gain", "internal_leakage", "flow_over_pressure_drop", "null_shift"])
def test_a_test_that_lacks_a_role_is_refused_by_name(tmp_path: Path, name: str) -> None:
    hpv41 = read_bench(benches()["brevini-hpv41"])
    with pytest.raises(SettingError, match=r'needs an output with role = "[a-z ]+"; this bench adjusts: nothing'):
        run_procedure(load_procedure(name), hpv41, {}, tmp_path / "run")


def test_the_rehearsal_judges_adjusted_conditions_too(tmp_path: Path) -> None:
    def run(rig: Rig) -> None:
        rig.adjust({"supply pressure": 140.0})

    file = bench(tmp_path, ('high = 230.0\nfor_s = 0.02\naction = "trip"', 'high = 130.0\naction = "trip"'))
    procedure = replace(load_procedure("jog"), run=run, settings={})
    with pytest.raises(RehearsalError, match="supply pressure"):
        rehearse_procedure(procedure, file, {})
