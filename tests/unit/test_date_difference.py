"""What changed between two dates, found again in recordings in which it was concealed."""

from __future__ import annotations

import numpy as np
import pytest

from hil.cli.commands.diff import _text
from hil.diagnosis.evidence.coverage import Limit
from hil.errors import FileError, SettingError
from hil.passport.change import Change, Size, owner_among, owner_of
from hil.passport.conditions import condition_changes
from hil.passport.difference import DateDifference, _excluded, _no_change, difference
from hil.passport.sources import Dated, read_dated
from hil.physics.simulate import ActiveEffect
from hil.record.recording import Recording, recording
from tests.concealed import nominal, records
from tests.passports import run_of


def test_friction_that_came_is_the_valves_with_its_size_and_share():
    stuck = ActiveEffect("friction", "force", {"coulomb": 4.0, "stiction": 1.2, "stribeck": 10.0, "presliding": 0.2})
    found = difference(Dated("old", tuple(records(seed=2))), Dated("new", tuple(records([stuck], seed=3))), nominal())
    assert found.verdict == "changed"
    (change,) = found.changes
    assert (change.name, change.of, change.unit) == ("friction", "valve", "%")
    assert change.before.value == 0.0 and change.after.value == pytest.approx(4.0, rel=0.2)
    assert change.share is not None and change.share > 0.9
    assert "friction" not in {one.name for one in found.unchanged} and found.unchanged
    told = found.as_dict()
    assert told["schema"] == "hil.diff/1" and told["changes"][0]["from"]["value"] == 0.0


def test_without_a_model_it_says_which_option_helps():
    with pytest.raises(SettingError, match="--model"):
        difference(Dated("old", ()), Dated("new", ()), None)


@pytest.mark.parametrize(
    ("stage", "rivals", "owner"),
    [("spool", (), "valve"), ("sensor", (), "bench"), ("command", (), "open"), ("spool", ("sensor",), "open"),
     ("pilot", ("spool",), "valve")],
)  # fmt: skip
def test_what_cannot_be_told_from_the_other_side_is_open(stage, rivals, owner):
    assert owner_among(stage, rivals) == owner
    assert rivals or owner_of(stage) == owner


def _at(temperature_c: float) -> Recording:
    time_s = np.arange(50) * 0.1
    return recording("r", time_s, {"oil temperature [degC]": temperature_c + 0.1 * np.sin(time_s)})


def test_colder_oil_is_the_benchs():
    (change,) = condition_changes([_at(48.0)], [_at(40.0)])
    assert (change.name, change.of, change.stage) == ("oil temperature", "bench", "oil")
    assert change.before.value == pytest.approx(48.0, abs=0.2) and change.after.value == pytest.approx(40.0, abs=0.2)
    assert condition_changes([_at(40.0)], [_at(40.05)]) == []


@pytest.mark.usefixtures("stranger")
def test_a_date_is_a_run_folder_or_a_folder_of_runs_and_says_what_it_is_not(tmp_path):
    run = run_of(tmp_path / "runs")
    assert read_dated(run, tmp_path / "a").serials == {"SN-7"}
    assert len(read_dated(tmp_path / "runs", tmp_path / "b").recordings) == 1
    (tmp_path / "empty").mkdir()
    with pytest.raises(FileError, match="no recordings"):
        read_dated(tmp_path / "empty", tmp_path / "c")


def test_what_may_have_changed_unseen_is_not_called_unchanged():
    tight = _excluded(Limit("leakage", "spool", "gain", "%", 0.2, 2.0, visible=True))
    wide = _excluded(Limit("backlash", "spool", "width", "%", 3.0, 2.0, visible=True))
    stop = _excluded(Limit("end_stop", "load", "upper", "%", 80.0, 80.0, visible=True))
    lag = _no_change(Change("lag", "spool", "valve", "lag", Size(20.0, 1.0), Size(20.5, 1.0), "ms", None, None))
    delay = _no_change(Change("delay", "spool", "valve", "delay", Size(2.0, 2.0), Size(2.5, 2.0), "ms", None, None))
    assert [one.is_identifiable for one in (tight, wide, stop, lag, delay)] == [True, False, True, True, False]
    said = _text(DateDifference((), (tight, stop, lag), "unchanged", cannot_tell=(wide, delay)))
    assert "end_stop  none at 80 % or less" in said
    assert "cannot be told:\n    backlash  known only within 3 %\n    delay     known only within 5.2 ms" in said
