"""The model of a unit, and what its data excluded; or why the passport has neither."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hil.catalog import models
from hil.errors import InputError
from hil.passport.unit import Unit
from hil.record.measurement import COVERAGE_FACTOR
from hil.report.number import number, with_uncertainty

if TYPE_CHECKING:
    from hil.diagnosis.diagnose import Diagnosed
    from hil.physics.model import Model

Progress = Callable[[float, str], None]


@dataclass(frozen=True, slots=True)
class Understood:
    """What is known of the unit's physics.

    Attributes:
        says: for page one.
        model: as identified from these runs. `about`: how well it fits.
        told: the diagnosis against the type's model.
        seconds: that it took.
    """

    says: str
    model: Model | None = None
    about: str = ""
    told: Diagnosed | None = None
    seconds: float = 0.0

    @property
    def parameters(self) -> list[list[str]]:
        """Rows for the annex."""
        if self.model is None:
            return []
        meanings = {p.name: p.meaning for p in self.model.definition.parameters}
        return [
            [name.replace("_", " "), with_uncertainty(v.value, None if v.std is None else COVERAGE_FACTOR * v.std),
             v.unit, meanings.get(name, "")] for name, v in self.model.parameters.items()
        ]  # fmt: skip

    @property
    def excluded(self) -> list[list[str]]:
        """Rows for the annex: every effect that would have been seen."""
        if self.told is None:
            return []
        return [
            [limit.effect.replace("_", " "), limit.stage, number(limit.upper, 2) if limit.visible else "cannot be seen",
             limit.unit if limit.visible else ""] for limit in self.told.diagnosis.limits
        ]  # fmt: skip


def understood(unit: Unit, wanted: bool, kind: Model | None, progress: Progress) -> Understood:
    """Identify the unit, and diagnose it against the model of its type where there is one.

    Args:
        unit: with its runs.
        wanted: whether to.
        kind: the type's model.
        progress: told how far it is.
    """
    if not wanted:
        return Understood("Neither is in this passport: they were left out on request (--no-model).")
    started = time.perf_counter()
    model, about, why = _identified(unit, progress)
    told, said = _diagnosed(unit, kind, progress)
    seconds = time.perf_counter() - started
    return Understood(f"{why} {said} Computed in {seconds:.0f} s.", model, about, told, seconds)


def _identified(unit: Unit, progress: Progress) -> tuple[Model | None, str, str]:
    if not unit.plant:
        return None, "", "No model of this unit is inside: the bench file names no plant for this valve."
    from hil.record.read import read_recording
    from hil.session.identification import identified

    progress(0.1, "identifying the unit")
    try:
        start = str(models().get(unit.plant, unit.plant))  # benches name a plant or an installed model
        found = identified(start, [read_recording(run.folder) for run in unit.runs])
    except InputError as error:
        return None, "", f"No model of this unit is inside: it could not be identified from these runs: {error}."
    fits = found.model.origin.get("fit_percent") or {}
    fit = ", ".join(f"{number(value, 3)} %" for value in fits.values())
    about = f"Plant {found.model.plant}, {found.model.input} to {found.model.output}" + (
        f"; fit {fit}." if fit else "."
    )
    return found.model, about, f"The model of this unit, identified from these runs, is inside (model.json; fit {fit})."


def _diagnosed(unit: Unit, kind: Model | None, progress: Progress) -> tuple[Diagnosed | None, str]:
    if kind is None:
        return None, "What these data excluded was not asked: no model of the type was given (--model MODEL.json)."
    from hil.diagnosis.diagnose import diagnose
    from hil.identification.experiment import for_model
    from hil.record.read import read_recording

    progress(0.5, "comparing with the type's model")
    try:
        experiments = [for_model(kind, read_recording(run.folder)) for run in unit.runs]
        told = diagnose(kind, experiments, lambda done, text: progress(0.5 + 0.5 * done, text))
    except InputError as error:
        return None, f"What these data excluded is not known: the diagnosis refused: {error}."
    seen = sum(limit.visible for limit in told.diagnosis.limits)
    return told, (
        f"Against the model of its type: {told.diagnosis.headline} Limits of {seen} other effects are in the annex."
    )
