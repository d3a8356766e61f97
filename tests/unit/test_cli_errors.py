"""The command line says what is wrong in one line, with the exit status of the contract."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import typer

from drivers import modbus
from hil.cli.error_message import say
from hil.errors import marked
from hil.physics.model import save_model, typical_model
from hil.safety.interrupt import Terminated
from tests.links import bench_text

FLOW_PER_COMMAND = 0.5


def write_recording(path: Path, headings: str = "time [s],command [%],flow [l/min]", spoil: str = "") -> Path:
    time_s = np.arange(100) * 0.01
    command = np.where(time_s < 0.3, 30.0, 60.0)
    rows = [f"{t:g},{u:g},{FLOW_PER_COMMAND * u:g}" for t, u in zip(time_s, command, strict=True)]
    if spoil:
        rows[41] = rows[41].rpartition(",")[0] + f",{spoil}"
    path.write_text("\n".join([headings, *rows]) + "\n", encoding="utf-8")
    return path


@pytest.fixture(autouse=True)
def folder(monkeypatch, tmp_path):
    """Each command runs in a folder of its own."""
    monkeypatch.chdir(tmp_path)


IDENTIFY = ("--plant", "brevini-hpv41", "--out", "model.json")

CASES = [
    (("list", "plans"), "did you mean 'plants'"),
    (("run", "nope", "--bench", "brevini-hpv41"), "no procedure named 'nope'"),
    (("check", "nope.toml"), "nope.toml: no such bench file"),
    (("identify", "good.csv", "--plant", "brevini-hvp41", "--out", "m.json"), "did you mean 'brevini-hpv41'"),
    (("identify", "good.csv", "--plant", "nope.json", "--out", "m.json"), "nope.json: not a model file"),
    (("identify", "good.csv", *IDENTIFY, "--free", "colour"), "no parameter 'colour'; known: curve_exponent"),
    (("identify", "nan.csv", *IDENTIFY), "line 43, channel 'flow': no value (1 such of"),
    (("identify", "words.csv", *IDENTIFY), "words.csv: line 43"),
    (("identify", "mass.csv", *IDENTIFY), "unit 'kg' cannot be read as 'l/min'"),
    (("identify", "nonsense.csv", *IDENTIFY), "unknown unit 'blorp'"),
    (("identify", "swapped.csv", *IDENTIFY), "channel 'command [l/min]': unit 'l/min' cannot be read as '%'"),
    (("identify", "other.csv", *IDENTIFY), "no channel 'command'"),
    (("identify", "still.csv", *IDENTIFY), "the input never changes"),
    (("identify", "short.csv", *IDENTIFY), "3 samples; at least 20"),
    (("identify", "empty.csv", *IDENTIFY), "empty.csv"),
    (("identify", "missing.csv", *IDENTIFY), "missing.csv: no such file or folder"),
    (("identify", "good.csv", *IDENTIFY, "--input", "pressure"), "no channel 'pressure'"),
    (("compare", "--model", "nope.json", "good.csv"), "nope.json: not a model file"),
    (("simulate", "--model", "good.csv", "--input", "good.csv", "--out", "x.csv"), "good.csv: not a model file"),
    (("convert", "good.csv", "good.xyz"), "known endings: .asc, .asc.gz, .blf"),
    (("convert", "good.csv", "mass.csv"), "exists already; --overwrite replaces it"),
    (("identify", "good.csv", *IDENTIFY[:2], "--out", "nowhere/m.json"), "nowhere/m.json: there is no folder nowhere"),
    (("convert", "good.csv", "nowhere/good.csv"), "nowhere/good.csv: there is no folder nowhere"),
    (("identify", "capitals.csv", *IDENTIFY), "'command', the input of brevini-hpv41, did you mean 'Command'?"),
    (("identify", "three.csv", "--plant", "transfer-function", "--out", "m.json"), "name its channel with --input"),
    (("identify", "good.csv", "good.csv", *IDENTIFY), "good.csv: named twice; a recording counts once"),
    (("identify", "good.csv", "--plant", "brevini-hpv41", "--out", "good.csv"), "would be lost; write another file"),
    (("identify", "good.csv", "--plant", "brevini-hpv41", "--out", "folder"), "folder: is a folder; name a file"),
    (("compare", "--model", "valve.json", "alone.csv"), "no channel 'flow', the output of brevini-hpv41"),
    (("diagnose", "--model", "valve.json", "alone.csv", "--out", "d"), "no channel 'flow'"),
    (("diagnose", "--model", "valve.json", "good.csv", "./good.csv", "--out", "d"), "good.csv: named twice"),
    (("diagnose", "--model", "valve.json", "good.csv", "--out", "good.csv"), "good.csv: good.csv is a file; name a"),
    (("simulate", "--model", "valve.json", "--input", "good.csv", "--out", "./good.csv"), "good.csv: is read by this"),
    (("simulate", "--model", "valve.json", "--input", "good.csv", "--out", "no/x.csv"), "there is no folder no"),
    (
        ("simulate", "--model", "nope.json", "--input", "good.csv", "--out", "x.csv"),
        "nope.json: not a model file: No such",
    ),
    (("run", "step_response", "--bench", "brevini-hpv41", "--out", "good.csv/x"), "good.csv is a file; name a folder"),
    (
        ("identify", "good.csv", *IDENTIFY, "--free", "friction.coulomb"),
        "a plant has no effects: --plant names a model",
    ),
    (("console", "--benches", "nowhere", "--port", "0"), "nowhere: no such folder"),
    (("run", "step_response"), "--bench BENCH.toml; `hil run --help` shows what is allowed"),
    (("frobnicate",), "No such command 'frobnicate'"),
    (("identify", "good.csv"), "Missing option '--plant'; `hil identify --help` shows what is allowed"),
    (("identify", "--plant", "brevini-hpv41", "--out", "m.json"), "Missing argument 'RECORDING...'"),
    (("list", "--colour"), "No such option"),
]


@pytest.fixture
def recordings(tmp_path):
    write_recording(tmp_path / "good.csv")
    write_recording(tmp_path / "capitals.csv", "time [s],Command [%],Flow [l/min]")
    (tmp_path / "alone.csv").write_text("time [s],command [%]\n0,1\n1,2\n2,3\n", encoding="utf-8")
    save_model(typical_model("brevini-hpv41"), tmp_path / "valve.json")
    (tmp_path / "folder").mkdir()
    write_recording(tmp_path / "nan.csv", spoil="nan")
    write_recording(tmp_path / "words.csv", spoil="broken")
    write_recording(tmp_path / "mass.csv", "time [s],command [%],flow [kg]")
    write_recording(tmp_path / "nonsense.csv", "time [s],command [%],flow [blorp]")
    write_recording(tmp_path / "swapped.csv", "time [s],flow [%],command [l/min]")
    write_recording(tmp_path / "other.csv", "time [s],voltage [V],flow [l/min]")
    (tmp_path / "empty.csv").write_text("", encoding="utf-8")
    head = "time [s],command [%],flow [l/min]\n"
    (tmp_path / "short.csv").write_text(head + "0,1,2\n1,2,3\n2,3,4\n", encoding="utf-8")
    still = "".join(f"{k},50,{k % 7}\n" for k in range(50))
    rows = "".join(f"{k},{k % 2},{k % 3},{k % 5}\n" for k in range(50))
    (tmp_path / "three.csv").write_text(head.replace("flow", "flow [l/min],b") + rows, encoding="utf-8")
    (tmp_path / "still.csv").write_text(head + still, encoding="utf-8")


@pytest.mark.usefixtures("recordings")
@pytest.mark.parametrize(("arguments", "says"), CASES, ids=[" ".join(arguments) for arguments, _ in CASES])
def test_bad_input_is_one_line_and_exit_status_2(command_line, arguments, says):
    before = Path("good.csv").read_bytes()
    status, out, err = command_line(*arguments)
    assert status == 2
    assert Path("good.csv").read_bytes() == before
    assert says in err
    assert err.startswith("hil: ")
    assert err.count("\n") == 1
    assert out == ""
    assert not Path("model.json").exists()


@pytest.mark.usefixtures("recordings")
@pytest.mark.parametrize(("arguments", "says"), CASES[::4], ids=[" ".join(arguments) for arguments, _ in CASES[::4]])
def test_a_program_that_asked_for_json_reads_the_error_as_json(command_line, arguments, says):
    status, out, err = command_line(*arguments, "--json")
    document = json.loads(out)
    assert (document["schema"], document["exit_status"]) == ("hil.error/1", status) and status == 2
    assert err == f"hil: {document['error']}\n"
    assert says in err or "No such option" in err


def test_faults_of_a_bench_file_stand_in_the_json_of_the_error(command_line):
    Path("bench.toml").write_text('name = "no more"\n', encoding="utf-8")
    status, out, _ = command_line("check", "bench.toml", "--json")
    faults = json.loads(out)["faults"]
    assert status == 2 and len(faults) > 2 and all(fault.startswith("bench.toml: ") for fault in faults)


@pytest.mark.parametrize(("target", "is_json"), [("-", True), ("results.json", False)])
def test_results_print_an_error_as_json_where_their_json_was_to_go(command_line, target, is_json):
    status, out, _ = command_line("results", "nowhere", "--json", target)
    assert status == 2 and out.startswith("{") is is_json


def test_no_command_shows_the_help_and_is_exit_status_2(command_line):
    status, out, err = command_line()
    assert (status, err) == (2, "")
    assert "Commands:" in out


@pytest.mark.usefixtures("recordings")
def test_debug_adds_the_traceback(command_line):
    status, _, err = command_line("--debug", "identify", "nan.csv", *IDENTIFY)
    assert status == 2
    assert "Traceback" in err
    assert err.splitlines()[-1].startswith("hil: nan.csv: line 43")


def test_debug_is_not_asked_of_the_next_command_of_a_process(command_line):
    assert "Traceback" in command_line("--debug", "check", "nowhere.toml")[2]
    assert command_line("frobnicate")[2].startswith("hil: ")


@pytest.mark.parametrize(
    ("error", "status", "says"),
    [
        (PermissionError(13, "Permission denied", "secret"), 2, "hil: secret: Permission denied\n"),
        (ZeroDivisionError("of no use"), 2,
         "hil: a fault of this program, not of its input: ZeroDivisionError: of no use"),
        (KeyboardInterrupt(), 130, "hil: stopped\n"),
    ],
    ids=["file system", "fault", "ctrl-c"],
)  # fmt: skip
def test_what_is_raised_is_one_line(error, status, says, command_line, monkeypatch):
    def broken(_kind):
        raise error

    monkeypatch.setattr("hil.cli.commands.list_.entries", broken)
    ended = command_line("list", "plants")
    assert ended.status == status and ended.err.startswith(says) and ended.err.count("\n") == 1


def test_a_fault_in_a_package_of_others_names_its_file(command_line, install_package, tmp_path):
    """A twin of a stranger that fails is no fault of this program; nor is one that calls a library wrongly."""
    twin = '"""A twin."""\nimport json\n\ndef world(simulation, wirings):\n    return json.loads("{")\n'
    driver = Path(modbus.__file__).read_text(encoding="utf-8")
    install_package("hil.sim_devices", "twins_of_others", {"broken_gauge.py": twin})
    install_package("hil.drivers", "drivers_of_others", {"broken_gauge.py": driver})
    bench = bench_text("hpv41-modbus-tcp", ('driver = "modbus"', 'driver = "broken_gauge"'))
    (tmp_path / "bench.toml").write_text(bench, encoding="utf-8")
    status, _, err = command_line("devices", str(tmp_path / "bench.toml"))
    assert status == 2
    assert "a fault in " in err and "broken_gauge.py, line 5, which is no part of this program: JSONDecodeError" in err


def test_version_and_help_are_no_errors(command_line):
    assert command_line("--version")[:2] == (0, "hil 0.1.0\n")
    status, out, _ = command_line("--help")
    assert status == 0
    assert "identify" in out


@pytest.mark.parametrize(
    ("procedure", "bench", "said"),
    [
        ("efc_step_response", "brevini-hpv41", "command 'command' is in %; a test of an EFC states its currents in A"),
        ("pressure_current", "brevini-hpv41", "command 'command' is in %; a test of an EFC states its currents in A"),
        (
            "efc_frequency_response",
            "hydraforce-open-loop",
            "'position' is in mm; a test of an EFC needs a response in psi or another pressure",
        ),
    ],
)
def test_currents_are_not_driven_as_anything_else(command_line, procedure, bench, said):
    status, _, err = command_line("run", procedure, "--bench", bench, "--out", "r")
    assert status == 2
    assert err.splitlines()[-1] == f"hil: {said}"


@pytest.mark.usefixtures("recordings")
def test_a_unit_that_the_file_stated_otherwise_is_remarked(command_line, prints):
    status, out, _ = command_line("convert", "good.csv", "new.csv", "--unit", "flow=bar")
    assert status == 0
    assert "note: 'flow' was in l/min and is now said to be in bar; its numbers are the same" in out
    assert "note" not in prints("convert", "good.csv", "same.csv", "--unit", "flow=l/min")


def test_a_second_signal_says_no_second_end(command_line, monkeypatch):
    def stopped(_kind):
        ended = KeyboardInterrupt()
        marked(ended, 130, "outputs are safe (read back)")
        raise typer.Exit(say(ended))

    monkeypatch.setattr("hil.cli.commands.list_.entries", stopped)
    monkeypatch.setattr("hil.cli.app.raised", Terminated)  # it came in the same moment
    status, _, said = command_line("list", "plants")
    assert (status, said) == (130, "hil: stopped; outputs are safe (read back)\n")


def test_a_parameter_where_a_recording_should_be_is_told(command_line):
    write_recording(Path("steps.csv"))
    status, _, said = command_line(
        "identify", "--plant", "brevini-hpv41", "--free", "dead_time", "sensor_lag", "steps.csv", "--out", "m.json"
    )
    assert status == 2
    assert "a parameter of 'brevini-hpv41'" in said
    assert "--free a,sensor_lag" in said
