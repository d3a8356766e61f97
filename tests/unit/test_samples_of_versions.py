"""Run folders, models and bench files of every version that was published are read; newer ones are refused by name."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from hil.archive.archive import Search, find_runs, rebuild
from hil.archive.entry import entry_of
from hil.archive.place import archive_place
from hil.archive.trend import points_of
from hil.bench.read import read_bench
from hil.errors import FileError
from hil.findings.results import read_results
from hil.physics.model import load_model
from hil.record.folder import read
from hil.record.measurement import Findings, Measurement
from hil.session.limit import checked_limits, split_limits
from hil.session.procedure import load_procedure
from hil.session.results import evaluated, report_again
from hil.version import is_newer

SAMPLES = [Path(__file__).parents[1] / "samples" / version for version in ("0.1.0",)]


@pytest.mark.parametrize("sample", SAMPLES, ids=lambda path: path.name)
def test_what_a_version_made_is_read(sample):
    run = read(sample / "run")
    assert run.values("flow").shape == (400,)
    assert run.meta["valve"] == {"name": "HPV41", "serial": "SN-7"}
    assert read_results(sample / "run" / "results.json").values[0].value == 50.0
    assert entry_of(sample / "run").verdict == "pass"
    assert load_model(sample / "model.json").values["full_flow"] == pytest.approx(70.0, rel=0.01)
    assert read_bench(sample / "bench.toml").bench.valve.settling_s == 2.0


def test_settings_that_a_version_did_not_have_are_those_of_today_and_said():
    procedure = replace(
        load_procedure("step_response"), evaluate=lambda one: Findings(notes=(str(one.meta["settings"]),))
    )
    run = read(SAMPLES[-1] / "run")
    assert "settings" not in run.meta
    used, said = evaluated(procedure, run, {}).notes
    assert "'band': 2.0" in used
    assert "does not state these settings" in said
    assert "band = 2 %" in said


def changed(path: Path, **entries: object) -> Path:
    content = {**json.loads(path.read_text(encoding="utf-8")), **entries}
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def test_what_a_newer_version_made_is_refused_with_that_version(tmp_path):
    said = r"made by version 9\.1\.0; this program is version"
    run = shutil.copytree(SAMPLES[-1] / "run", tmp_path / "run")
    changed(run / "run.json", version=2, program="valve-hil 9.1.0")
    with pytest.raises(FileError, match=said):
        read(run)
    changed(run / "run.json", version=1, novelty=True)
    with pytest.raises(FileError, match=said):
        read(run)
    model = changed(Path(shutil.copy(SAMPLES[-1] / "model.json", tmp_path)), version=2, program="valve-hil 9.1.0")
    with pytest.raises(FileError, match=said):
        load_model(model)
    bench = tmp_path / "bench.toml"
    bench.write_text(
        'made_with = "9.1.0"\nnovelty = 1\n' + (SAMPLES[-1] / "bench.toml").read_text(encoding="utf-8"),
        encoding="utf-8",
    )
    with pytest.raises(FileError, match=said):
        read_bench(bench)


def test_versions_are_compared_as_numbers():
    assert is_newer("0.10.0")
    assert is_newer("0.1.1")
    assert not is_newer("0.1.0")
    assert not is_newer("0.0.9")
    assert not is_newer("a copy")


def test_quantities_are_found_by_their_old_names_and_none_is_written(tmp_path):
    run = shutil.copytree(SAMPLES[-1].parent / "8f99e50" / "runs" / "spring", tmp_path / "spring")
    place = archive_place(str(tmp_path / "runs"))
    rebuild(place, [run])
    (entry,) = find_runs(place, Search(), values=True)
    assert [p.value.name for p in points_of([entry], "dead_time")] == ["onset, 0 → 80 %"]
    assert points_of([entry], "reaches") == points_of([entry], "band_entry") != []
    limits = split_limits(["dead_time=..50", "reaches, 0 → 80 %=..1 s"])
    report_again(run, limits)
    report_again(run)
    written = (run / "results.json").read_text("utf-8") + (run / "seal.json").read_text("utf-8")
    assert "dead_time," not in written
    assert "reaches," not in written
    found = read_results(run / "results.json")
    assert (found["dead_time, 0 → 80 %"].verdict, found["band_entry, 0 → 80 %"].high) == ("fail", 1000.0)


def test_a_procedure_that_measures_a_quantity_of_an_old_name_keeps_it():
    own = [Measurement("dead_time", "ms", "of another kind"), Measurement("band_entry", "ms", "as here")]
    assert list(checked_limits(own, split_limits(["dead_time=1..", "reaches=..2"]))) == ["dead_time", "band_entry"]
