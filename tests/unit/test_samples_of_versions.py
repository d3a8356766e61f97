"""Run folders, models and bench files of every version that was published are read; newer ones are refused by name."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from hil.archive.entry import entry_of
from hil.bench.read import read_bench
from hil.errors import FileError
from hil.findings.results import read_results
from hil.physics.model import load_model
from hil.record.folder import read
from hil.record.measurement import Findings
from hil.session.procedure import load_procedure
from hil.session.results import evaluated
from hil.version import is_newer

SAMPLES = [Path(__file__).parents[1] / "samples" / version for version in ("0.1.0",)]


@pytest.mark.parametrize("sample", SAMPLES, ids=lambda path: path.name)
def test_what_a_version_made_is_read(sample: Path) -> None:
    run = read(sample / "run")
    assert run.values("flow").shape == (400,)
    assert run.meta["valve"] == {"name": "HPV41", "serial": "SN-7"}
    assert read_results(sample / "run" / "results.json").values[0].value == 50.0
    assert entry_of(sample / "run").verdict == "pass"
    assert load_model(sample / "model.json").values["full_flow"] == pytest.approx(70.0, rel=0.01)
    assert read_bench(sample / "bench.toml").bench.valve.settling_s == 2.0


def test_settings_that_a_version_did_not_have_are_those_of_today_and_said() -> None:
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


def test_what_a_newer_version_made_is_refused_with_that_version(tmp_path: Path) -> None:
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


def test_versions_are_compared_as_numbers() -> None:
    assert is_newer("0.10.0")
    assert is_newer("0.1.1")
    assert not is_newer("0.1.0")
    assert not is_newer("0.0.9")
    assert not is_newer("a copy")
