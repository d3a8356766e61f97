"""The model of a unit, and what its data excluded; or why the passport has neither."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hil.catalog import models
from hil.errors import InputError
from hil.language.note import Note, translated
from hil.language.words import _, marked
from hil.passport.unit import Unit
from hil.record.run_folder.progress import Progress
from hil.report.number import number, with_std

if TYPE_CHECKING:
    from hil.diagnosis.diagnose import Diagnosed
    from hil.physics.model import Model


@dataclass(frozen=True, slots=True)
class Understood:
    """What is known of the unit's physics.

    Attributes:
        sentences: for page one.
        model: as identified from these runs. `fit`: how well it fits.
        diagnosed: the diagnosis against the type's model.
        seconds: that it took.
    """

    sentences: tuple[Note, ...]
    model: Model | None = None
    fit: Note | None = None
    diagnosed: Diagnosed | None = None
    seconds: float = 0.0

    @property
    def says(self) -> str:
        """For page one, in the language that is spoken."""
        return " ".join(map(translated, self.sentences))

    @property
    def about(self) -> str:
        """How well the model fits, in the language that is spoken."""
        return self.fit.translated if self.fit else ""

    @property
    def parameters(self) -> list[list[str]]:
        """Rows for the annex."""
        if self.model is None:
            return []
        meanings = {p.name: p.meaning for p in self.model.definition.parameters}
        return [
            [name.replace("_", " "), with_std(v.value, v.std),
             v.unit, meanings.get(name, "")] for name, v in self.model.parameters.items()
        ]  # fmt: skip

    @property
    def excluded(self) -> list[list[str]]:
        """Rows for the annex: every effect that would have been seen."""
        if self.diagnosed is None:
            return []
        from hil.report.diagnosis_tables import changed_from

        return [
            [_(limit.effect.replace("_", " ")) + changed_from(limit), _(limit.stage),
             number(limit.upper, 2) if limit.visible else _("cannot be seen"),
             limit.unit if limit.visible else ""] for limit in self.diagnosed.diagnosis.limits
        ]  # fmt: skip


def understood(unit: Unit, wanted: bool, kind: Model | None, progress: Progress) -> Understood:
    """Identify the unit, and diagnose it against the model of its type where there is one.

    Args:
        unit: with its runs.
        wanted: whether to.
        kind: the type's model.
        progress: called with how far it is.
    """
    if not wanted:
        return Understood((Note("Neither is in this passport: they were left out on request (--no-model)."),))
    started = time.perf_counter()
    model, fit, why = _identified(unit, progress)
    diagnosed, sentence = _diagnosed(unit, kind, progress)
    seconds = time.perf_counter() - started
    took = Note("Computed in {seconds:.0f} s.", seconds=seconds)
    once = Note("Who verifies this passport does not compute it anew.")
    anew = (once,) if model is not None or diagnosed is not None else ()
    return Understood((why, sentence, took, *anew), model, fit, diagnosed, seconds)


def _identified(unit: Unit, progress: Progress) -> tuple[Model | None, Note | None, Note]:
    if not unit.plant:
        why = Note("No model of this unit is inside: the bench file names no plant for this valve.")
        return None, None, why
    from hil.record.read import read_recording
    from hil.session.identification import identified

    progress(0.1, "identifying the unit")
    try:
        start = str(models().get(unit.plant, unit.plant))  # benches name a plant or an installed model
        found = identified(start, [read_recording(run.folder) for run in unit.runs])
    except InputError as error:
        text = marked("No model of this unit is inside: it could not be identified from these runs: {error}.")
        return None, None, Note(text, error=str(error))
    fits = found.model.origin.get("fit_percent") or {}
    fit = ", ".join(f"{number(value, 3)} %" for value in fits.values())
    about = Note(
        "Plant {plant}, {input} to {output}; fit {fit!l}.",
        plant=found.model.plant, input=found.model.input, output=found.model.output, fit=fit or "—",
    )  # fmt: skip
    inside = marked("The model of this unit, identified from these runs, is inside (model.json; fit {fit!l}).")
    return found.model, about, Note(inside, fit=fit or "—")


def _diagnosed(unit: Unit, kind: Model | None, progress: Progress) -> tuple[Diagnosed | None, Note]:
    if kind is None:
        asked = marked("What these data excluded was not asked: no model of the type was given (--model MODEL.json).")
        return None, Note(asked)
    from hil.diagnosis.diagnose import diagnose
    from hil.identification.preparation.experiment import for_model
    from hil.record.read import read_recording

    progress(0.5, "comparing with the type's model")
    try:
        experiments = [for_model(kind, read_recording(run.folder)) for run in unit.runs]
        diagnosed = diagnose(kind, experiments, lambda done, text: progress(0.5 + 0.5 * done, text))
    except InputError as error:
        refused = marked("What these data excluded is not known: the diagnosis refused: {error}.")
        return None, Note(refused, error=str(error))
    seen = sum(limit.visible for limit in diagnosed.diagnosis.limits)
    against = marked("Against the model of its type: {headline} Limits of {n} other effects are in the annex.")
    return diagnosed, Note(against, headline=diagnosed.diagnosis.headline, n=seen)
