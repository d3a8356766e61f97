"""Cases of the concealment proof (tests/studies/proof) as every method gets them, and how its answer is judged.

The truth is simulated by laws and a solver of its own, which none of the methods shares. All methods get the same: a
nominal model identified from the healthy recordings, and the changed recordings, command and output only.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # tests/studies/proof is run from the project's folder

from hil.identification.grey_box.identify import fit_plant
from hil.identification.preparation.experiment import Experiment, experiment, for_model
from hil.physics.model import Model, typical_model
from hil.record.recording import Array, Recording, recording
from tests.studies.proof.cases.draw import draw, programme_of
from tests.studies.proof.cases.folder import Recorded, record, unseen
from tests.studies.proof.cases.label import Label
from tests.studies.proof.cases.play import BASELINE, CHANGED, play
from tests.studies.proof.cases.truth import Truth
from tests.studies.proof.score.gap import LEAST_GAP_SIGMA, fit_percent, misfit_sigma
from tests.studies.proof.score.judge import Judgement, judge
from tests.studies.proof.truth.simulate import SAMPLE_S


@dataclass(frozen=True, slots=True)
class Case:
    """What is handed over (`nominal`, `changed`), and what is kept for the judgement."""

    truth: Truth
    nominal: Model
    changed: tuple[Experiment, ...]
    unseen: tuple[Experiment, ...]
    clean: tuple[Array, ...]


@dataclass(frozen=True, slots=True)
class Answer:
    """What a method says of a case.

    Attributes:
        verdict: in the words of `diagnosis.json`.
        named: effects, the most important one first.
        predict: the output on the input of a recording.
    """

    verdict: str
    named: tuple[str, ...]
    predict: Callable[[Experiment], Array]


def conceal(seed: int, label: Label) -> Case:
    """Draw a case, record it, and identify its nominal model."""
    truth = replace(draw(seed, label), intermediate=False)
    commands = programme_of(seed, label)
    healthy, afflicted = truth.healthy(), truth.afflicted()
    start = typical_model(label.plant)
    baseline = [
        experiment(_recording(truth, record(truth, healthy, played)), start.definition)
        for played in play(healthy, commands.baseline, truth.key + BASELINE)
    ]
    nominal = fit_plant(start, baseline).model
    changed = [record(truth, afflicted, p) for p in play(afflicted, commands.changed, truth.key + CHANGED)]
    kept = unseen(truth)
    return Case(
        truth, nominal,
        tuple(for_model(nominal, _recording(truth, r)) for r in changed),
        tuple(for_model(nominal, _recording(truth, r)) for r in kept),
        tuple(r.clean for r in kept),
    )  # fmt: skip


def _recording(truth: Truth, recorded: Recorded) -> Recording:
    time_s = np.arange(len(recorded.command)) * SAMPLE_S
    columns = {truth.plant.command.heading: recorded.command, truth.plant.channels[0].heading: recorded.channels[:, 0]}
    return recording(recorded.name, time_s, columns)


def judged(case: Case, answer: Answer) -> Judgement:
    """The judgement of the proof, for any method that gives names."""
    effects = [{"name": name} for name in answer.named]
    return judge(case.truth, {"verdict": answer.verdict, "effects": effects})


def nominal_output(case: Case, e: Experiment) -> Array:
    """What the nominal model makes of a recording's input."""
    output: Array = e.respond(case.nominal.definition, case.nominal.values, case.nominal.active_effects)[0]
    return output


def fit_on_unseen(case: Case, outputs: Sequence[Array]) -> float:
    """Fit in % to the recordings that were never handed over, their mean."""
    return float(np.mean([fit_percent(e.output, y) for e, y in zip(case.unseen, outputs, strict=True)]))


def has_gap(case: Case) -> bool:
    """Whether there is anything on the unseen recordings that a better model could close."""
    nominal = np.concatenate([nominal_output(case, e) for e in case.unseen])
    far = misfit_sigma(np.concatenate(case.clean), nominal, case.truth.plant.channels[0].noise) > LEAST_GAP_SIGMA
    return case.truth.predictable and far
