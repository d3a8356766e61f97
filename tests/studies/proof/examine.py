"""Examine a diagnoser on one sealed case."""

from __future__ import annotations

import json
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from .cases.folder import Recorded, unseen, write, write_case
from .cases.seal import verify
from .cases.truth import Truth, from_json
from .diagnosers import Diagnoser
from .score.coverage import intervals
from .score.gap import LEAST_GAP_SIGMA, fit_percent, gap_closed, misfit_sigma
from .score.judge import judge
from .score.result import Result, failed, judged
from .truth.law import Array


def examine(sealed: Path, published: str, diagnoser: Diagnoser, kept: Path, every: int = 1) -> Result:
    """Write the recordings of a case, have it diagnosed, open the truth, and score.

    Args:
        sealed: File of the truth.
        published: Its fingerprint, as it was published.
        diagnoser: Program under test; it sees a folder with a veiled name, and only healthy and changed recordings.
        kept: Where its diagnosis is kept.
        every: Hand over every so-manyth recording only.
    """
    truth = from_json(sealed.read_text())
    with tempfile.TemporaryDirectory(prefix="proof-") as place:
        case = Path(place) / truth.label.veiled(truth.seed)
        write_case(truth, case)
        seconds: dict[str, float] = {}
        try:
            _diagnose(diagnoser, truth.plant.name, case, seconds, every)
        except Exception as error:  # whatever the program under test does, the proof goes on and counts it
            return failed(truth, f"{type(error).__name__}: {error}", seconds=seconds)
        kept.mkdir(parents=True, exist_ok=True)
        for name in ("diagnosis.json", "corrected.json"):
            shutil.copy(case / "answer" / name, kept / name)
        verify(sealed, published)
        return _score(truth, case, diagnoser, seconds)


def _diagnose(diagnoser: Diagnoser, plant: str, case: Path, seconds: dict[str, float], every: int) -> None:
    with _timed(seconds, "identify"):
        diagnoser.identify(sorted((case / "baseline").glob("*.csv"))[::every], plant, case / "nominal.json")
    with _timed(seconds, "diagnose"):
        diagnoser.diagnose(case / "nominal.json", sorted((case / "changed").glob("*.csv"))[::every], case / "answer")


def _score(truth: Truth, case: Path, diagnoser: Diagnoser, seconds: dict[str, float]) -> Result:
    diagnosis = json.loads((case / "answer" / "diagnosis.json").read_text())
    judgement = judge(truth, diagnosis)
    held = {interval.name: interval.holds for interval in intervals(truth, diagnosis)}
    recordings = unseen(truth)
    paths = [write(truth, recorded, case / "unseen") for recorded in recordings]
    try:
        nominal = [_simulated(diagnoser, case / "nominal.json", path) for path in paths]
        corrected = [_simulated(diagnoser, case / "answer" / "corrected.json", path) for path in paths]
    except Exception as error:  # as above; the verdict stands, but the model it left is of no use
        return failed(truth, f"simulate: {type(error).__name__}: {error}", seconds=seconds)
    return judged(truth, judgement, held=held, seconds=seconds, **_fits(truth, recordings, nominal, corrected))


def _fits(
    truth: Truth, recordings: list[Recorded], nominal: list[Array], corrected: list[Array]
) -> dict[str, float | None]:  # fmt: skip
    clean, noise = np.concatenate([r.clean for r in recordings]), truth.plant.channels[0].noise
    before = misfit_sigma(clean, np.concatenate(nominal), noise)
    after = misfit_sigma(clean, np.concatenate(corrected), noise)
    closed = None
    if truth.predictable and before > LEAST_GAP_SIGMA:
        fits = [
            float(np.mean([fit_percent(r.channels[:, 0], s) for r, s in zip(recordings, simulated, strict=True)]))
            for simulated in (nominal, corrected, [r.clean for r in recordings])
        ]
        closed = gap_closed(*fits)
    return {"nominal": before, "corrected": after, "closed": closed}


def _simulated(diagnoser: Diagnoser, model: Path, recording: Path) -> Array:
    out = recording.with_name(f"{recording.stem}-{model.stem}-simulated.csv")
    diagnoser.simulate(model, recording, out)
    return np.atleast_2d(np.loadtxt(out, delimiter=",", skiprows=1))[:, 1]


@contextmanager
def _timed(seconds: dict[str, float], stage: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    seconds[stage] = round(time.perf_counter() - start, 3)
