"""One case in one situation over many seeds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from hil.session.procedure import load_procedure
from tests.coverage_study.cases import Case, truthful
from tests.coverage_study.recordings import driven, noisy
from tests.coverage_study.score import Tally
from tests.coverage_study.situations import Situation


@dataclass
class Outcome:
    """The tallies of one case in one situation, by the name of the figure; `strange` figures have no truth."""

    case: Case
    situation: Situation
    runs: int = 0
    tallies: dict[str, Tally] = field(default_factory=dict)
    strange: set[str] = field(default_factory=set)


def tried(case: Case, situation: Situation, seeds: range, at: Path, said: Callable[[str], None] = print) -> Outcome:
    """Evaluate the recordings of all seeds."""
    procedure = load_procedure(case.procedure)
    clean = driven(procedure, case.bench, case.settings, situation, at / "driven")
    honest = truthful(situation)
    told = clean if honest == situation else driven(procedure, case.bench, case.settings, honest, at / "truth")
    truths = case.truth(told, case.bench, honest)
    made = Outcome(case, situation, 0, {name: Tally(truth, situation.drawn) for name, truth in truths.items()})
    for seed in seeds[: max(5, round(case.share * len(seeds)))]:
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
    said(f"{case.procedure} on {case.bench}, {situation.name}: {made.runs} runs")
    return made


def settings_of(case: Case, situation: Situation) -> Mapping[str, str]:
    """As the procedure gets them."""
    return {**case.settings, **situation.settings.get(case.procedure, {})}
