"""Changed or not, of many units: the gate of a diagnosis, a row of one table for each."""

from __future__ import annotations

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

import hil
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.intake.problem import pose
from hil.diagnosis.screening import Screening, screen
from hil.diagnosis.skeleton.rows import columns_of, rows_of
from hil.diagnosis.skeleton.table import table_of
from hil.errors import SettingError
from hil.identification.grey_box.identify import fit_plant
from hil.identification.preparation.experiment import Experiment, for_model
from hil.physics.model import Model, save_model, typical_model
from hil.physics.simulate import ActiveEffect
from hil.record.read import write_recording
from hil.record.recording import recording
from hil.session import fleet
from tests.concealed import NOISE, PLANT, records
from tests.flap import FLAP, recorded

pytestmark = pytest.mark.xdist_group("screening")  # on one worker: the model is fitted once

FIRST, WORN = 3.0, 8.0


@pytest.fixture(scope="module")
def lacking():
    """Identified from a unit that sticks, by a plant that does not."""
    firsts = [recorded(f"first-{k}", FIRST, k) for k in (1, 2, 3)]
    model = fit_plant(typical_model(FLAP.name), firsts).model
    table = table_of(model, firsts)
    assert table is not None
    return replace(model, skeleton=table.as_dict())


def later(model: Model, coulomb: float, *seeds: int) -> list[Experiment]:
    return [recorded(f"later-{seed}", coulomb, seed).reading_at(model.read_at) for seed in seeds]


@pytest.mark.parametrize("coulomb", [FIRST, WORN])
def test_it_says_what_the_gate_of_the_diagnosis_says(lacking, coulomb):
    experiments = later(lacking, coulomb, 7, 8)
    found, _ = screen(lacking, experiments)
    said = diagnose(lacking, experiments).diagnosis
    assert said.gate is not None
    assert (found.z, found.needed, found.shows_as) == tuple(said.gate[name] for name in ("z", "needed", "shows_as"))
    assert found.verdict == ("changed" if said.gate["is_alarm"] else "consistent")
    assert (found.verdict == "consistent") == (said.verdict == "consistent")
    assert found.fit == pytest.approx(min(fit.nominal for fit in said.recordings.values()), abs=0.1)


def test_a_coarser_channel_is_a_change_too(lacking):
    model = replace(lacking, origin={**lacking.origin, "resolution": 1e-4})
    coarse = [replace(e, output=np.round(e.output / 0.02) * 0.02) for e in later(model, FIRST, 7, 8)]
    found, _ = screen(model, coarse)
    assert (found.verdict, found.shows_as) == ("changed", "quantisation")


def test_one_recording_alone_near_the_threshold_is_unsure(lacking):
    """As the diagnosis says of its own gate."""
    experiments = later(lacking, 5.0, 7)
    found, _ = screen(lacking, experiments)
    said = diagnose(lacking, experiments).diagnosis
    assert said.gate is not None
    assert (found.verdict == "unsure") == said.gate["is_unsure"]


def test_a_model_that_keeps_nothing_cannot_be_asked(lacking):
    with pytest.raises(SettingError, match="keeps nothing of the recordings"):
        screen(replace(lacking, skeleton=None), later(lacking, FIRST, 7))


def test_a_screening_is_read_as_it_was_written():
    made = Screening("unsure", 6.0, 5.5, "friction force", None, simulated=True)
    assert Screening(**json.loads(json.dumps(made.as_dict()))) == made


def test_units_that_were_driven_alike_share_what_the_library_changes_in_them(monkeypatch):
    model, simulations, respond = typical_model(PLANT), [], Experiment.respond

    def counted(self, *arguments, **how):
        simulations.append(self.name)
        return respond(self, *arguments, **how)

    def rows(e, **more):
        del simulations[:]
        return rows_of(model, [e], columns, {"output": NOISE, **more}, 0.02)

    (steps, sweep, _), (leaking, *_) = (
        [for_model(model, one) for one in records(effects)]
        for effects in ((), (ActiveEffect("leakage", "flow", {"leak": 2.0, "fall": 0.5, "lean": 0.0}),))
    )
    columns = columns_of(pose(model, [steps]))[:30]
    monkeypatch.setattr(Experiment, "respond", counted)
    own, made = rows(steps), len(simulations)
    shared = rows(leaking)  # one command, two outputs
    assert len(simulations) < 4 < len(columns) < made
    assert np.array_equal(own.changes, shared.changes) and not np.array_equal(own.misfit, shared.misfit)
    assert not np.array_equal(rows(sweep).changes, own.changes) and len(simulations) == made
    anew = rows(leaking, another=1.0)
    assert np.array_equal(anew.changes, shared.changes) and len(simulations) == made


@pytest.fixture
def units(lacking, tmp_path):
    """A unit as it was, a worn one, and one whose sensor is dead."""
    made = []
    for name, coulomb in (("good", FIRST), ("worn", WORN), ("dead", FIRST)):
        folder = tmp_path / "units" / name
        folder.mkdir(parents=True)
        save_model(lacking, folder / "nominal.json")
        for e in later(lacking, coulomb, 7, 8):
            output = np.ones(len(e.output)) if name == "dead" else e.output
            channels = {e.input: e.drive.inputs[0], e.output_heading: output}
            write_recording(recording(e.name, e.time_s, channels), folder / f"{e.name}.csv")
        made.append(folder)
    return made


@pytest.fixture
def screened(command_line, tmp_path):
    def called(folders, *more):
        told = command_line("diagnose", "--screen", "--out", tmp_path / "out", "--fleet", *folders, *more)
        assert told.status == 2  # one cannot be screened
        return told.out

    return called


def test_a_fleet_gets_one_table_and_goes_on_where_it_was_broken_off(screened, units, tmp_path, monkeypatch):
    worked = []
    monkeypatch.setattr(
        fleet, "over_processes", lambda work, tasks, *_: (worked.append(task.name) or work(task) for task in tasks)
    )
    out = tmp_path / "out"
    whole = json.loads(screened(units, "--json"))
    assert whole["schema"] == "hil.fleet/1" and worked == ["good", "worn", "dead"]
    verdicts = [one["screening"] and one["screening"]["verdict"] for one in whole["units"]]
    assert verdicts == ["consistent", "changed", None]
    rows = list(csv.DictReader((out / "screening.csv").read_text(encoding="utf-8").splitlines()))
    assert [row["verdict"] for row in rows] == ["consistent", "changed", ""]
    assert float(rows[1]["z"]) == whole["units"][1]["screening"]["z"] > float(rows[1]["needed"])
    assert "stands at 1 all the time" in rows[2]["error"] == whole["units"][2]["error"]
    assert sorted(path.name for path in out.iterdir()) == ["fleet.jsonl", "screening.csv"]

    lines = (out / "fleet.jsonl").read_text(encoding="utf-8").splitlines(keepends=True)
    (out / "fleet.jsonl").write_text(lines[0] + lines[2] + lines[1][:40], encoding="utf-8")  # broken off in the second
    del worked[:]
    assert json.loads(screened(units, "--json")) == whole and worked == ["worn"]
    table = screened(units).splitlines()
    assert table[0].split() == ["unit", "verdict", "z", "needed", "fit", "shows", "as"]
    assert table[-1] == "3 units: 1 changed, 1 consistent, 1 not screened"
    assert worked == ["worn"]  # and not again: what was broken off spoils no line after it
    answers = hil.diagnose_fleet(units, screen=True)
    assert [one.screened and one.screened.verdict for one in answers] == verdicts
    assert answers[1].as_text() == "worn: changed"


def test_screening_needs_a_fleet_and_a_fleet_takes_no_question(command_line, units, tmp_path):
    model = units[0] / "nominal.json"
    alone = command_line("diagnose", "--screen", "--out", tmp_path / "out", "--model", model, units[0])
    asked = command_line("diagnose", "--out", tmp_path / "out", "--question", "changed", "--fleet", units[0])
    for told, why in ((alone, "--screen"), (asked, "--fleet")):
        assert told.status == 2 and why in told.err
