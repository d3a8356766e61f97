"""A batch against its limits: yield, first-pass yield, capability, and the limits that are missed most."""

import csv
import io
import json

import numpy as np
import pytest

from hil.archive.archive import enter
from hil.archive.place import archive_place
from hil.findings.batch import batch_of
from hil.findings.results import Results
from hil.record.measurement import Findings, Measurement
from tests.kept_runs import kept_run

RISE = Measurement("rise", "ms", "time", high=12.0)
GAIN = Measurement("gain", "psi per A", "gain", low=7.0, high=9.0)


def unit(serial, *values):
    return Results(run=serial, procedure="step", serial=serial, verdict=Findings(values).verdict, values=values)


def test_limits_are_listed_by_misses_with_their_share():
    units = [unit(f"U{i}", GAIN.of(8.0 + 0.1 * i, 0.01), RISE.of(rise, 0.1)) for i, rise in enumerate((10, 13, 14, 12))]
    units.append(unit("U9", GAIN.of(9.5, 0.01), RISE.of(10.5, 0.1)))
    batch = batch_of(units, {})
    assert [(one.name, one.failed, one.cannot_tell) for one in batch.limits] == [("rise", 2, 1), ("gain", 1, 0)]
    assert [one.cumulative for one in batch.limits] == pytest.approx([2 / 3, 1.0])
    assert (batch.final.passed, batch.final.judged) == (1, 5)
    assert batch.final.low == pytest.approx(0.00505, rel=1e-2)


def test_capability_is_the_distance_to_the_nearer_limit_in_three_deviations():
    values = (8.4, 8.5, 8.6)
    (gain,) = batch_of([unit(f"U{i}", GAIN.of(x, 0.01)) for i, x in enumerate(values)], {}).limits
    assert (gain.mean, gain.std, gain.cpk) == pytest.approx((8.5, 0.1, 0.5 / 0.3))


def test_the_interval_of_a_capability_holds_the_truth_in_95_of_100_batches():
    rng, held = np.random.default_rng(4), 0
    for _ in range(300):
        values = rng.normal(9.0, 1.0, 8)  # 3 ms below the limit: the true capability is 1
        (rise,) = batch_of([unit(f"U{i}", RISE.of(x, 0.0)) for i, x in enumerate(values)], {}).limits
        held += rise.cpk_low < 1.0 < rise.cpk_high
    assert held / 300 == pytest.approx(0.95, abs=0.035)


@pytest.mark.parametrize(
    ("values", "why"),
    [
        ([RISE.of(8.0, 0.1), RISE.of(4.0, 0.0, relation="<")], "1 of 2 units have a bound or no value"),
        ([RISE.of(8.0, 0.1)], "one unit has no scatter"),
        ([RISE.of(8.0, 0.1), RISE.of(8.0, 0.1)], "all units have the same value"),
    ],
)
def test_a_capability_that_nobody_can_state_has_its_reason(values, why):
    (rise,) = batch_of([unit(f"U{i}", value) for i, value in enumerate(values)], {}).limits
    assert (rise.cpk, rise.why) == (None, why)


def test_a_batch_without_limits_has_no_yield():
    assert batch_of([unit("U1", Measurement("rise", "ms", "").of(8.0, 0.1))], {}) is None


# -- at the prompt -----------------------------------------------------------------------------------------


def made(folder, serial, rise, day):
    return kept_run(folder, [RISE.of(rise, 0.1), GAIN.of(8.0 + day / 100, 0.01)], serial, day, bench="one")


@pytest.fixture
def lab(tmp_path):
    lab = tmp_path / "lab"
    runs = [made(lab / f"u{i}", f"U{i}", 10.0 + 0.1 * i, day=2 + i) for i in range(4)]
    runs += [made(lab / "first", "U0", 14.0, 1), made(lab / "later", "U1", 14.0, 9)]
    enter(archive_place(str(lab)), runs)
    return lab


def compared(command_line, lab, *options):
    return command_line("compare", *(lab / f"u{i}" for i in range(4)), "--population", "--archive", lab, *options)


def test_first_pass_yield_counts_the_first_run_of_each_serial(command_line, lab):
    printed = compared(command_line, lab)
    assert printed.status == 0
    assert "yield: 4 of 4 units (100 %, 95 % interval 40 … 100 %) pass." in printed.out
    assert "first-pass yield: 3 of 4 units (75 %, 95 % interval 19 … 99 %) passed in their first run." in printed.out


def test_the_limits_of_a_batch_are_csv_and_json(command_line, lab, tmp_path):
    printed = compared(command_line, lab, "--json", "--csv", tmp_path / "batch.csv")
    rows = list(csv.DictReader(io.StringIO((tmp_path / "batch.csv").read_text())))
    limits = json.loads(printed.out)["batch"]["limits"]
    assert [row["name"] for row in rows] == [one["name"] for one in limits] == ["rise", "gain"]
    assert float(rows[0]["cpk"]) == pytest.approx(limits[0]["cpk"])
    assert (rows[0]["high"], rows[0]["low"], rows[0]["simulated"]) == ("12.0", "", "False")


def test_one_unit_is_no_batch(lab, tmp_path, refused):
    path = tmp_path / "batch.csv"
    said = refused("compare", lab / "u0", "--population", "--archive", lab, "--csv", path)
    assert "several runs with limits are needed" in said
    assert not path.exists()
