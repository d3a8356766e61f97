"""Two runs side by side: which value differs, at a stated rate of false alarms."""

import json

import numpy as np
import pytest

from hil.findings.difference import ALPHA, differences
from hil.findings.results import Results
from hil.record.measurement import Measured, Measurement
from hil.report.comparison_page import headline, run_heads
from hil.report.local_time import local_text
from hil.session.run_comparison import compare_runs
from tests.kept_runs import kept_run
from tests.page import read_page

pytestmark = pytest.mark.xdist_group("compared runs")  # on one worker: its runs are made once


def results(*values):
    return Results(run="one", procedure="step_response", serial="A7", verdict=None, values=values)


def value(number, std=1.0, calibration=0.0, name="rise", **more):
    return Measured(name=name, value=number, std=std, unit="ms", calibration_std=calibration, **more)


def one(first, second, one_bench=True):
    (found,) = differences(results(first), results(second), one_bench=one_bench)
    return found


def test_change_beyond_the_uncertainty_differs():
    found = one(value(10.0), value(15.0))
    assert (found.meaning, found.change) == ("differs", 5.0)
    assert found.std == pytest.approx(2.0**0.5)
    assert one(value(10.0), value(12.0)).meaning == "within uncertainty"


def test_calibration_that_both_share_cancels():
    first, second = value(10.0, 3.0, 2.9), value(15.0, 3.0, 2.9)
    assert one(first, second).std == pytest.approx((2.0 * (9.0 - 2.9**2)) ** 0.5)
    assert one(first, second).meaning == "differs"
    assert one(first, second, one_bench=False).meaning == "within uncertainty"


@pytest.mark.parametrize(
    "other",
    [value(15.0, relation="<"), value(None), value(15.0, None), value(15.0, name="settling")],
    ids=["bound", "missing", "unknown uncertainty", "another value"],
)
def test_what_cannot_be_compared_is_said(other):
    found = differences(results(value(10.0)), results(other), one_bench=True)
    assert {difference.meaning for difference in found} == {"cannot tell"}


def test_false_alarms_come_at_the_stated_rate_over_all_values():
    rng = np.random.default_rng(3)
    alarms, pairs = 0, 1500
    for _ in range(pairs):
        runs = [results(*(value(x, name=f"v{i}") for i, x in enumerate(rng.standard_normal(8)))) for _ in range(2)]
        alarms += any(one.meaning == "differs" for one in differences(*runs, one_bench=True))
    assert alarms / pairs == pytest.approx(ALPHA, abs=3.0 * (ALPHA / pairs) ** 0.5)


def test_headline_names_what_differs():
    assert headline([one(value(10.0), value(15.0))]) == "1 of 1 values differ beyond their uncertainty: rise."
    assert headline([one(value(10.0), value(10.0))]) == "No value differs beyond its uncertainty."


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    import hil

    folder = tmp_path_factory.mktemp("runs")
    worn = folder / "worn.toml"
    effect = 'effects = [{ name = "friction", hook = "force", parameters = { coulomb = 3.0 } }]'
    name = 'name = "HPV41 on the simulated bench"'
    worn.write_text(f'based_on = "brevini-hpv41"\n{name}\n[simulation]\nseed = 2\n{effect}\n', encoding="utf-8")
    for bench, run in (("brevini-hpv41", "new"), (str(worn), "old")):
        hil.run("step_response", bench, folder / run, levels=(0, 80))
    return folder


def test_worn_valve_is_told_from_the_new_one(runs, command_line):
    compare = ("compare", runs / "new", runs / "old")
    said = command_line(*compare, "--json")
    document = json.loads(said.out)
    assert said.status == 0
    assert document["same_instruments"]
    by_name = {row["name"]: row for row in document["differences"]}
    assert by_name["change, 0 → 80 %"]["meaning"] == "differs"
    page = runs / "page.html"
    said = command_line(*compare, "--page", page)
    assert "beyond their uncertainty" in said.out
    text = page.read_text(encoding="utf-8")
    assert text.count("<svg") >= 1
    assert "measured, new" in text and "measured, old" in text


@pytest.mark.parametrize("order", [("new", "old"), ("old", "new")])
def test_compare_runs_goes_by_time_whatever_the_order(runs, order, command_line):
    """The later run less the earlier one, both with their dates: on the terminal, in JSON and on the page."""
    given = [runs / name for name in order]
    found = compare_runs(*given)
    assert (found.first.run, found.second.run) == ("new", "old")
    assert found.first.started_utc < found.second.started_utc
    said = command_line("compare", *given, "--page", runs / "page.html")
    dates = [local_text(one.started_utc) for one in (found.first, found.second)]
    sentence = f"Change from new ({dates[0]}) to old ({dates[1]}): the later value less the earlier one."
    assert sentence in said.out
    assert sentence in read_page(runs / "page.html").text
    said = command_line("compare", *given, "--json")
    document = json.loads(said.out)
    assert document["runs"] == ["new", "old"]
    assert document["started_utc"] == sorted(document["started_utc"])
    row = next(row for row in document["differences"] if row["name"] == "change, 0 → 80 %")
    assert row["change"] == pytest.approx(row["second"]["value"] - row["first"]["value"])


def test_run_compared_with_itself_does_not_differ(runs, command_line):
    said = command_line("compare", runs / "new", runs / "new")
    assert "No value differs" in said.out


def test_wrong_use_is_said(runs, refused):
    said = refused("compare", runs / "new")
    assert "two runs are compared, 1 given" in said


@pytest.fixture
def adjusted(tmp_path):
    """A unit before and after somebody adjusted it; a limit is missed, then met."""
    rise = Measurement("rise", "ms", "", high=75.0)
    for day, (name, number) in enumerate([("before", 80.0), ("after", 70.0)], start=1):
        kept_run(tmp_path / name, [rise.of(number, 0.5)], day=day)
    return tmp_path


def test_one_unit_is_shown_as_found_and_as_left_with_verdicts(adjusted, command_line):
    page = adjusted / "page.html"
    said = command_line("compare", adjusted / "after", adjusted / "before", "--page", page)
    assert "as found    as left     verdict" in said.out
    assert said.out.splitlines()[1].split("  ")[-2:] == ["-10.0 ± 1.4", "differs"]
    assert "fail → pass" in said.out
    assert "Verdict: fail, then pass." in said.out
    text = read_page(page).text
    assert all(part in text for part in ("as found", "fail → pass", "Verdict: fail, then pass."))
    assert "limits differ" not in said.out + text


def test_a_limit_that_was_moved_between_two_runs_is_said(tmp_path, command_line):
    for day, (name, high) in enumerate([("before", 75.0), ("after", 85.0)], start=1):
        kept_run(tmp_path / name, [Measurement("rise", "ms", "", high=high).of(80.0, 0.5)], day=day)
    said = command_line("compare", tmp_path / "before", tmp_path / "after")
    assert "Verdict: fail, then pass. Their limits differ: rise." in said.out


@pytest.mark.parametrize(
    ("serials", "verdicts"),
    [(("A7", "B1"), ("fail", "pass")), ((None, None), ("fail", "pass")), (("A7", "A7"), ("pass", "pass"))],
)
def test_two_units_or_one_that_was_not_adjusted_are_headed_by_time(serials, verdicts):
    first, second = (
        results().model_copy(update={"serial": serial, "run": f"r{i}", "verdict": verdict})
        for i, (serial, verdict) in enumerate(zip(serials, verdicts, strict=True))
    )
    assert run_heads(first, second) == ("earlier", "later")
