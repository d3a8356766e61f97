"""The diagnosis beside other methods, on cases of the concealment proof.

    python benchmarks/mismatch.py [--all | LABEL...]

Each method gets the same nominal model and the same changed recordings; it is judged by the names it gives, and by
the fit of its model to recordings of the same unit that nobody was given. Three cases by default, all eleven with
--all, which takes twenty minutes; others by their label. The cases are the first of seed 3, which no tolerance was
set by; the units without an effect are the first ones on each valve whose noise has a memory. Times are of the
processor, all threads together. What the peers are, and how they are set, stands at the head of their files. Needs
the extra `bench`.

A single effect is right when it is named first, a pair when both are named; "with others" is a right name among wrong
ones, or one of a pair. The gap is the share of the fit between the nominal model and the truth itself that is closed.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as `hil` itself does; peers gain by it too

import numpy as np
from _concealed import Answer, Case, conceal, fit_on_unseen, has_gap, judged, nominal_output
from table import Row, show

from hil.diagnosis.diagnose import diagnose
from hil.identification.preparation.experiment import Experiment
from hil.record.recording import Array
from tests.studies.proof.cases.label import NOTHING, parse
from tests.studies.proof.score.judge import AMONG, BOTH, CONSISTENT, FIRST, ONE, WRONG
from tests.studies.proof.truth.catalog import effects

SEED = 3
SHORT = ("friction.cummins-efc.full.000", "none.cummins-efc.full.000", "gain_bump.cummins-efc.full.000")
ALL = (
    *SHORT,
    *(f"{effect}.brevini-hpv41.full.000" for effect in ("friction", "backlash", "supply_droop", "rate_limit", "pair")),
    "none.brevini-hpv41.full.002",
    "cubic_spring.brevini-hpv41.full.000",
    "friction.hydraforce-sp08-47c.full.000",
)


def diagnosis(case: Case) -> Answer:
    found = diagnose(case.nominal, case.changed)
    model = found.corrected

    def predict(e: Experiment) -> Array:
        output: Array = e.respond(model.definition, model.values, model.active_effects)[0]
        return output

    return Answer(found.diagnosis.verdict, tuple(effect.name for effect in found.diagnosis.effects), predict)


def methods() -> dict[str, Callable[[Case], Answer]]:
    import _gaussian_process
    import _information_criterion
    import _sparse_regression

    return {
        "hil diagnose": diagnosis,
        "lowest BIC": _information_criterion.answer,
        "sparse regression, derivative (SINDy)": _sparse_regression.by_derivative,
        "sparse regression, response": _sparse_regression.by_response,
        NAMELESS: _gaussian_process.answer,
    }


NAMELESS = "Gaussian process discrepancy"


@dataclass(frozen=True, slots=True)
class Score:
    """One method on one case: what it said, how much of the gap it closed (None where there is none), and its time."""

    kind: str
    said: str
    right: bool
    gap: float | None
    seconds: float


def rows(case: Case, scores: dict[str, list[Score]]) -> Iterator[Row]:
    """Every method on one case."""
    nominal = fit_on_unseen(case, [nominal_output(case, e) for e in case.unseen])
    truth = fit_on_unseen(case, case.clean)
    for name, method in methods().items():
        start = time.process_time()
        answer = method(case)
        seconds = time.process_time() - start
        fit = fit_on_unseen(case, [answer.predict(e) for e in case.unseen])
        judgement = judged(case, answer)
        gap = (fit - nominal) / (truth - nominal) if has_gap(case) else None
        scores[name].append(Score(case.truth.label.kind, judgement.said, judgement.right, gap, seconds))
        said = "" if name == NAMELESS else f"{judgement.said}: {', '.join(answer.named) or 'no name'}"
        yield Row(name, 1e3 * seconds, f"{_fit(fit)}  {said}")


def _fit(fit: float) -> str:
    return f"fit {fit:6.2f} %" if fit > -100.0 else "fit below −100 %"


def title(case: Case) -> str:
    """What was concealed, in what noise, and between which fits a method moves."""
    truth = case.truth
    laws = " + ".join(f"{h.law} ({s:.1f} σ)" for h, s in zip(truth.hidden, truth.sigma, strict=False)) or "nothing"
    noise = f"{truth.colour.share:.0%} of the noise with a memory of {truth.colour.memory:g}"
    nominal = fit_on_unseen(case, [nominal_output(case, e) for e in case.unseen])
    return (
        f"{truth.plant.name}, concealed: {laws}; {noise if truth.colour.share else 'white noise'}; "
        f"unseen: nominal {nominal:.2f} %, truth {fit_on_unseen(case, case.clean):.2f} %"
    )


def summary(scores: dict[str, list[Score]]) -> None:
    """All cases together."""
    heads = ("right", "with others", "wrong", "silent", "false alarm", "named unknown", "gap closed", "processor s")
    print(f"\nall cases\n  {'':38}" + "".join(f"{head:>14}" for head in heads))
    for name, found in scores.items():
        print(f"  {name:38}" + "".join(f"{cell:>14}" for cell in _cells(found, name != NAMELESS)))


def _cells(found: Sequence[Score], names: bool) -> list[str]:
    unknown = [s for s in found if _is_unlisted(s.kind)]
    nothing = [s for s in found if s.kind == NOTHING]
    hidden = [s for s in found if s.kind != NOTHING and not _is_unlisted(s.kind)]
    gaps = [s.gap for s in found if s.gap is not None]
    closed = f"{100.0 * np.median(gaps):.0f} %" if gaps else "–"
    took = f"{np.median([s.seconds for s in found]):.1f}"
    if not names:
        return ["–"] * 6 + [closed, took]
    outcomes = (
        _of(hidden, lambda s: s.right),
        _of(hidden, lambda s: s.said in (AMONG, ONE)),
        _of(hidden, lambda s: s.said == WRONG),
        _of(hidden, lambda s: s.said not in (FIRST, BOTH, AMONG, ONE, WRONG)),
        _of(nothing, lambda s: s.said != CONSISTENT),
        _of(unknown, lambda s: s.said == WRONG),
    )
    return [*outcomes, closed, took]


def _is_unlisted(kind: str) -> bool:
    return kind in effects(listed=False)


def _of(scores: Sequence[Score], holds: Callable[[Score], bool]) -> str:
    return f"{sum(map(holds, scores))} of {len(scores)}"


def main() -> None:
    scores: dict[str, list[Score]] = {name: [] for name in methods()}
    asked = sys.argv[1:] or SHORT
    for label in ALL if asked == ["--all"] else asked:
        case = conceal(SEED, parse(label))
        show(title(case), rows(case, scores))
    summary(scores)


if __name__ == "__main__":
    main()
