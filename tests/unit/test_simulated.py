"""What was recorded on a simulated valve says so wherever its verdict stands."""

from __future__ import annotations

import csv
import json
import sqlite3
from contextlib import closing

import pikepdf
import pytest

import hil
from hil.bench.find import benches
from hil.bench.read import read_bench
from hil.bench.rehearsal import twin_of
from hil.bench.rig import conditions_of
from hil.findings.tables import write_csv
from hil.record.conditions import oil_contradiction
from hil.record.run_folder.header import read_header
from hil.record.simulated import is_simulated
from hil.session.kept_results import results_of_run
from tests.page import read_page
from tests.passports import run_of

# on one worker: its runs are made once
pytestmark = [pytest.mark.xdist_group("simulated"), pytest.mark.usefixtures("unprinted")]

OLD = '[devices.daq]\nsimulated = "in_process"\n'
REAL = '[devices.daq]\ndriver = "ni"\n'


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "one"
    made = hil.run("step_response", "brevini-hpv41", folder, levels=(0, 80), limits=["rise=..0.9 s"], serial="A7")
    assert made.findings.verdict == "pass"
    return folder


@pytest.mark.parametrize(
    ("meta", "simulated"),
    [
        ({"simulated": True}, True), ({"simulated": False, "bench_file": OLD}, False),
        ({"bench_file": OLD}, True), ({"bench_file": REAL}, False),
        ({"bench_file": REAL + OLD.replace("daq", "oil")}, True),
        ({}, False), ({"bench_file": "not = [toml"}, False), ({"bench_file": "devices = 3"}, False),
    ],
)  # fmt: skip
def test_is_simulated_goes_by_the_header_else_by_its_bench_file(meta, simulated):
    assert is_simulated(meta) is simulated


def test_a_header_says_it_of_every_simulated_bench_and_of_twins():
    real = read_bench(benches()["hpv41-usb-6211"])
    assert conditions_of(real.bench)["simulated"] is False
    assert conditions_of(twin_of(real).bench)["simulated"] is True
    assert conditions_of(read_bench(benches()["brevini-hpv41"]).bench)["simulated"] is True


def test_report_and_verdict_line_and_results_say_it(run, prints):
    assert read_header(run).meta["simulated"] is True
    assert "SIMULATED Recorded on a simulated device" in read_page(run / "report.html").text
    assert 'data-across="SIMULATED"' in (run / "report.html").read_text(encoding="utf-8")
    assert "verdict: pass (SIMULATED)\n" in prints("results", run)
    assert json.loads(prints("results", run, "--json", "-"))["simulated"] is True


def test_results_of_a_version_without_it_go_by_the_header(run, tmp_path):
    content = json.loads((run / "results.json").read_text(encoding="utf-8"))
    del content["simulated"]
    for name in ("run.json", "end.json"):
        (tmp_path / name).write_bytes((run / name).read_bytes())
    (tmp_path / "results.json").write_text(json.dumps(content), encoding="utf-8")
    assert results_of_run(tmp_path).simulated is True


@pytest.mark.usefixtures("stranger")
@pytest.mark.parametrize("simulated", [True, False])
def test_lists_trends_and_comparisons_say_it(simulated, tmp_path, prints):
    old, new = (run_of(tmp_path / "lab", simulated=simulated, name=name, hour=hour) for name, hour in RUNS)
    prints("archive", "rebuild", "--archive", tmp_path / "lab")
    lab = ("--archive", tmp_path / "lab")
    assert prints("runs", *lab).count("pass (SIMULATED)") == 2 * simulated
    assert [row["simulated"] for row in json.loads(prints("runs", *lab, "--json"))] == 2 * [simulated]
    assert prints("trend", "gain", "--serial", "SN-7", *lab).count("(SIMULATED)") == 2 * simulated
    assert prints("compare", old, new).count("(SIMULATED)") == 2 * simulated
    told = json.loads(prints("compare", old, new, "--json"))
    assert told["simulated"] == 2 * [simulated]
    values = prints("results", old, "--csv", "-")
    assert values.splitlines()[1].endswith(f",{simulated}")


RUNS = (("old", 8), ("new", 9))


@pytest.mark.usefixtures("stranger")
def test_real_units_are_no_population_of_a_simulated_one(tmp_path, prints):
    run_of(tmp_path / "lab", "REAL", name="real")
    run_of(tmp_path / "lab", "TWIN", simulated=True, name="twin")
    unit = run_of(tmp_path / "lab", "A", simulated=True, name="a")
    told = prints("compare", "--population", unit, "--archive", tmp_path / "lab", "--json")
    assert json.loads(told)["others"] == ["TWIN"]


@pytest.mark.usefixtures("stranger")
def test_an_index_of_a_version_without_it_is_filled_from_the_headers(tmp_path):
    lab = tmp_path / "lab"
    run_of(lab, simulated=True)
    hil.find_runs(archive=lab)
    with closing(sqlite3.connect(lab / "archive.sqlite")) as index:
        index.executescript("ALTER TABLE run DROP COLUMN simulated; UPDATE alembic_version SET version_num = '0003'")
    assert [entry.simulated for entry in hil.find_runs(archive=lab)] == [True]


def test_models_beside_a_simulated_run_say_it(run, tmp_path, prints):
    model, page = tmp_path / "model.json", tmp_path / "page.html"
    hil.save_model(hil.typical_model("brevini-hpv41"), model)
    assert f"{run} (SIMULATED)\n" in prints("compare", "--model", model, run)
    found = hil.identify(run, "brevini-hpv41", page=page)
    assert found.as_dict()["simulated"] is True
    assert 'data-across="SIMULATED"' in page.read_text(encoding="utf-8")
    assert found.text.splitlines()[0] == "brevini-hpv41 (SIMULATED)" and "(SIMULATED)" in found.model._repr_html_()
    hil.save_model(found.model, model)
    assert "(SIMULATED)" in prints("export", model, "--to", "matlab").splitlines()[0]
    assert prints("export", model, "--to", "csv").splitlines()[1].endswith(",True")


def test_every_table_of_results_says_it_in_each_row(run, tmp_path):
    for written in write_csv(results_of_run(run), tmp_path / "values.csv"):
        assert {row["simulated"] for row in csv.DictReader(written.read_text("utf-8").splitlines())} == {"True"}


def test_a_diagnosis_and_a_difference_say_it_in_the_line_of_the_verdict(run, tmp_path, prints):
    model = tmp_path / "model.json"
    hil.save_model(hil.typical_model("brevini-hpv41"), model)
    words = prints("diagnose", "--model", model, run, "--out", tmp_path / "d", "--budget", "0.01")
    told = json.loads((tmp_path / "d" / "diagnosis.json").read_text(encoding="utf-8"))
    assert told["simulated"] is True
    assert f"{told['verdict']} (SIMULATED): " in words
    words = prints("diff", run, run, "--model", model, "--budget", "0.01")
    assert any(line.endswith("changed (SIMULATED)") or line == "unexplained (SIMULATED)" for line in words.splitlines())


@pytest.mark.usefixtures("stranger")
@pytest.mark.parametrize("simulated", [True, False])
def test_a_passport_and_its_check_say_it(simulated, tmp_path, prints):
    run = run_of(tmp_path, simulated=simulated)
    passport = tmp_path / "p.pdf"
    assert ("(SIMULATED)" in prints("passport", run, "--out", passport, "--no-model")) is simulated
    with pikepdf.open(passport) as pdf:
        assert json.loads(pdf.attachments["passport.json"].get_file().read_bytes())["simulated"] is simulated
        certificate = pdf.attachments["certificate.xml"].get_file().read_bytes().decode()
    assert ("SIMULATED: HPV41" in certificate) is simulated
    assert ("SIMULATED" in prints("verify", passport)) is simulated
    assert json.loads(prints("verify", passport, "--json"))["simulated"] is simulated


@pytest.mark.usefixtures("stranger")
@pytest.mark.parametrize("simulated", [True, False])
def test_every_page_of_a_passport_has_it_across(simulated, tmp_path, monkeypatch):
    pages = {}
    for language in ("en", "de"):
        monkeypatch.setenv("HIL_LANGUAGE", language)
        hil.issue_passport([run_of(tmp_path, simulated=simulated, name=language)], tmp_path / "p.pdf", identify=False)
        with pikepdf.open(tmp_path / "p.pdf") as pdf:
            pages[language] = [_drawn_big(page) for page in pdf.pages]
    assert all(len(found) == 2 for found in pages.values())
    assert {big for found in pages.values() for big in found} == {simulated}


def _drawn_big(page: pikepdf.Page) -> bool:
    """Whether text of 64 points stands on it, as none but the word across it does."""
    operations = pikepdf.parse_content_stream(page)
    return any(str(one.operator) == "Tf" and float(one.operands[1]) == 64.0 for one in operations)


@pytest.mark.parametrize(
    ("fluid", "grade", "notes", "contradicts"),
    [
        ("HLP 46", "ISO VG 32", {}, True), ("HLP 32", "ISO VG 32", {}, False), ("mineral oil", "ISO VG 32", {}, False),
        ("mineral oil", "ISO VG 32", {"oil": "ISO VG 46"}, True), ("mineral oil", "32", {"Fluid": "HVLP-46"}, True),
        ("Tellus 25", "ISO VG 46", {}, False), ("HLPD 46", "", {}, False), ("HFC 46", "ISO VG 46", {}, False),
        ("HLP 47", "ISO VG 32", {}, False), ("mineral oil", "ISO VG 32", {"order": "HLP 46"}, False),
    ],
)  # fmt: skip
def test_an_oil_of_another_viscosity_class_is_noticed(fluid, grade, notes, contradicts):
    assert bool(oil_contradiction({"fluid": fluid, "viscosity_class": grade}, notes)) is contradicts


def test_check_and_the_report_name_the_contradiction(tmp_path, command_line):
    bench = tmp_path / "bench.toml"
    bench.write_text('based_on = "brevini-hpv41"\n[conditions]\nfluid = "HLP 46"\n', encoding="utf-8")
    words = "The oil is stated as HLP 46, its viscosity class as ISO VG 32; one of them is wrong."
    status, out, err = command_line("check", bench)
    assert status == 0 and words in " ".join((out + err).split())
    hil.run("step_response", bench, tmp_path / "run", levels=(0, 80))
    assert words in read_page(tmp_path / "run" / "report.html").text
