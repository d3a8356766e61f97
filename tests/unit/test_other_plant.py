"""A model of another plant than the valve that was recorded is refused, or said above the verdict."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hil
from hil.diagnosis.diagnose import Diagnosed
from hil.physics.model import save_model, typical_model
from hil.physics.other_plant import other_plants, plant_of_run
from hil.record.folder import read, write
from hil.record.recording import Channel, Recording
from hil.record.run_folder.header import read_header
from hil.report.diagnosis_page import write_diagnosis_report
from hil.report.origins import origin_of
from hil.session.diagnosis import write_diagnosis
from tests.page import read_page
from tests.passports import run_of
from tests.unit.test_report_diagnosis import a_diagnosis

TOLD = "is a run of the plant cummins-efc, the model is of "


@pytest.mark.parametrize(
    ("meta", "plant"),
    [
        ({"plant": "cummins-efc"}, "cummins-efc"), ({"valve": {"plant": "cummins_efc"}}, "cummins-efc"),
        ({"valve": {"plant": "efc-good"}}, "efc-drive"), ({"valve": {"plant": "gone.json"}}, ""), ({}, ""),
        ({"valve": "HPV41"}, ""),
    ],
)  # fmt: skip
def test_a_run_says_its_plant_and_an_older_one_by_the_model_of_its_valve(meta, plant):
    assert plant_of_run(meta) == plant


@pytest.mark.parametrize(
    ("own", "model", "told"),
    [
        ("cummins-efc", "efc-drive", True), ("cummins-efc", "cummins-efc", False), ("", "efc-drive", False),
        ("cummins-efc", "transfer-function", False), ("transfer-function", "brevini-hpv41", False),
        ("a-strangers-plant", "brevini-hpv41", True),
        ("cummins-efc", "efc-measured", False), ("brevini-hpv41", "brevini_hpv41", False),
    ],
)  # fmt: skip
def test_other_plants_are_told_but_for_those_of_no_valve(own, model, told):
    assert bool(other_plants(model, [("one", {"plant": own})])) is told


def test_the_header_of_a_run_has_the_plant_of_a_model_file(tmp_path):
    save_model(typical_model("brevini-hpv41"), tmp_path / "unit.json")
    bench = tmp_path / "bench.toml"
    bench.write_text('based_on = "brevini-hpv41"\n[valve]\nplant = "unit.json"\n', encoding="utf-8")
    hil.run("step_response", bench, tmp_path / "run", levels=(0, 40))
    assert read_header(tmp_path / "run").meta["plant"] == "brevini-hpv41"


def efc_run(folder: Path) -> Path:
    time_s = np.arange(500) * 0.01
    current = 0.5 + 0.2 * np.sin(2.0 * np.pi * 0.5 * time_s)
    channels = {"current": Channel("current", "A", current), "pressure": Channel("pressure", "psi", 30.0 * current)}
    write(Recording(str(folder), time_s, channels, {"plant": "cummins-efc", "procedure": "sine"}), folder)
    return folder


def test_compare_and_diff_say_it_before_what_they_found(tmp_path, prints):
    run = str(efc_run(tmp_path / "run"))
    assert f"note: {run} {TOLD}efc-drive" in prints("compare", "--model", "efc-good", run).splitlines()[0]

    def stop(note):
        raise KeyboardInterrupt(note)

    with pytest.raises(KeyboardInterrupt, match=TOLD):  # nothing is compared yet
        hil.diff(run, run, model="efc-good", notes=stop)


def test_a_diagnosis_has_it_above_its_verdict(tmp_path):
    efc = read(efc_run(tmp_path / "run"))
    (said,) = other_plants("brevini-hpv41", [(efc.name, efc.meta)])
    diagnosis = replace(a_diagnosis(), warnings=(said, "a clipped channel"))
    write_diagnosis_report(diagnosis, tmp_path / "report.html", [origin_of(efc)])
    text = read_page(tmp_path / "report.html").text
    assert text.index(said) < text.index("The model leaves out friction")
    assert text.count(said) == 1
    assert text.index("a clipped channel") > text.index("The model leaves out friction")
    write_diagnosis(Diagnosed(diagnosis, typical_model("brevini-hpv41")), tmp_path / "out", [origin_of(efc)])
    assert json.loads((tmp_path / "out" / "diagnosis.json").read_text(encoding="utf-8"))["other_plant"] == [said]


def test_hil_diagnose_warns_first_of_another_plant(tmp_path):
    notes: list[str] = []
    found = hil.diagnose("efc-good", efc_run(tmp_path / "run"), budget_s=0.1, notes=notes.append)
    assert TOLD in notes[0]
    assert found.diagnosis.warnings[0] == notes[0]


@pytest.mark.usefixtures("stranger")
def test_a_passport_refuses_the_model_of_another_plant(tmp_path, command_line):
    run = run_of(tmp_path, plant="cummins-efc")
    out = tmp_path / "p.pdf"
    refused = command_line("passport", run, "--out", out, "--model", "hpv41-identified")
    assert refused.status == 2 and f"--model: run {TOLD}brevini-hpv41" in refused.err
    assert not out.exists()
