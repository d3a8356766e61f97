"""Units beside their population: found where they differ, at a stated rate of false alarms, and not told by few."""

import json

import numpy as np
import pytest

from hil.archive.archive import enter
from hil.archive.place import archive_place
from hil.findings.difference import ALPHA
from hil.findings.population import standings
from hil.findings.results import Results
from hil.record.measurement import Measured, Measurement
from tests.kept_runs import kept_run

RISE = Measurement("rise", "ms", "time")


def value(number, std=0.1, calibration=0.0, name="rise", **more):
    return Measured(name=name, value=number, std=std, unit="ms", calibration_std=calibration, **more)


def results(*values, run="one"):
    return Results(run=run, procedure="step_response", serial=run, verdict=None, values=values)


def one(own, others, one_bench=True):
    (found,) = standings([results(own)], [[other] for other in others], one_bench=one_bench)
    return found


SIX = [value(x) for x in (9.0, 9.5, 10.0, 10.0, 10.5, 11.0)]


def test_mean_scatter_and_distance_are_those_of_the_others():
    found = one(value(15.0), SIX)
    numbers = [9.0, 9.5, 10.0, 10.0, 10.5, 11.0]
    assert (found.units, found.mean, found.distance) == (6, 10.0, 5.0)
    assert found.std == pytest.approx(np.std(numbers, ddof=1))
    assert found.distance_std == pytest.approx(found.std * (7 / 6) ** 0.5)
    assert found.meaning == "differs"
    assert one(value(11.2), SIX).meaning == "within the population"


def test_both_uncertainties_are_in_the_distance():
    assert one(value(15.0, 4.0), SIX).meaning == "within the population"
    alike = [value(10.0 + 1e-6 * i, 1.0) for i in range(6)]  # closer together than their repeatability
    assert one(value(12.0, 1.0), alike).meaning == "within the population"


def test_calibration_that_is_not_shared_counts_on_both_sides():
    others = [value(other.value, 1.0, 0.99) for other in SIX]
    own = value(14.0, 1.0, 0.99)
    apart, shared = one(own, others, one_bench=False), one(own, others)
    assert apart.distance_std**2 - shared.distance_std**2 == pytest.approx(2.0 * 0.99**2)


@pytest.mark.parametrize(
    ("own", "others", "why"),
    [
        (value(15.0), SIX[:4], "4 other units, at least 5 are needed"),
        (value(15.0), [], "0 other units"),
        (value(15.0, relation="<"), SIX, "a bound"),
        (value(None), SIX, "no value"),
        (value(15.0, None), SIX, "no uncertainty"),
        (value(15.0), [*SIX, value(2.0, relation="<")], "1 of 7 other units have a bound alone"),
    ],
)
def test_what_cannot_be_told_says_why(own, others, why):
    found = one(own, others)
    assert (found.meaning, found.chance) == ("cannot tell", None)
    assert why in found.why


@pytest.mark.parametrize("units", [5, 20])
def test_false_alarms_come_at_the_stated_rate(units):
    rng = np.random.default_rng(7)
    alarms, rounds = 0, 500
    for _ in range(rounds):
        people = [[value(x, 0.01, name=f"v{k}") for k, x in enumerate(row)] for row in rng.normal(size=(units + 3, 2))]
        batch = [results(*values, run=f"r{i}") for i, values in enumerate(people[:3])]
        alarms += any(found.meaning == "differs" for found in standings(batch, people[3:], one_bench=True))
    expected = ALPHA + 3.0 * (ALPHA / rounds) ** 0.5  # 8 values share one population: their alarms come together
    assert ALPHA / 5 < alarms / rounds < expected


def test_a_batch_is_found_where_no_unit_of_it_stands_out():
    rng = np.random.default_rng(2)
    people = [[value(x)] for x in rng.normal(10.0, 1.0, 40)]
    batch = [results(value(x), run=f"r{i}") for i, x in enumerate(rng.normal(11.5, 0.3, 10))]
    found = standings(batch, people, one_bench=True)
    assert {unit.meaning for unit in found[:10]} == {"within the population"}
    assert (found[-1].who, found[-1].meaning) == ("batch", "differs")


# -- at the prompt -----------------------------------------------------------------------------------------


def made(folder, serial, number, procedure="step", day=1, outcome="completed"):
    told = {"procedure": procedure, "bench": "one", "outcome": outcome}
    return kept_run(folder, [RISE.of(number, 0.1)], serial, day, **told)


@pytest.fixture
def lab(tmp_path):
    lab = tmp_path / "lab"
    runs = [made(lab / f"u{i}", f"U{i}", 10.0 + 0.3 * i, day=2) for i in range(5)]
    runs += [made(lab / "own", "X", 20.0), made(lab / "before", "U0", 99.0), made(lab / "own before", "X", 99.0)]
    runs += [made(lab / "other", "Y", 99.0, "sweep"), made(lab / "nameless", "", 99.0)]
    runs += [made(lab / "broken off", "Z", 99.0, outcome="stopped")]
    enter(archive_place(str(lab)), runs)
    return lab


def said(command_line, *arguments):
    return command_line("compare", *arguments, "--population")


def test_population_is_the_last_run_of_each_other_unit(command_line, lab):
    printed = said(command_line, lab / "own", "--archive", lab, "--json")
    told = json.loads(printed.out)
    assert printed.status == 0
    assert sorted(told["others"]) == ["U0", "U1", "U2", "U3", "U4"]
    assert (told["schema"], told["without_serial"], told["same_instruments"]) == ("hil.population/1", 1, True)
    (row,) = told["values"]
    assert row["mean"] == pytest.approx(10.6)
    assert (row["units"], row["meaning"]) == (5, "differs")


def test_units_that_are_named_are_none_of_the_others(command_line, lab):
    printed = said(command_line, lab / "own", lab / "u0", "--archive", lab)
    assert "cannot be told: 4 other units, at least 5 are needed" in printed.out
    assert "Nothing can be told." in printed.out
    assert "1 runs without a serial number" in printed.out


def test_table_states_the_rate(command_line, lab):
    printed = said(command_line, lab / "own", "--archive", lab)
    assert "1 of 1 values that can be told differ from the population (false-alarm rate 5 %" in printed.out


@pytest.mark.parametrize(
    ("names", "why"),
    [
        (["own", "other"], "runs of one procedure"),
        (["own", "own before"], "unit X is named twice"),
        (["nameless"], "no serial number"),
    ],
)
def test_runs_that_make_no_batch_are_refused(command_line, lab, names, why):
    printed = said(command_line, *(lab / name for name in names), "--archive", lab)
    assert printed.status == 2
    assert why in printed.err
