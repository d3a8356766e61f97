"""`hil run --json`: one document on stdout, whatever became of the run, with what is known of the outputs."""

import json
from collections.abc import Callable
from typing import Any

import pytest

from hil.record.run_folder.header import read_end
from tests.bench_files import bench_file

pytestmark = pytest.mark.usefixtures("unprinted")

TRIPS = {"flow-without-command": {"low": None, "high": 3.0, "only_while": None, "for_s": 0.05}}


Printed = Callable[..., tuple[int, dict[str, Any], str]]


@pytest.fixture
def printed(command_line, tmp_path):
    """Exit status of a run, the document on stdout, and what was said on stderr."""

    def run(level, **tables):
        bench = bench_file(tmp_path / "bench.toml", "brevini-hpv41", **tables)
        words = ("--json", "--set", f"value={level:g}", "--set", "for_s=0.5", "--out", tmp_path / "run")
        status, out, err = command_line("run", "jog", "--bench", bench, "--archive", tmp_path, *words)
        return status, json.loads(out), err

    return run


def test_json_of_a_run_says_what_is_known_of_its_outputs(printed, tmp_path):
    status, document, _ = printed(30.0)
    end = read_end(tmp_path / "run")
    assert (status, document["schema"], document["run"]) == (0, "hil.results/1", "run")
    assert document["values"] and end is not None and document["outputs"] == end.outputs
    assert document["outputs"]["command"]["state"] == "safe" and "error" not in document


def test_json_of_a_run_that_failed(printed, tmp_path):
    status, document, err = printed(30.0, interlocks=TRIPS)
    end = read_end(tmp_path / "run")
    assert end is not None and document["outputs"] == end.outputs
    assert (status, document["exit_status"], document["schema"]) == (3, 3, "hil.results/1")
    assert document["outputs"]["command"]["state"] == "safe" and "outputs are safe (read back)" in document["error"]
    assert document["verdict"] is None and document["values"] == [] and document["error"] in err


def test_json_of_a_run_that_was_refused(printed):
    status, document, _ = printed(120.0)
    assert (status, document["exit_status"]) == (2, 2) and "120" in document["error"]
    assert {name: output["state"] for name, output in document["outputs"].items()} == {"command": "safe"}
