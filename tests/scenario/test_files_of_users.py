"""What users own (`tests/samples`) is read, run and verified unchanged by the program as it is now."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from zipfile import ZipFile

import nbformat
import numpy as np
import pytest
from audit_trail import read_audit

import hil
from hil.console.access_accounts import Accounts
from hil.errors import TrippedError
from hil.safety.latch import Latch, latch_path

SAMPLE = Path(__file__).parents[1] / "samples" / "8f99e50"
HASTY = "timeout_s = 0.1\nlongest_reply_s = 0.2\nwatchdog_s = 0.3"
CALM = "timeout_s = 1.0\nlongest_reply_s = 1.0\nwatchdog_s = 4.0"
TYPED = [line.split(" ", 1) for line in (SAMPLE / "commands.txt").read_text("utf-8").splitlines()]


@pytest.fixture
def owned(tmp_path, monkeypatch):
    """A copy of everything, as the folder that one works in."""
    folder = shutil.copytree(SAMPLE, tmp_path / "owned")
    (folder / "state" / "passport-key.pem").chmod(0o600)
    (folder / "state" / "console" / "accounts.json").chmod(0o600)
    monkeypatch.chdir(folder)
    monkeypatch.setenv("HIL_STATE_DIR", str(folder / "state"))
    return folder


@pytest.mark.parametrize(("status", "command"), TYPED, ids=[command[:60] for _, command in TYPED])
def test_a_command_as_it_was_typed_ends_as_it_did(status, command, owned, command_line):
    if "hil run" in command:  # the trip that is kept there is of this bench on hardware; a simulated one has none
        assert latch_path("HPV41, end of line").is_relative_to(owned)
    assert command_line(*shlex.split(command)[1:]).status == int(status)


def test_numbers_are_those_that_were_written(owned):
    written = json.loads((owned / "runs" / "spring" / "results.json").read_text("utf-8"))
    results = hil.results("runs/spring")
    assert len(results.values) == len(written["values"])
    for then in written["values"]:
        now = results[then["name"]]
        assert {key: getattr(now, key) for key in ("value", "std", "unit", "verdict")}.items() <= then.items()
    exported = json.loads((owned / "exported.json").read_text("utf-8"))
    parameters = {one["name"]: one["value"] for one in exported["parameters"]}
    assert hil.load_model("model.json").values == pytest.approx(parameters)
    run, kept = hil.read("runs/spring"), hil.read("recording.csv.gz")
    assert run.channels["flow"].unit == kept.channels["flow"].unit == "l/min"
    assert np.isfinite(run.values("flow")).all()


def test_notebook_prints_what_it_printed(owned):
    names: dict[str, object] = {}
    for cell in nbformat.read("notebook.ipynb", as_version=4).cells:
        if cell.cell_type == "code":
            *lines, last = cell.source.splitlines()
            exec("\n".join(lines), names)
            assert repr(eval(last, names)) == cell.outputs[0]["data"]["text/plain"]


def test_state_of_a_lab_is_kept(owned):
    with pytest.raises(TrippedError, match="supply pressure reads 120 bar"):
        Latch(latch_path("HPV41, end of line")).check()
    assert Accounts().verified("olga", "correct horse battery")
    trail = read_audit(owned / "state" / "console" / "audit.jsonl")
    assert [(line["who"], line["act"]) for line in trail] == [("AM", "drives"), ("AM", "drives")]


def test_fmu_holds_what_it_held(owned):
    with ZipFile(owned / "valve.fmu") as fmu:
        assert "modelDescription.xml" in fmu.namelist()


def test_package_of_a_stranger_passes_its_own_tests(owned):
    package = owned / "stranger"
    for tried in (package / "tests").glob("test_driver_*.py"):  # their waits are those of an idle computer
        text = tried.read_text("utf-8")
        assert HASTY in text
        tried.write_text(text.replace(HASTY, CALM), "utf-8")
    groups = tomllib.loads((package / "pyproject.toml").read_text("utf-8"))["project"]["entry-points"]
    installed = package / "sample_lab-0.1.dist-info"
    installed.mkdir()
    (installed / "METADATA").write_text("Metadata-Version: 2.1\nName: sample-lab\nVersion: 0.1\n", "utf-8")
    (installed / "entry_points.txt").write_text(
        "".join(f"[{group}]\n{name} = {module}\n" for group, entry in groups.items() for name, module in entry.items()),
        "utf-8",
    )
    ended = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "tests"], cwd=package, text=True, check=False,
        capture_output=True, env={**os.environ, "PYTHONPATH": os.pathsep.join((str(package), str(Path.cwd())))},
    )  # fmt: skip
    assert ended.returncode == 0, ended.stdout + ended.stderr
