"""Cases: repeatable from seed and label, sealed, and written without a trace of the truth."""

from __future__ import annotations

import ast
import hashlib
from pathlib import Path

import numpy as np
import pytest

from tests.drawn import LEAK, SEED, drawn
from tests.studies.proof.cases.draw import changed, draw
from tests.studies.proof.cases.folder import unseen, write_case
from tests.studies.proof.cases.label import SEVERITIES, Label, parse
from tests.studies.proof.cases.seal import BrokenSealError, publish, read, verify
from tests.studies.proof.cases.severity import Stand, strengthened
from tests.studies.proof.cases.truth import from_json, to_json
from tests.studies.proof.plan import Plan, kinds
from tests.studies.proof.truth.catalog import PLANTS
from tests.studies.proof.truth.law import Hidden
from tests.studies.proof.truth.noise import Colour, converted, noise

pytestmark = pytest.mark.xdist_group("proof")  # what is drawn once is for all of them

OFFSET = Label("sensor_offset", "brevini-hpv41", "half", 3)


@pytest.fixture(scope="module")
def leak():
    return drawn(LEAK)


@pytest.fixture(scope="module")
def written(leak, tmp_path_factory):
    """The folder of the case, which nobody changes."""
    folder = tmp_path_factory.mktemp("case") / leak.label.veiled(leak.seed)
    write_case(leak, folder)
    return folder


def test_a_label_survives_being_written():
    assert parse(str(OFFSET)) == OFFSET


def test_a_case_is_drawn_again_exactly(leak):
    assert draw(SEED, LEAK) == leak


def test_another_seed_draws_another_case(leak):
    other = draw(SEED + 1, LEAK)
    assert other.unit != leak.unit
    assert other.hidden != leak.hidden
    assert other.salt != leak.salt


def test_a_changed_speed_of_both_directions_is_no_asymmetry():
    plant = PLANTS["hydraforce-sp08-47c"]
    before = plant.unit(np.random.default_rng(0))
    after = [changed(plant, before, np.random.default_rng(seed)) for seed in range(20)]
    moved = [unit["speed_out"] / before["speed_out"] for unit in after]
    assert [unit["speed_in"] / before["speed_in"] for unit in after] == pytest.approx(moved)
    assert 0 < sum(factor != 1.0 for factor in moved) < len(moved)


def test_a_truth_survives_being_written(leak):
    assert from_json(to_json(leak)) == leak


def test_a_law_whose_solver_diverges_is_refused(monkeypatch, leak):
    """It would show at any strength, and next to nothing be concealed."""
    monkeypatch.setattr(Stand, "sigma", lambda *_: 1e4)
    on = Stand(leak.healthy(), {}, 0, 1, {})
    with pytest.raises(RuntimeError, match="diverges"):
        strengthened(Hidden(leak.hidden[0].law, leak.hidden[0].parameters), on, 5.0)


def test_full_severity_shows_with_three_to_ten_deviations(leak):
    assert 3.0 * 0.9 < leak.sigma[0] < 10.0 * 1.1
    assert 0.1 < leak.distinct_sigma[0] < leak.sigma[0]


def test_an_offset_shows_as_large_as_it_is():
    truth = draw(SEED, OFFSET)
    assert truth.sigma[0] == pytest.approx(abs(truth.hidden[0].parameters[0]) / 0.3, rel=1e-6)
    assert 1.5 * 0.9 < truth.sigma[0] < 5.0 * 1.1  # half severity


def test_a_case_tells_nothing_but_its_recordings(written):
    folder = written
    files = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    assert files[0].startswith("baseline/")
    assert [f for f in files if not f.startswith(("baseline/", "changed/"))] == ["case.toml"]
    assert len(files) == 9
    assert "leak" not in folder.name
    assert all("leak" not in name for name in files)
    assert (folder / "case.toml").read_text() == (
        'valve = "cummins-efc"\nsample_rate_hz = 250\ninput = "current [A]"\noutput = "pressure [psi]"\n'
    )


def test_recordings_are_the_same_each_time_and_hold_the_stated_noise(leak, written, tmp_path):
    write_case(leak, tmp_path)
    first, second = (sorted((folder / "changed").glob("*.csv")) for folder in (written, tmp_path))
    assert [_digest(path) for path in first] == [_digest(path) for path in second]
    recorded = unseen(leak)
    residual = np.concatenate([r.channels[:, 0] - r.clean for r in recorded])
    assert residual.std() == pytest.approx(0.6, rel=0.05)
    assert abs(residual.mean()) < 0.05


def test_a_recording_repeats_what_was_played(written):
    path = written / "baseline" / "step-response.csv"
    assert path.read_text().splitlines()[0] == "time [s],current [A],pressure [psi]"
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    assert np.diff(rows[:, 0]) == pytest.approx(0.004)
    assert set(np.round(np.unique(rows[:, 1]), 9)) == {1.0, 1.2, 1.4, 1.6, 1.8, 2.0}


def test_seals_hold_until_a_truth_is_touched(leak, tmp_path):
    path, seals = tmp_path / "case.json", tmp_path / "seals.sha256"
    path.write_text(to_json(leak))
    fingerprint = publish({"case": path}, seals)
    assert fingerprint == _digest(seals)
    verify(path, read(seals)["case"])
    path.write_text(to_json(leak).replace("leakage", "friction"))
    with pytest.raises(BrokenSealError, match=r"case\.json"):
        verify(path, read(seals)["case"])
    with pytest.raises(BrokenSealError):
        publish({"case": path}, seals)


def test_seals_once_published_stay_when_more_are_added(leak, tmp_path):
    first, second, seals = tmp_path / "a.json", tmp_path / "b.json", tmp_path / "seals.sha256"
    first.write_text(to_json(leak))
    second.write_text("{}")
    publish({"a": first}, seals)
    before = seals.read_text()
    publish({"b": second}, seals)
    assert before in seals.read_text()
    assert set(read(seals)) == {"a", "b"}


@pytest.mark.parametrize("colour", [Colour(), Colour(0.5, 0.9), Colour(0.3, 0.99), Colour(hum=0.3, hum_hz=50.0)])
def test_noise_has_the_stated_deviation_whatever_its_colour(colour):
    found = noise(colour, 0.3, 200_000, np.random.default_rng(1))
    assert found.std() == pytest.approx(0.3, rel=0.03)


def test_coloured_noise_remembers():
    white, red = (noise(c, 1.0, 100_000, np.random.default_rng(2)) for c in (Colour(), Colour(0.5, 0.9)))
    assert abs(np.mean(white[1:] * white[:-1])) < 0.02
    assert np.mean(red[1:] * red[:-1]) == pytest.approx(0.45, abs=0.03)


def test_a_converter_of_16_bits_rounds_and_clips():
    assert converted(np.array([0.0, 0.004, 1000.0]), 150.0) == pytest.approx([0.0, 150 / 32768, 150.0])


def test_a_plan_spreads_each_effect_over_its_plants():
    labels = Plan(cases=4, severities=("full", "eighth")).labels()
    assert len(labels) == len(set(labels))
    backlash = [label for label in labels if label.kind == "backlash" and label.severity == "full"]
    assert [label.plant for label in backlash] == [
        "brevini-hpv41",
        "cummins-efc",
        "hydraforce-sp08-47c",
        "brevini-hpv41",
    ]
    assert sum(label.kind == "none" for label in labels) == 60
    assert {label.kind for label in labels} == set(kinds())
    assert {label.severity for label in labels if label.kind == "backlash"} == {"full", "eighth"}
    assert set(SEVERITIES) >= {label.severity for label in labels}


def test_a_plan_can_be_narrowed():
    labels = Plan(cases=2, plants=("linear-axis",), only=("friction", "sensor_offset")).labels()
    assert {(label.kind, label.plant) for label in labels} == {("friction", "linear-axis")}


def test_the_truth_and_its_cases_take_nothing_from_the_program_under_test():
    root = Path(__file__).parents[1] / "studies" / "proof"
    sources = [*(root / "truth").rglob("*.py"), *(root / "cases").rglob("*.py"), *(root / "score").rglob("*.py")]
    assert len(sources) > 30
    imported = {name for path in sources for name in _imports(path)}
    assert "numpy" in imported
    assert not {name for name in imported if name.split(".")[0] in ("hil", "drivers", "sim_devices", "procedures")}


def _imports(path: Path) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            names.add(str(node.module))
    return names


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
