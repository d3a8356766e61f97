"""A whole proof in small, with diagnosers that know the truth, never do, or fail."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests.drawn import LEAK, SEED, drawn
from tests.studies.proof.cases.label import Label
from tests.studies.proof.cases.seal import BrokenSealError
from tests.studies.proof.cases.truth import Truth, to_json
from tests.studies.proof.diagnosers import Commands
from tests.studies.proof.publish import keep, markdown
from tests.studies.proof.run import OtherSealsError, prove
from tests.studies.proof.score.calibration import bands
from tests.studies.proof.score.result import Result
from tests.studies.proof.truth.law import Array, Hidden
from tests.studies.proof.truth.simulate import Unit, respond
from tests.studies.rates import Rate

pytestmark = pytest.mark.xdist_group("proof")  # what is drawn once is for all of them

HEALTHY = Label("none", "cummins-efc", "full", 0)
LABELS = [LEAK, HEALTHY]
TRUTHS = {label.veiled(SEED): label for label in LABELS}


def known(veiled: str) -> Truth:
    return drawn(TRUTHS[veiled])


@cache
def answered(veiled: str, hidden: tuple[Hidden, ...], command: tuple[float, ...]) -> Array:
    """The output of the unit of a case, with this in it; oracle and liar are asked the same."""
    found = known(veiled)
    return respond(Unit(found.plant, found.unit, hidden), np.array(command))[:, 0]


@dataclass(frozen=True)
class Oracle:
    """Knows every truth by the veiled name of its folder, and may lie about it."""

    lies: bool = False

    def identify(self, recordings: Sequence[Path], plant: str, model: Path) -> None:
        assert len(recordings) == 4
        assert plant == "cummins-efc"
        model.write_text(json.dumps({"case": model.parent.name, "hidden": False}))

    def diagnose(self, model: Path, recordings: Sequence[Path], out: Path) -> None:
        assert len(recordings) == 4
        assert not list(model.parent.rglob("*unseen*"))
        found = known(model.parent.name)
        names = ["friction"] if self.lies else list(found.effects)
        diagnosis = {
            "verdict": "explained" if names else "consistent",
            "effects": [{"name": name, "probability": 0.9, "parameters": {}} for name in names],
            "changed_parameters": [],
        }
        out.mkdir()
        (out / "diagnosis.json").write_text(json.dumps(diagnosis))
        (out / "corrected.json").write_text(json.dumps({"case": model.parent.name, "hidden": not self.lies}))

    def simulate(self, model: Path, recording: Path, out: Path) -> None:
        said = json.loads(model.read_text())
        hidden = known(said["case"]).hidden if said["hidden"] else ()
        time_s, command = np.loadtxt(recording, delimiter=",", skiprows=1, usecols=(0, 1), unpack=True)
        simulated = np.column_stack([time_s, answered(said["case"], hidden, tuple(command.tolist()))])
        np.savetxt(out, simulated, delimiter=",", header="time [s],pressure [psi]", comments="")


def run(out: Path, diagnoser: object, jobs: int = 1, known: Path | None = None) -> tuple[list[Result], str]:
    return prove(LABELS, SEED, out, diagnoser, jobs, lambda what, done, total: None, known=known)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def proof(tmp_path_factory):
    """A proof with an oracle that tells the truth; the one that the oracle knows already is not drawn once more."""
    out = tmp_path_factory.mktemp("proof")
    (out / "truth").mkdir()
    (out / "truth" / f"{LEAK}.json").write_text(to_json(drawn(LEAK)))
    run(out, Oracle())
    return out


def test_an_oracle_is_right_and_closes_the_whole_gap(proof):
    results, fingerprint = run(proof, None)  # everything is on disk: nobody is asked again
    assert [r.said for r in results] == ["named first", "consistent"]
    assert results[0].closed == pytest.approx(1.0, abs=0.01)
    assert results[1].closed is None  # no gap
    assert set(results[0].seconds) == {"identify", "diagnose"}
    assert fingerprint in markdown(results, SEED, fingerprint)


def test_the_seals_can_be_checked_by_anybody(proof):
    lines = (proof / "seals.sha256").read_text().splitlines()
    assert [line.split("  ")[1] for line in lines] == [f"truth/{label}.json" for label in sorted(map(str, LABELS))]


def test_a_proof_goes_on_from_published_results(proof, tmp_path):
    results, fingerprint = run(proof, None)
    keep(results, SEED, fingerprint, tmp_path)
    fresh = tmp_path / "fresh"
    _reuse_truths(proof, fresh)
    assert run(fresh, None, known=tmp_path / "proof.json")[0] == results  # nobody is asked again

    other = tmp_path / "other.json"
    other.write_text((tmp_path / "proof.json").read_text().replace(fingerprint, "0" * 64))
    with pytest.raises(OtherSealsError, match="the same seed"):
        run(fresh, None, known=other)


def test_a_truth_that_was_touched_stops_the_proof(proof, tmp_path):
    _reuse_truths(proof, tmp_path)
    (tmp_path / "seals.sha256").write_bytes((proof / "seals.sha256").read_bytes())
    touched = tmp_path / "truth" / f"{LABELS[0]}.json"
    touched.write_text(touched.read_text().replace("leakage", "friction"))
    with pytest.raises(BrokenSealError):
        run(tmp_path, Oracle())


def test_a_liar_is_found_out(proof, tmp_path):
    _reuse_truths(proof, tmp_path)
    results, _ = run(tmp_path, Oracle(lies=True))
    assert [r.said for r in results] == ["wrong name", "wrong name"]
    assert not any(r.right for r in results)
    (band,) = [band for band in bands(results) if band.kept.trials]
    assert (band.low, band.said, band.kept) == (0.8, 0.9, Rate(0, 2))
    assert markdown(results, SEED, "").count("| wrong name | friction |") == 2
    assert results[0].closed == pytest.approx(0.0, abs=0.01)


def test_what_is_not_begun_in_time_is_not_counted(proof, tmp_path):
    _reuse_truths(proof, tmp_path)
    results, fingerprint = prove(LABELS, SEED, tmp_path, Oracle(), 1, lambda *_: None, begin_until_s=0.0)
    assert results == []
    assert "not measured" in markdown(results, SEED, fingerprint)


def _break(arguments: Sequence[str], log: Path) -> None:
    raise RuntimeError("no license")


def test_a_program_that_fails_is_counted_not_forgiven(proof, tmp_path):
    _reuse_truths(proof, tmp_path)
    results, _ = prove([HEALTHY], SEED, tmp_path, Commands(_break), 2, lambda *_: None)  # in a process of its own
    assert [(r.said, r.right, r.error) for r in results] == [("failed", False, "RuntimeError: no license")]


def _reuse_truths(proof: Path, out: Path) -> None:
    (out / "truth").mkdir(parents=True)
    for label in LABELS:
        (out / "truth" / f"{label}.json").write_bytes((proof / "truth" / f"{label}.json").read_bytes())
