"""`hil run --json`: one document on stdout, whatever became of the run, with what is known of the outputs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from hil.cli.app import _assembled
from hil.record.header import read_end
from tests.links import bench_text

pytestmark = pytest.mark.usefixtures("unprinted")

TRIPS = ('low = -10.0\nhigh = 10.0\nonly_while = { channel = "command", low = -5.0, high = 5.0 }\nfor_s = 2.0',
         "high = 3.0\nfor_s = 0.05")  # fmt: skip


def printed(folder: Path, level: float, *changes: tuple[str, str]) -> tuple[int, dict[str, Any], str]:
    """Exit status of a run, the document on stdout, and what was said on stderr."""
    bench = folder / "bench.toml"
    bench.write_text(bench_text("brevini-hpv41", *changes), encoding="utf-8")
    words = ["run", "jog", "--bench", str(bench), "--out", str(folder / "run"), "--archive", str(folder), "--json",
             "--set", f"value={level:g}", "--set", "for_s=0.5"]  # fmt: skip
    said = CliRunner().invoke(_assembled(), words)
    return said.exit_code, json.loads(said.stdout), said.stderr


def test_json_of_a_run_says_what_is_known_of_its_outputs(tmp_path: Path) -> None:
    status, document, _ = printed(tmp_path, 30.0)
    end = read_end(tmp_path / "run")
    assert (status, document["schema"], document["run"]) == (0, "hil.results/1", "run")
    assert document["values"] and end is not None and document["outputs"] == end.outputs
    assert document["outputs"]["command"]["state"] == "safe" and "error" not in document


def test_json_of_a_run_that_failed(tmp_path: Path) -> None:
    status, document, err = printed(tmp_path, 30.0, TRIPS)
    end = read_end(tmp_path / "run")
    assert end is not None and document["outputs"] == end.outputs
    assert (status, document["exit_status"], document["schema"]) == (3, 3, "hil.results/1")
    assert document["outputs"]["command"]["state"] == "safe" and "outputs are safe (read back)" in document["error"]
    assert document["verdict"] is None and document["values"] == [] and document["error"] in err


def test_json_of_a_run_that_was_refused(tmp_path: Path) -> None:
    status, document, _ = printed(tmp_path, 120.0)
    assert (status, document["exit_status"]) == (2, 2) and "120" in document["error"]
    assert {name: output["state"] for name, output in document["outputs"].items()} == {"command": "safe"}
