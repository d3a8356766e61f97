"""Changed or not, of many units: the gate of a diagnosis, and no search for a cause."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

from hil.diagnosis.events.coarse import coarse_step
from hil.diagnosis.events.repeats import without_stale
from hil.diagnosis.intake.check import check
from hil.diagnosis.intake.problem import pose
from hil.diagnosis.question import question_of
from hil.diagnosis.verdict.changed import Changed
from hil.errors import SettingError
from hil.identification.preparation.experiment import Experiment
from hil.identification.uncertainty.fit import fit_percent
from hil.language.note import Note
from hil.physics.model import Model
from hil.record.plain import plain
from hil.signals.products import one_blas_thread

ScreeningVerdict = Literal["consistent", "changed", "unsure"]


@dataclass(frozen=True, slots=True)
class Screening:
    """Whether a unit has changed since its model was identified.

    Attributes:
        verdict: "unsure" where one recording alone says that it has (see `verdict.changed`).
        z: the statistic, and `needed`, from which it is an alarm. `shows_as`: the change of the model that shows it
            best: no cause, which only a diagnosis names.
        fit: of the model, in %, on the recording that it fits worst; None where that output stands still.
        simulated: whether a recording is of a simulated valve.
    """

    verdict: ScreeningVerdict
    z: float
    needed: float
    shows_as: str
    fit: float | None
    simulated: bool = False

    def as_dict(self) -> dict[str, Any]:
        """As JSON values."""
        return plain(asdict(self))


def screen(model: Model, experiments: Sequence[Experiment]) -> tuple[Screening, tuple[Note, ...]]:
    """Ask the gate whether a unit has changed, and what limits the answer in words.

    `hil.diagnosis.diagnose.diagnose` asks the same gate, but of a model that left nothing but noise: there its search
    says what has changed.

    Args:
        model: of the unit, with what its file keeps of the recordings that it was identified from.
        experiments: later recordings, bound to its plant.

    Raises:
        SettingError: the model keeps nothing of its recordings.
        FileError: a recording cannot be what its headings say (see `hil.diagnosis.intake.check`).
    """
    asked = question_of(model, experiments, "changed")
    if asked.table is None:
        raise SettingError(str(asked.why))
    with one_blas_thread():
        checked = check(model, experiments)
        kept, _ = without_stale(checked.experiments)
        problem = pose(model, kept)
        changed = Changed(problem, asked.table, asked.table.rows(model, problem.experiments))
        later, column = changed.later, asked.table.columns[changed.later.column]
    shows_as, is_changed = f"{column.name} {column.hook}".strip(), changed.is_alarm
    if coarse_step(problem, kept) is not None:
        shows_as, is_changed = "quantisation", True
    verdict: ScreeningVerdict = "changed" if is_changed else "consistent"
    if changed.is_unsure:
        verdict = "unsure"
    fits = [fit_percent(e.valid_output, e.simulated(model)[0][e.valid]) for e in problem.experiments]
    made = Screening(verdict, round(later.z, 2), round(changed.needed, 2), shows_as, round(min(fits), 3))
    return made, (*asked.warnings, *checked.warnings)
