"""Every command that prints a result prints it as JSON too: valid, with its schema, which the reference lists."""

import json
import re
from itertools import islice
from pathlib import Path

import pytest
import typer

import hil
from hil.cli import app
from hil.daq import conformance

examine = conformance.examine

ROOT = Path(__file__).parents[2]
SCHEMAS = set(
    re.findall(r"^\| `(hil\.[a-z.-]+/\d+)`", (ROOT / "docs/reference/json.md").read_text("utf-8"), re.MULTILINE)
)
# What these print is no result: a file for another program, a page, a server's address, or what was made and where.
WITHOUT = {
    "console", "console user add", "console user list", "console user remove", "describe", "devices", "export", "new",
}  # fmt: skip


def commands(command, names=()):
    for name, inner in getattr(command, "commands", {}).items():
        yield from commands(inner, (*names, name))
    if not hasattr(command, "commands"):
        yield " ".join(names), command


def test_every_command_that_prints_a_result_takes_json():
    every = dict(commands(typer.main.get_command(app.assembled())))
    lacking = {name for name, one in every.items() if not any("--json" in option.opts for option in one.params)}
    assert lacking <= WITHOUT


def test_every_schema_that_the_code_writes_is_in_the_reference():
    written = {
        schema for file in (ROOT / "hil").rglob("*.py")
        for schema in re.findall(r"\"(hil\.[a-z.-]+/\d+)\"", file.read_text("utf-8"))
    }  # fmt: skip
    assert written and written <= SCHEMAS


def test_every_command_that_states_how_a_recording_is_read_takes_all_reading_options():
    every = dict(commands(typer.main.get_command(app.assembled())))
    taken = {name: {option for one in command.params for option in one.opts} for name, command in every.items()}
    readers = {name for name, options in taken.items() if "--rename" in options}
    assert {"convert", "identify", "compare", "simulate", "diagnose", "average", "analyse recursive"} <= readers
    asked = {"--time", "--interval", "--unit", "--rename", "--columns", "--gaps"}
    assert {name: asked - taken[name] for name in readers if asked - taken[name]} == {}


def refuse(constant):
    raise AssertionError(f"{constant} is no JSON")


@pytest.fixture
def said(command_line):
    def called(*arguments):
        status, out, err = command_line(*arguments, "--json")
        assert status == 0, err
        told = json.loads(out, parse_constant=refuse)
        assert told["schema"] in SCHEMAS
        return told

    return called


@pytest.fixture
def short(tmp_path):
    path = tmp_path / "short.csv"
    rows = "".join(f"{0.01 * k:.2f},{20 * (k > 50)},{k % 7}\n" for k in range(200))
    path.write_text(f"time [s],command [%],flow [l/min]\n{rows}", encoding="utf-8")
    return path


def test_convert_says_what_was_read(said, short, tmp_path):
    told = said("convert", short, tmp_path / "out.h5", "--unit", "flow=gpm")
    assert told["channels"] == [
        {"name": "command", "unit": "%", "samples": 200}, {"name": "flow", "unit": "gpm", "samples": 200},
    ]  # fmt: skip
    assert told["samples"] == 200
    assert told["duration_s"] == pytest.approx(1.99)
    assert told["assumed"] == ["'flow' was in l/min and is now said to be in gpm; its numbers are the same"]


def test_average_and_convert_of_a_response(said, tmp_path):
    assert said("average", "hpv41-plus-5", "hpv41-plus-10", "--out", tmp_path / "mean.csv")["frequencies"] > 5
    told = said("convert", tmp_path / "mean.csv", tmp_path / "again.csv")
    assert told["kind"] == "frequency response"
    assert told["from_hz"] < told["to_hz"]


def test_simulate_says_what_it_wrote(said, short, tmp_path):
    hil.save_model(hil.typical_model("brevini-hpv41"), tmp_path / "m.json")
    told = said("simulate", "--model", tmp_path / "m.json", "--input", short, "--out", tmp_path / "out.csv")
    assert told["samples"] == 200
    assert told["outputs"] == [{"name": "flow", "unit": "l/min"}]


def test_check_touches_no_device_and_says_what_a_bench_has(said):
    told = said("check", "brevini-hpv41")
    assert {"command", "flow"} <= {channel["name"] for channel in told["channels"]}
    assert all(channel["safe"] is not None for channel in told["channels"] if channel["limits"])


def test_check_driver_lists_each_check(said, monkeypatch):
    monkeypatch.setattr(
        conformance, "examine", lambda subject: islice(examine(subject), 3)
    )  # the first ones, for speed
    told = said("check-driver", "ascii_module")
    assert told["counts"] == {"passed": 3, "broken": 0, "left out": 0}
    assert [one["verdict"] for one in told["checks"]] == ["passed"] * 3


def test_archive_rebuild_counts_runs(said, tmp_path):
    (tmp_path / "archive").mkdir()
    assert said("archive", "rebuild", "--archive", tmp_path / "archive")["runs"] == 0
