"""Files of others that a command takes: too deep, no files, links in run folders. One line, exit 2, and no waiting."""

import json
import os
import shutil
import socket
from functools import reduce
from pathlib import Path

import numpy as np
import pytest

from hil.cli.places import check_folder
from hil.errors import FileError
from hil.record.read import write_recording
from hil.record.recording import recording
from hil.untrusted import resolved

DEEP = "[" * 100_000
DOTTED = "a." * 50_000 + "a = 1"
TOLD = {"JSON": (DEEP, "JSON nested more than 64 deep"), "TOML": (DOTTED, "a key of more than 64 parts")}
SMALL = ("run.json", "end.json", "events.jsonl", "samples.f8", "samples.log")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    time_s = np.arange(200) * 0.05
    made = recording("r", time_s, {"command [%]": np.sin(time_s), "flow [l/min]": np.sin(time_s)})
    write_recording(made, tmp_path / "good.csv")
    write_recording(made, tmp_path / "run")
    (tmp_path / "deep.json").write_text(DEEP)
    (tmp_path / "dotted.toml").write_text(DOTTED)
    return tmp_path


@pytest.mark.parametrize(
    ("command", "kind"),
    [
        ("simulate --model deep.json --input good.csv --out x.csv", "JSON"),
        ("compare --model deep.json good.csv", "JSON"),
        ("diagnose --model deep.json good.csv --out d", "JSON"),
        ("identify good.csv --plant deep.json --out m.json", "JSON"),
        ("export deep.json --to json --out x.json", "JSON"),
        ("check dotted.toml", "TOML"),
        ("run step_response --bench dotted.toml", "TOML"),
        ("describe dotted.toml", "TOML"),
        ("devices dotted.toml", "TOML"),
    ],
)
def test_what_is_nested_too_deep_is_one_line(command, kind, folder, refused):
    assert folder.exists()
    err = refused(*command.split())
    assert TOLD[kind][1] in err, err


@pytest.mark.parametrize("command", ["analyse classes pipe", "analyse compose pipe pipe --out m.json"])
def test_tables_are_not_waited_for(command, folder, refused):
    os.mkfifo(folder / "pipe")
    assert "pipe: is a pipe; only regular files are read here" in refused(*command.split())


@pytest.mark.parametrize("name", SMALL)
@pytest.mark.parametrize("kind", ["link", "pipe", "socket", "sparse", "folder"])
def test_a_run_folder_holds_regular_files_alone(kind, name, folder, command_line):
    path = folder / "run" / name
    shutil.move(path, folder / name)
    if kind == "link":
        path.symlink_to(folder / name)
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    elif kind == "sparse":
        with path.open("wb") as file:
            file.truncate(1 << 40)
    else:
        with socket.socket(socket.AF_UNIX) as listening:
            listening.bind(os.path.relpath(path))
    for command in ("convert run x.csv", "report run", "results run --json -"):
        status, _, err = command_line(*command.split())
        if name == "samples.log":  # of a closed run nobody needs its journal
            assert status in (0, 2) and "a fault of this program" not in err
        else:
            assert status == 2 and len(err.splitlines()) == 1 and name in err, err


@pytest.mark.parametrize("text", [DEEP, "[]", "null", "1", '{"format": "hil-run"}', '{"a": NaN}', "\0"])
def test_a_run_folder_whose_files_say_anything_is_one_line(text, folder, command_line):
    for name in ("run.json", "end.json", "results.json"):
        shutil.copytree(folder / "run", folder / "made")
        (folder / "made" / name).write_text(text)
        status, _, err = command_line("results", "made", "--json", "-")
        assert status in (0, 2) and len(err.splitlines()) <= 1 and "a fault of this program" not in err, err
        shutil.rmtree(folder / "made")


def test_end_json_seals_no_file_outside(folder, refused):
    text = (folder / "run/end.json").read_text()
    assert '"run.json"' in text
    (folder / "run/end.json").write_text(text.replace('"run.json"', '"../../../../../../etc/passwd"'))
    err = refused("convert", "run", "x.csv")
    assert "seals '../../../../../../etc/passwd', which is no file of the run folder" in err


def test_archive_rebuild_leaves_bad_folders_out(folder, command_line, prints):
    runs = folder / "runs"
    runs.mkdir()
    shutil.copytree(folder / "run", runs / "good")
    shutil.copytree(folder / "run", runs / "deep")
    (runs / "deep/run.json").write_text(DEEP)
    (runs / "piped").mkdir()
    os.mkfifo(runs / "piped/run.json")
    shutil.copytree(folder / "run", runs / "linked")
    (runs / "linked/results.json").symlink_to("/etc/passwd")
    (runs / "elsewhere").symlink_to(folder)
    status, _, err = command_line("archive", "rebuild", "--archive", runs)
    assert "a fault of this program" not in err
    out = prints("runs", "--archive", runs, "--json")
    assert '/good"' in out and "deep" not in out and status in (0, 2)


@pytest.mark.parametrize(
    ("file", "key", "found"),
    [
        *[("run", (key,), ["x"]) for key in ("valve", "conditions", "limits", "settings", "roles", "sampling")],
        *[("run", ("valve",), None), ("run", ("instruments",), None), ("run", ("instruments",), [1])],
        ("run", ("roles", "command"), [1]), ("run", ("sampling", "delay_channels"), True),
        ("run", ("conditions", "fluid_temperature_c"), {"a": None}),
        ("end", ("outputs",), ["x"]), ("end", ("outputs", "command"), 1), ("end", ("instruments",), "x"),
        ("end", ("deviations",), {}), ("end", ("notes",), 1),
    ],
)  # fmt: skip
def test_meta_of_another_kind_is_named(file, key, found, folder, refused):
    path = folder / f"run/{file}.json"
    content = json.loads(path.read_text())
    *tables, last = key
    reduce(lambda table, name: table.setdefault(name, {}), tables, content["meta"])[last] = found
    path.write_text(json.dumps(content))
    err = refused("convert", "run", "x.csv")
    assert f"{file}.json: field 'meta.{'.'.join(key)}" in err
    assert "found" in err if file == "run" else "Input should be a valid" in err


@pytest.mark.parametrize(
    "command",
    ["identify circle --plant linear-axis --out m.json", "runs --archive circle", "convert good.csv circle",
     "archive rebuild --archive circle", "run jog --bench brevini-hpv41 --out circle/x"],
)  # fmt: skip
def test_links_that_go_round_in_a_circle_are_told(command, folder, refused):
    (folder / "circle").symlink_to("circle")
    err = refused(*command.split())
    assert "circle" in err and "fault of this program" not in err


def test_check_folder_whose_name_is_no_text(tmp_path):
    with pytest.raises(FileError, match="its name is no text in UTF-8"):
        check_folder(tmp_path / os.fsdecode(b"b\xff") / "x")


def test_resolved_where_the_working_folder_is_gone(tmp_path, monkeypatch):
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    with pytest.raises(FileError, match="the working folder is gone"):
        resolved(Path("runs"))
