"""One case in one situation over many seeds."""

from __future__ import annotations

import json
import math
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path

from hil.session.procedure import load_procedure
from tests.studies.coverage.cases import Case, truthful
from tests.studies.coverage.recordings import driven, noisy
from tests.studies.coverage.score import Tally, Truth
from tests.studies.coverage.situations import Situation

_LEAST = 5  # runs of a case in a situation


@dataclass
class Outcome:
    """The tallies of one case in one situation, by the name of the figure; `strange` figures have no truth."""

    case: Case
    situation: Situation
    runs: int = 0
    tallies: dict[str, Tally] = field(default_factory=dict)
    strange: set[str] = field(default_factory=set)


def tried(
    case: Case, situation: Situation, seeds: range, at: Path, limit_s: float = math.inf
) -> Outcome:  # fmt: skip
    """Evaluate the recordings of all seeds, or of as many as `limit_s` of processor time gives, five at least."""
    procedure = load_procedure(case.procedure)
    clean = driven(procedure, case.bench, case.settings, situation, at / "driven")
    honest = truthful(situation)
    told = clean if honest == situation else driven(procedure, case.bench, case.settings, honest, at / "truth")
    truths = case.truths(told, honest)
    made = Outcome(case, situation, 0, {name: Tally(truth, situation.drawn) for name, truth in truths.items()})
    began_s = time.process_time()
    for seed in seeds:
        if made.runs >= _LEAST and time.process_time() - began_s > limit_s:
            break
        findings = procedure.evaluate(noisy(clean, case.bench, situation, seed))
        made.runs += 1
        missing = dict.fromkeys(made.tallies)
        for measured in findings.measured:
            missing.pop(measured.name, None)
            if measured.name in made.tallies:
                made.tallies[measured.name].add(measured)
            else:
                made.strange.add(measured.name)
        for name in missing:
            made.tallies[name].untold += 1
    return made


def kept(file: Path, case: Case, situation: Situation) -> Outcome | None:
    """The outcome that a file of this name holds, if it is there."""
    if not file.exists():
        return None
    told = json.loads(file.read_text(encoding="utf-8"))
    tallies = {name: Tally(**one | {"truth": _truth(one["truth"])}) for name, one in told["tallies"].items()}
    return Outcome(case, situation, told["runs"], tallies, set(told["strange"]))


def keep(file: Path, outcome: Outcome) -> None:
    """Write an outcome, so that a study that ends early goes on where it was."""
    file.parent.mkdir(parents=True, exist_ok=True)
    told = {
        "runs": outcome.runs, "strange": sorted(outcome.strange),
        "tallies": {name: asdict(tally) for name, tally in outcome.tallies.items()},
    }  # fmt: skip
    file.write_text(json.dumps(told, default=float), encoding="utf-8")


def _truth(told: float | list[float]) -> Truth:
    return (told[0], told[1]) if isinstance(told, list) else told
