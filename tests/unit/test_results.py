"""The results of a run as data: schema, tables, spreadsheets, and reports made again."""

import csv
import errno
import json
import math
import shutil
from dataclasses import replace

import numpy as np
import pytest

import hil
from hil.errors import FileError, StorageError
from hil.findings.collect import results_of
from hil.findings.curves import curves_of
from hil.findings.results import Results, read_results, write_results
from hil.findings.tables import write_csv, write_xlsx
from hil.record.folder import read, write
from hil.record.measurement import RESULTS_FILE, Findings, Measurement
from hil.record.recording import Channel, Recording
from hil.report.terminal import findings_text
from hil.system import system

pytestmark = pytest.mark.usefixtures("unprinted")

GAIN = Measurement("gain", "l/min per %", "amplitude ratio", low=0.8)
RESPONSE = {
    "label": "+50 ± 5 %", "command_unit": "%", "response_unit": "l/min", "gain_unit": "l/min per %",
    "frequency_hz": np.array([0.1, 1.0]), "gain": np.array([2.0, math.nan]), "magnitude_db": np.array([0.0, -1.0]),
    "overlays": [{"frequency_hz": 0.1, "time_s": np.arange(3.0), "measured": np.arange(3.0)}],
    "model": {
        "numerator": np.array([2.0]), "denominator": np.array([1.0, 3.0]), "dead_time_s": 0.01, "unit": "l/min per %",
        "coefficients": ("b0", "a0"), "covariance": np.diag([0.04, 0.09]), "fit_percent": 99.0,
    },
}  # fmt: skip


@pytest.fixture
def results():
    channels = {"flow": Channel("flow", "l/min", np.zeros(3))}
    recording = Recording(
        "runs/first", np.arange(3.0), channels, {"procedure": "frequency_response", "valve": {"serial": "A7"}}
    )
    findings = Findings((GAIN.of(0.9, 0.01), GAIN.at("two").of(None)), {"responses": [RESPONSE, RESPONSE]}, ("a note",))
    return results_of(recording, findings)


def test_document_is_strict_json_and_reads_back(results, tmp_path):
    write_results(results, tmp_path)
    text = (tmp_path / RESULTS_FILE).read_text(encoding="utf-8")
    document = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    assert document["schema"] == "hil.results/1"
    assert document["run"] == "first"
    assert document["serial"] == "A7"
    assert document["values"][1]["value"] is None
    assert read_results(tmp_path / RESULTS_FILE) == results
    assert results["gain"].value == 0.9


def test_how_a_run_ended_otherwise_than_planned_is_part_of_its_results(results):
    why = "io: the connection is lost; NOT SAFE: nobody knows where 'command' stands"
    for outcome, ended in (("completed", None), (f"DeviceLostError: {why}", why)):
        recording = Recording("run", np.arange(3.0), {}, {"procedure": "step_response", "outcome": outcome})
        assert results_of(recording, Findings()).ended == ended
    said = findings_text(Findings(), ended=why).splitlines()
    assert said[-2] == f"the run did not end as planned: {why}" and said[-1].startswith("verdict: none")
    assert "as planned" not in findings_text(Findings())


def test_a_file_that_cannot_be_written_whole_leaves_the_one_before(results, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    targets = [(write_xlsx, tmp_path / "a.xlsx"), (write_csv, tmp_path / "a.csv")]
    for _, path in targets:
        path.write_text("before", encoding="utf-8")
    monkeypatch.setattr(system, "write", full)
    for write_it, path in targets:
        with pytest.raises(StorageError, match="No space left on device"):
            write_it(results, path)
        assert path.read_text(encoding="utf-8") == "before"
    assert sorted(one.name for one in tmp_path.iterdir()) == ["a.csv", "a.xlsx"]


def test_a_file_is_written_through_a_link_that_its_user_made(results, tmp_path):
    (tmp_path / "there").mkdir()
    (tmp_path / "here.csv").symlink_to(tmp_path / "there" / "there.csv")
    write_csv(results, tmp_path / "here.csv")
    assert (tmp_path / "here.csv").is_symlink() and (tmp_path / "there" / "there.csv").is_file()


def test_curve_has_units_raw_magnitude_and_null_for_no_number(results):
    curve = results.curves[0]
    assert [(c.name, c.unit) for c in curve.columns] == [
        ("frequency", "Hz"), ("gain", "l/min per %"), ("magnitude", "dB"), ("raw magnitude", "dB"),
    ]  # fmt: skip
    assert curve.column("gain") == (2.0, None)
    assert curve.column("raw magnitude")[0] == pytest.approx(20.0 * math.log10(2.0))
    with pytest.raises(KeyError, match="it has: frequency"):
        curve.column("phase")


def test_curves_of_one_name_are_told_apart(results):
    names = [curve.name for curve in results.curves]
    assert len(set(names)) == len(names)
    assert names[1] == "responses, +50 ± 5 %, overlays, 0.1 Hz"
    overlay = results.curves[1]
    assert [(c.name, c.unit) for c in overlay.columns] == [("time", "s"), ("measured", "l/min")]


def test_curve_of_a_stranger_is_taken_apart_by_length():
    (long, short) = curves_of({"odd": {"time_s": np.arange(4.0), "levels": [1.0, 2.0], "text": ["a", "b"]}})
    assert (long.name, short.name) == ("odd", "odd, levels")
    assert len(short.rows) == 2


def test_transfer_function_carries_its_coefficients_and_their_covariance(results):
    fitted = results.transfer_functions[0]
    assert fitted.name == "responses, +50 ± 5 %, model"
    assert fitted.coefficient_values == (2.0, 3.0)
    assert fitted.covariance == ((0.04, 0.0), (0.0, 0.09))


def test_csv_has_values_and_each_curve_beside_it(results, tmp_path):
    written = write_csv(results, tmp_path / "first.csv")
    assert len(written) == 1 + len(results.curves)
    rows = list(csv.DictReader((tmp_path / "first.csv").read_text(encoding="utf-8").splitlines()))
    assert (rows[0]["name"], float(rows[0]["value"]), rows[0]["verdict"]) == ("gain", 0.9, "pass")
    assert all(path.name.startswith("first_") for path in written[1:])
    assert "frequency [Hz],gain [l/min per %]" in written[1].read_text(encoding="utf-8")


def test_spreadsheet_has_a_sheet_for_each_curve(results, tmp_path):
    from openpyxl import load_workbook

    write_xlsx(results, tmp_path / "first.xlsx")
    book = load_workbook(tmp_path / "first.xlsx")
    assert book["values"]["C2"].value == 0.9
    functions = [[cell.value for cell in row] for row in book["transfer functions"].iter_rows()]
    assert functions[1][1:4] == ["b0", 2.0, pytest.approx(0.2)]
    assert len(book.sheetnames) == 2 + len(results.curves)


def test_results_of_another_version_are_refused(results, tmp_path):
    path = tmp_path / RESULTS_FILE
    path.write_text(results.as_json().replace("hil.results/1", "hil.results/9"), encoding="utf-8")
    with pytest.raises(FileError, match=r"'hil\.results/9'.*reads 'hil\.results/1'"):
        read_results(path)


def test_run_on_a_bench_gives_the_same_results_when_read_later(tmp_path, command_line, prints):
    run = tmp_path / "run"
    sets = ("frequencies=0.5,1,2,4", "amplitudes=20", "biases=50", "measure_s=1")
    options = [word for text in sets for word in ("--set", text)]
    prints("run", "frequency_response", "--bench", "brevini-hpv41", "--out", run, *options)
    kept = Results.model_validate_json((run / RESULTS_FILE).read_text(encoding="utf-8"))
    said = prints("results", run, "--json", "-")
    assert Results.model_validate_json(said) == kept
    assert kept.transfer_functions
    (run / RESULTS_FILE).unlink()
    said = command_line("results", run, "--json", "-")
    assert Results.model_validate_json(said.out) == kept


@pytest.fixture(scope="module")
def stepped(tmp_path_factory):
    """A run that passed, which nobody changes."""
    run = tmp_path_factory.mktemp("stepped") / "run"
    hil.run("step_response", "brevini-hpv41", run, levels=(0, 80), limits=["change=10.."])
    return run


def test_report_again_judges_by_new_limits(stepped, tmp_path, command_line):
    run = shutil.copytree(stepped, tmp_path / "run")
    (run / "report.html").unlink()
    name = read_results(run / RESULTS_FILE).values[0].name
    said = command_line("report", run, "--limit", f"{name}=1000..")
    assert said.status == 1
    assert "verdict: fail" in said.out
    assert (run / "report.html").is_file()
    assert read_results(run / RESULTS_FILE).verdict == "fail"


def test_report_of_a_run_that_was_broken_off_says_so(tmp_path, command_line):
    channels = {"flow": Channel("flow", "l/min", np.zeros(3))}
    meta = {"procedure": "frequency_response", "outcome": "stopped by Ctrl-C", "roles": {}, "settings": {}}
    write(Recording("run", np.arange(3.0), channels, meta), tmp_path / "run")
    said = command_line("report", tmp_path / "run")
    assert said.status == 0, said.err
    assert "Nothing could be evaluated of this run" in said.out
    assert "did not end as planned: stopped by Ctrl-C" in (tmp_path / "run" / "report.html").read_text(encoding="utf-8")


def test_what_a_stopped_run_measured_has_not_passed(stepped, tmp_path, command_line):
    stopped, whole = tmp_path / "stopped", read(stepped)
    write(replace(whole, meta={**whole.meta, "outcome": "Terminated: by SIGTERM"}), stopped)
    said = command_line("report", stopped, "--limit", "change=10..", "--limit", "rise=..1e-9")
    kept = read_results(stopped / RESULTS_FILE)
    assert said.status == 1
    assert kept.verdict == "fail"  # what was missed is missed
    assert {value.verdict for value in kept.values if value.name.startswith("change")} == {"cannot tell"}
    assert "it is met, but the run did not end as planned" in said.out
    assert "pass" not in said.out
    assert command_line("report", stopped, "--limit", "rise=..1e9").status == 1  # that of `change` is kept
    assert read_results(stopped / RESULTS_FILE).verdict == "cannot tell"
