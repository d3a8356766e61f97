"""The runner of real recordings, on recordings made up for it."""

import numpy as np
import pytest
from typer import Typer
from typer.testing import CliRunner

from hil.physics.compose import kernel, plant
from hil.physics.simulate import ActiveEffect, Drive, simulate
from hil.record.read import write_recording
from hil.record.recording import recording
from tests.studies.markdown import put
from tests.studies.proof.real.__main__ import main
from tests.studies.proof.real.prove import prove
from tests.studies.proof.real.publish import START, STOP, cells, parameters
from tests.studies.proof.real.sets import SETS

SEAL = next(real for real in SETS if real.name == "pneumatic seal")
FILES = {"nap310-3bar.csv": 3.0, "nap310-7bar.csv": 7.0, "nap310-5bar.csv": 5.0}


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """A folder with the files of one set: two to be fitted, one to be kept back."""
    folder = tmp_path_factory.mktemp("recordings")
    (folder / SEAL.folder).mkdir()
    cylinder = plant(SEAL.plant)
    seal = ActiveEffect("seal_friction", "seal", {"share": 0.02, "constant": 0.8, "presliding": 0.3})
    generator = np.random.default_rng(4)
    time_s = 0.01 * np.arange(1600)
    for name, bar in FILES.items():
        inputs = np.vstack([17.0 - 19.0 * np.cos(time_s), bar + 0.05 * np.sin(0.9 * time_s)])
        force = simulate(cylinder, cylinder.typical, Drive(inputs, np.nan, 0.01), [seal])[0]
        force += 0.05 * generator.standard_normal(len(force))
        columns = {"displacement [mm]": inputs[0], "pressure [bar]": inputs[1], "force [N]": force}
        write_recording(recording(name, time_s, columns), folder / SEAL.folder / name)
    return folder


@pytest.fixture
def run():
    app = Typer()
    app.command()(main)
    return app


def test_a_set_is_fitted_and_judged_on_what_was_kept_back(recordings):
    outcome = prove(SEAL, recordings)
    assert outcome.failure == ""
    assert outcome.verdict == "explained"
    assert outcome.named == ("seal_friction",)
    assert outcome.seen is not None and outcome.seen.count == 2
    assert outcome.unseen is not None and outcome.unseen.count == 3  # the rest of two files, and a third one
    assert outcome.unseen.nominal < 60.0 < 97.0 < outcome.unseen.corrected
    assert outcome.unseen.by_hand == pytest.approx(outcome.unseen.corrected, abs=0.1)  # the same physics, known before
    assert "seal friction" in cells(outcome)[3]
    assert "N" in parameters(outcome)


@pytest.mark.parametrize("real", SETS, ids=lambda real: real.name)
def test_what_is_fitted_by_hand_is_physics_that_its_plant_has(real):
    assert {*real.by_hand} <= {site.key for site in kernel(real.plant).sites}


def test_an_absent_folder_is_one_line_and_status_two(run, tmp_path):
    absent = tmp_path / "nowhere"
    result = CliRunner().invoke(run, ["--recordings", str(absent)])
    assert result.exit_code == 2
    assert result.stderr.strip().splitlines() == [result.stderr.strip()]
    assert str(absent) in result.stderr
    empty = CliRunner().invoke(run, ["--recordings", str(tmp_path)])
    assert empty.exit_code == 2
    assert "emps" in empty.stderr


def test_a_broken_recording_fails_its_set_and_no_other(tmp_path):
    (tmp_path / SEAL.folder).mkdir()
    (tmp_path / SEAL.folder / "nap310-3bar.csv").write_text("time [s],displacement [mm]\n0,1\n0.01,2\n")
    outcome = prove(SEAL, tmp_path)
    assert "nap310-3bar.csv" in outcome.failure
    assert "failed" in cells(outcome)[2]


def test_the_tables_go_between_their_marks(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"# Title\n\n{START}\nold\n{STOP}\n\nrest\n")
    for made in ("new", "newer"):
        put(page, START, STOP, made)
        assert page.read_text() == f"# Title\n\n{START}\n\n{made}\n\n{STOP}\n\nrest\n"
