"""A diagnosis with a bench at hand runs the tests it asks for, within its budget, and concludes."""

from __future__ import annotations

import pytest

from hil.bench.read import read_bench
from hil.diagnosis.diagnose import Diagnosed, diagnose
from hil.errors import FileError
from hil.identification.preparation.experiment import Experiment, for_model
from hil.physics.simulate import ActiveEffect
from hil.record.folder import read
from hil.session.demo import write_bench_with
from hil.session.diagnosis import conclude
from hil.session.procedure import load_procedure
from hil.session.run import run_procedure
from tests.concealed import nominal
from tests.studies.proof.small_sines import BUDGET_S, SMALL_SINES

pytestmark = pytest.mark.usefixtures("unprinted")

WEAK_SIDE = ActiveEffect("asymmetry", "opening", {"ratio": 1.2, "gain": 1.0})


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    path = tmp_path_factory.mktemp("bench") / "worn.toml"
    write_bench_with(WEAK_SIDE, path, seed=5)
    return path


@pytest.fixture(scope="module")
def sines(bench, tmp_path_factory):
    """Small sines on one side of the valve: they cannot know that the other side is stronger."""
    given = {**SMALL_SINES, "frequencies": (0.7, 1.5), "rate_hz": 250}
    folder = tmp_path_factory.mktemp("sines") / "run"
    run_procedure(load_procedure("frequency_response"), read_bench(bench), given, folder)
    return for_model(nominal(), read(folder))


@pytest.fixture(autouse=True)
def diagnosed_once(monkeypatch):
    """The same recordings are diagnosed once, however often they are asked about: that takes seconds."""
    known: dict[tuple[Experiment, ...], Diagnosed] = {}

    def remembered(model, experiments, *others):
        asked = tuple(experiments)
        if asked not in known:
            known[asked] = diagnose(model, experiments, *others)
        return known[asked]

    monkeypatch.setattr("hil.session.diagnosis.diagnose", remembered)


def test_the_tests_that_are_asked_for_are_run_and_lead_to_the_name(bench, sines, tmp_path):
    before = conclude(nominal(), [sines], read_bench(bench), 0.0, tmp_path / "before").diagnosis
    assert before.effects == ()
    assert before.next_test is not None
    assert not (tmp_path / "before").exists()  # no budget, no test
    found = conclude(nominal(), [sines], read_bench(bench), BUDGET_S, tmp_path / "out").diagnosis
    assert [effect.name for effect in found.effects] == ["asymmetry"]
    ran = [read(folder) for folder in sorted((tmp_path / "out").glob("test-*"))]
    assert ran
    assert sum(test.time_s[-1] for test in ran) < BUDGET_S
    with pytest.raises(FileError, match="test-1"):
        conclude(nominal(), [sines], read_bench(bench), BUDGET_S, tmp_path / "out")
