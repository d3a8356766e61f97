"""Conditions of a test are those that a channel measured; a run that left a declared range says so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil.record.conditions import condition_departures, measured_conditions
from hil.record.recording import Channel, Recording
from hil.report.provenance import conditions_of
from tests.bench_files import bench_file

pytestmark = pytest.mark.usefixtures("unprinted")

TIME_S = np.arange(0.0, 10.0, 0.01)
DROP = np.where(TIME_S < 8.0, 1450.0, 1400.0)  # psi: 99.97 and 96.53 bar


def a_run(ranges: dict[str, list[float]], **channels: np.ndarray) -> Recording:
    meta = {
        "conditions": {"fluid": "HLP 46", "fluid_temperature_c": 40.0, "supply_pressure_bar": 100.0, "ranges": ranges}
    }
    named = {"flow [l/min]": 0.0 * TIME_S, **channels}
    units = {name: heading.partition(" [")[2].rstrip("]") for heading in named for name in [heading.partition(" [")[0]]}
    values = {heading.partition(" [")[0]: column for heading, column in named.items()}
    return Recording("run", TIME_S, {name: Channel(name, units[name], values[name]) for name in units}, meta)


def test_a_channel_says_first_mean_and_last_in_the_unit_of_the_bench_file():
    run = a_run({}, **{"supply pressure [psi]": DROP})
    found = measured_conditions(run)
    assert list(found) == ["supply_pressure_bar"]
    pressure = found["supply_pressure_bar"]
    bar = [pressure.first, pressure.mean, pressure.last]
    assert bar == pytest.approx([99.974, 99.285, 96.527], abs=2e-3)
    rows = dict(conditions_of(run))
    assert rows["Fluid temperature"] == "40 °C"
    assert rows["Supply pressure"] == "measured: first 100.0, mean 99.3, last 96.5 bar (stated: 100 bar)"
    assert "Ranges" not in rows


def test_samples_not_measured_are_no_condition():
    lost = np.where(TIME_S > 2.0, np.nan, 1450.0)
    assert measured_conditions(a_run({}, **{"supply pressure [psi]": lost}))["supply_pressure_bar"].last == (
        pytest.approx(99.974, abs=1e-3)
    )
    assert measured_conditions(a_run({}, **{"supply pressure [psi]": np.nan * TIME_S})) == {}
    assert measured_conditions(a_run({}, **{"supply pressure [mm]": 1.0 * TIME_S})) == {}


def test_conditions_are_those_of_the_parts_and_not_of_the_way_there_or_between():
    rising = np.where(TIME_S < 3.0, 30.0 * TIME_S, np.where(TIME_S < 7.0, 90.0, 60.0))
    run = a_run(
        {"supply_pressure_bar": [85.0, 95.0]}, **{"supply pressure [bar]": rising, "return pressure [bar]": rising}
    )
    parts = [{"kind": "sweep", "first": 300, "count": 400}, {"kind": "adjusted", "first": 700, "count": 200}]
    of_parts = replace(run, meta={**run.meta, "parts": parts})
    found = measured_conditions(of_parts)["supply_pressure_bar"]
    assert (found.first, found.mean, found.last) == pytest.approx((90.0, 90.0, 90.0))
    assert condition_departures(of_parts) == ()
    assert len(condition_departures(run)) == 1
    assert dict(conditions_of(of_parts))["Return pressure"].startswith("measured: first 90")


def test_conditions_that_an_output_brings_about_are_those_of_the_parts():
    rising = np.where(TIME_S < 3.0, 30.0 * TIME_S, 90.0)
    run = a_run({"supply_pressure_bar": [85.0, 95.0]}, **{"supply pressure [bar]": rising})
    stands = replace(run, meta={**run.meta, "parts": [{"kind": "sweep", "first": 300, "count": 400}]})
    assert len(condition_departures(stands)) == 1  # somebody else's pump: what it did counts
    adjusts = replace(stands, meta={**stands.meta, "roles": {"supply pressure": "supply setting"}})
    assert condition_departures(adjusts) == ()
    assert measured_conditions(adjusts)["supply_pressure_bar"].low == pytest.approx(90.0)


def test_a_condition_outside_its_declared_range_is_a_deviation():
    ranges = {
        "supply_pressure_bar": [98.0, 102.0],
        "fluid_temperature_c": [45.0, 50.0],
        "ambient_temperature_c": [15, 30],
    }
    assert condition_departures(a_run(ranges, **{"supply pressure [psi]": DROP})) == (
        "Supply pressure was 96.53 to 99.97 bar; 98 to 102 bar is declared.",
        "Fluid temperature is stated as 40 °C; 45 to 50 °C is declared.",
        "Ambient temperature was not measured and not stated; 15 to 30 °C is declared.",
    )
    kept = {"supply_pressure_bar": [95.0, 102.0], "fluid_temperature_c": [35.0, 45.0]}
    assert condition_departures(a_run(kept, **{"supply pressure [psi]": DROP})) == ()


def test_a_run_on_a_bench_with_a_range_carries_the_deviation(tmp_path):
    from hil.bench.read import read_bench
    from hil.session.procedure import load_procedure
    from hil.session.run import run_procedure

    conditions = {"ranges": {"supply_pressure_bar": [150, 160]}}
    path = bench_file(tmp_path / "bench.toml", "brevini-hpv41", conditions=conditions)
    outcome = run_procedure(load_procedure("step_response"), read_bench(path), {"levels": "0,40"}, tmp_path / "run")
    (said,) = [d for d in outcome.findings.deviations if d.startswith("Supply pressure was")]
    assert said.endswith("bar; 150 to 160 bar is declared.")
    assert "Supply pressure was" in outcome.report.read_text(encoding="utf-8")


def test_an_operating_point_has_the_unit_of_the_command():
    run = a_run({}, **{"current [A]": 0.0 * TIME_S})
    told = {"valve": {"name": "EFC", "operating_point": 1.58}, "roles": {"command": "current", "response": "flow"}}
    assert dict(conditions_of(replace(run, meta={**run.meta, **told})))["Operating point"] == "1.58 A"


def test_that_a_response_integrates_is_a_condition_where_it_does():
    run = a_run({}, **{"current [A]": 0.0 * TIME_S})
    shown = {
        given: dict(conditions_of(replace(run, meta={**run.meta, "valve": {"name": "V", "integrates": given}})))
        for given in (True, False)
    }
    assert "Integrates" in shown[True]
    assert "Integrates" not in shown[False]
