"""Electrical check, leakage check, pressure curve and steps of the EFC: numbers of a known valve, and bad input."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from efc_bench import STUCK, friction, named, outcome, value, valve

from hil.errors import InputError, RangeError, SettingError, TrippedError
from hil.identification.steady.coil import CoilReadings, copper_factor, fit_coil
from hil.identification.steady.pressure_curve import pressure_curve
from hil.identification.steady.sweep_estimate import Sweep
from hil.record.folder import read
from hil.record.measurement import Findings
from hil.record.read import read_recording
from hil.signals.ramps import triangle

pytestmark = pytest.mark.usefixtures("unprinted")


def run(folder: Path, procedure: str, changes: dict[str, Any] | None = None, **settings: object) -> Findings:
    return outcome(folder, procedure, changes, **settings).findings


def std(findings: Findings, name: str) -> float:
    return named(findings, name).std or 0.0


def said(findings: Findings) -> tuple[str, ...]:
    """Its notes, but for the leakage meter, which is at the end of its range while the valve is open."""
    return tuple(note for note in findings.notes if not note.startswith("'through flow' was not measured"))


# -- coil --------------------------------------------------------------------------------------------------


def coil_readings(ohm: float, henry: float, rate_hz: float = 5000.0, noise: float = 0.0) -> CoilReadings:
    """A first-order current loop (50 rad/s) on an RL coil; the voltage follows from the current exactly."""
    t = np.arange(round(3.0 * rate_hz)) / rate_hz
    demand = np.where((t > 0.6) & (t < 1.2) | (t > 1.8) & (t < 2.4), 0.5, 0.0)
    current = np.zeros_like(t)
    keep = math.exp(-50.0 / rate_hz)
    for i in range(1, len(t)):
        current[i] = demand[i - 1] + keep * (current[i - 1] - demand[i - 1])
    voltage = ohm * current + henry * 50.0 * (demand - current)
    rng = np.random.default_rng(0)
    return CoilReadings(t, demand, current + noise * rng.normal(size=len(t)), voltage + noise * rng.normal(size=len(t)))


@pytest.mark.parametrize(("ohm", "henry"), [(2.1, 0.09), (7.2, 0.12), (2.1, 0.01)])
def test_resistance_and_inductance_of_a_known_coil(ohm, henry):
    coil = fit_coil(coil_readings(ohm, henry))
    assert coil.resistance_ohm == pytest.approx(ohm, rel=1e-3)
    assert coil.inductance_h == pytest.approx(henry, rel=0.02)


def test_noise_of_a_coil_is_in_its_uncertainty():
    coil = fit_coil(coil_readings(2.1, 0.09, noise=0.01))
    assert abs(coil.resistance_ohm - 2.1) < 3.0 * coil.resistance_std_ohm + 2e-3
    assert abs(coil.inductance_h - 0.09) < 3.0 * coil.inductance_std_h + 2e-3
    assert coil.inductance_std_h < 3e-3


@pytest.mark.parametrize("first", [0.2, 1.4])
def test_coil_is_measured_over_a_link_that_answers_early_and_late(first):
    even = coil_readings(2.1, 0.09)
    t = even.time_s[:: round(5000.0 * 0.005)]  # polled every 5 ms; each answer up to 2 ms early or late
    stamps = t + 0.002 * np.random.default_rng(1).uniform(-1.0, 1.0, len(t))
    stamps[1] = stamps[0] + first * 0.005
    when = np.clip(np.searchsorted(even.time_s, stamps), 0, len(even.time_s) - 1)
    coil = fit_coil(CoilReadings(stamps, even.demand_a[when], even.current_a[when], even.voltage_v[when]))
    assert coil.resistance_ohm == pytest.approx(2.1, rel=1e-3)
    assert coil.inductance_h == pytest.approx(0.09, abs=3.0 * coil.inductance_std_h)


def test_rest_that_is_shorter_than_0_2_s_is_none():
    readings = coil_readings(2.1, 0.09)
    with pytest.raises(InputError, match=r"at least 0.2 s"):
        fit_coil(replace(readings, time_s=readings.time_s / 3.1))  # rests of 0.6 s


def test_coil_needs_a_current_that_moves():
    readings = coil_readings(2.1, 0.09)
    still = CoilReadings(readings.time_s, np.zeros(len(readings.time_s)), readings.current_a, readings.voltage_v)
    with pytest.raises(InputError, match="must rise and fall"):
        fit_coil(still)


def test_copper_at_220_fahrenheit():
    # 2.78 Ω of a coil with 2.1 Ω at 72 °F, from the temperature coefficient at 20 °C
    assert 2.1 * copper_factor((220 - 32) / 1.8, (72 - 32) / 1.8) == pytest.approx(2.78, abs=0.01)


def test_electrical_check_of_the_usual_coil(tmp_path):
    found = run(tmp_path, "electrical_check")
    assert found.verdict == "pass"
    assert value(found, "coil_resistance") == pytest.approx(2.1, abs=3 * std(found, "coil_resistance"))
    assert value(found, "coil_inductance") == pytest.approx(90.0, abs=3 * std(found, "coil_inductance"))
    assert std(found, "coil_resistance") < 0.02 and std(found, "coil_inductance") < 1.0
    assert np.abs(read_recording(tmp_path / "run").values("current")).max() <= 0.5


def test_a_coil_of_24_v_passes_where_it_is_said_to_be_one(tmp_path):
    found = run(tmp_path, "electrical_check", valve(resistance=7.2), repeats=2, voltage="24")
    assert named(found, "coil_resistance").verdict == "pass"


def test_current_above_the_coil_s_rating_is_refused_before_anything_moves(tmp_path):
    with pytest.raises(SettingError, match=r"takes 6\.38 A at most"):
        run(tmp_path / "a", "electrical_check", test_current=6.5)
    with pytest.raises(RangeError, match=r"outside 0 … 2\.2 A"):
        run(tmp_path, "efc_step_response", currents=(2.5,))
    assert not (tmp_path / "run").exists()


def test_a_coil_that_is_open_trips_before_the_current_is_far_up(tmp_path):
    with pytest.raises(TrippedError, match="coil-open"):
        run(tmp_path, "pressure_current", valve(resistance=1e5), cycle_s=8.0)
    # 0.5 s and a block of 1 s after 0.7 A, at 0.5 A/s
    assert read_recording(tmp_path / "run").values("current").max() < 0.7 + 0.75 + 1e-3


@pytest.mark.parametrize("procedure", ["electrical_check", "efc_acceptance"])
def test_bench_without_a_voltmeter_says_what_is_missing_before_anything_moves(tmp_path, procedure):
    gone = {"coil voltage": None}
    changes = {"channels": gone, "simulation": {"instruments": gone}}
    with pytest.raises(SettingError, match="needs the channels coil voltage; the bench reads: pressure, coil current"):
        run(tmp_path, procedure, changes)


# -- leakage -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("parameters", "judged", "says"),
    [
        ({"leakage": 80}, "pass", ""),
        ({"leakage": 160}, "fail", ""),
        ({"leakage": 125.5}, "cannot tell", ""),
        ({"normally_open": 1}, "fail", "the valve is open at this current"),
        ({"supply_pressure": 100}, "cannot tell", "no supply pressure"),
    ],
)
def test_leakage_verdicts(tmp_path, parameters, judged, says):
    found = run(tmp_path, "leakage_check", valve(**parameters), settle_s=0.5, hold_s=1.0)
    assert named(found, "leakage").verdict == judged
    assert not says or any(says in note for note in found.notes)
    if judged == "pass":
        assert value(found, "leakage") == pytest.approx(80.0, abs=3 * std(found, "leakage"))


# -- pressure curve ----------------------------------------------------------------------------------------


def played(width: float, lag_s: float) -> list[Sweep]:
    """A tanh curve with a backlash-like loop of known width and a lag."""
    made = []
    for cycle_s in (8.0, 16.0):
        u = triangle(0.0, 2.0, cycle_s, 1000.0)
        up = np.gradient(u) > 0.0
        speed = 4.0 / cycle_s
        at = u - np.where(up, 1.0, -1.0) * (width / 2.0 + lag_s * speed)
        made.append(Sweep(u, 100.0 * (1.0 + np.tanh((at - 1.2) / 0.2)), speed))
    return made


@pytest.mark.parametrize(("width", "lag_s"), [(0.0, 0.0), (0.05, 0.0), (0.0, 0.03), (0.05, 0.03)])
def test_hysteresis_and_lag_are_told_apart(width, lag_s):
    curve = pressure_curve("played", played(width, lag_s))
    assert curve.estimate.mean_width == pytest.approx(width, abs=1e-3)
    assert curve.estimate.lag_s == pytest.approx(lag_s, abs=1e-3)
    assert curve.current_at(100.0) == pytest.approx(1.2, abs=5e-3)
    assert np.interp(1.2, curve.current, curve.nominal) == pytest.approx(100.0, abs=2.0)


def test_pressure_curve_needs_two_speeds_and_a_pressure_that_is_reached():
    sweeps = played(0.0, 0.0)
    with pytest.raises(InputError, match="two speeds"):
        pressure_curve("played", sweeps[:1])
    with pytest.raises(InputError, match="pressure 300 psi"):
        pressure_curve("played", sweeps).current_at(300.0)


def test_pressure_curve_of_a_valve_that_sticks(tmp_path):
    found = run(tmp_path, "pressure_current", valve(friction(0.03, 1.0)), cycle_s=8.0)
    assert found.verdict == "pass"
    assert value(found, "hysteresis") == pytest.approx(60.0, abs=3.0)
    assert value(found, "pressure, 1.6 A") == pytest.approx(119.0, abs=6.0)


@pytest.mark.parametrize(
    ("changes", "says"),
    [(valve(normally_open=1), "the type is wrong"), (STUCK, "sensor stuck, valve stuck, or no supply")],
)
def test_curve_that_is_none(tmp_path, changes, says):
    found = run(tmp_path, "pressure_current", changes, cycle_s=8.0)
    assert found.verdict == "fail"
    assert any(says in note for note in found.notes)


# -- steps -------------------------------------------------------------------------------------------------


def test_steps_reach_the_pressures_of_the_thesis(tmp_path):
    found = run(tmp_path, "efc_step_response", hold_s=1.0, repeats=2)
    for current, pressure in ((1.4, 26.0), (1.6, 120.0), (1.8, 160.0), (2.0, 210.0)):
        assert value(found, f"step_pressure, {current:g} A") == pytest.approx(pressure, abs=3.0)
    assert value(found, "rise, 1.6 A") == pytest.approx(73.0, abs=3.0)
    assert any(note.startswith("1.2 A: 2 of 2 steps move the pressure too little") for note in found.notes)
    assert len(json.loads((tmp_path / "run" / "results.json").read_text(encoding="utf-8"))["values"]) > 15


# -- frequency response ------------------------------------------------------------------------------------


def test_frequency_response_finds_the_currents_of_its_level(tmp_path):
    found = run(tmp_path, "efc_frequency_response", cycle_s=8.0, levels=("high", "medium"), frequencies=(1.0, 5.0),
                measure_s=0.5)  # fmt: skip
    gains = [m.value for m in found.measured if m.quantity == "gain"]
    assert len(gains) == 2
    high, medium, *_ = said(found)
    assert high.startswith("Level high: 133 to 147 psi") and medium.startswith("Level medium: 20 to")
    sines = [part for part in read(tmp_path / "run").meta["parts"] if part["kind"] == "sine"]
    assert [round(part["amplitude"], 2) for part in sines] == [0.04, 0.04, 0.16, 0.16]


def test_level_that_the_supply_does_not_reach_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"setting levels: pressure 140 psi: the curve goes from .* to 9.* psi"):
        run(tmp_path, "efc_frequency_response", valve(supply_pressure=100), cycle_s=8.0, levels=("medium",))


def test_pressure_far_below_burst_trips(tmp_path):
    with pytest.raises(TrippedError, match=r"over-pressure.*pressure ≤ 280"):
        run(tmp_path, "efc_step_response", valve(supply_pressure=330), currents=(2.0,), repeats=1)
    assert read_recording(tmp_path / "run").values("pressure").max() < 400.0
