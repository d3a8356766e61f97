"""The model of a unit, and what its data excluded; or why the passport has neither."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from hil.catalog import models
from hil.errors import InputError
from hil.language.figures import localised
from hil.language.words import _, marked
from hil.passport.unit import Unit
from hil.record.measurement import COVERAGE_FACTOR
from hil.report.diagnosis_tables import changed_from
from hil.report.number import number, with_uncertainty

if TYPE_CHECKING:
    from hil.diagnosis.diagnose import Diagnosed
    from hil.physics.model import Model

Progress = Callable[[float, str], None]


@dataclass(frozen=True, slots=True)
class Sentence:
    """A text with what is put into it by name: said in the language of a page when that is written."""

    text: str
    put: Mapping[str, str] = field(default_factory=dict)
    numbers: Mapping[str, str] = field(default_factory=dict)

    @property
    def spoken(self) -> str:
        """In the language that is spoken; of what is put in, numbers have its decimal sign."""
        return _(self.text).format(**self.put, **{name: localised(text) for name, text in self.numbers.items()})


@dataclass(frozen=True, slots=True)
class Understood:
    """What is known of the unit's physics.

    Attributes:
        sentences: for page one.
        model: as identified from these runs. `fit`: how well it fits.
        diagnosed: the diagnosis against the type's model.
        seconds: that it took.
    """

    sentences: tuple[Sentence, ...]
    model: Model | None = None
    fit: Sentence | None = None
    diagnosed: Diagnosed | None = None
    seconds: float = 0.0

    @property
    def says(self) -> str:
        """For page one, in the language that is spoken."""
        return " ".join(sentence.spoken for sentence in self.sentences)

    @property
    def about(self) -> str:
        """How well the model fits, in the language that is spoken."""
        return self.fit.spoken if self.fit else ""

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
        if self.diagnosed is None:
            return []
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
        progress: told how far it is.
    """
    if not wanted:
        return Understood(
            (Sentence(marked("Neither is in this passport: they were left out on request (--no-model).")),)
        )
    started = time.perf_counter()
    model, fit, why = _identified(unit, progress)
    diagnosed, sentence = _diagnosed(unit, kind, progress)
    seconds = time.perf_counter() - started
    took = Sentence(marked("Computed in {seconds} s."), {"seconds": f"{seconds:.0f}"})
    once = Sentence(marked("Who verifies this passport does not compute it anew."))
    anew = (once,) if model is not None or diagnosed is not None else ()
    return Understood((why, sentence, took, *anew), model, fit, diagnosed, seconds)


def _identified(unit: Unit, progress: Progress) -> tuple[Model | None, Sentence | None, Sentence]:
    if not unit.plant:
        return (
            None,
            None,
            Sentence(marked("No model of this unit is inside: the bench file names no plant for this valve.")),
        )
    from hil.record.read import read_recording
    from hil.session.identification import identified

    progress(0.1, "identifying the unit")
    try:
        start = str(models().get(unit.plant, unit.plant))  # benches name a plant or an installed model
        found = identified(start, [read_recording(run.folder) for run in unit.runs])
    except InputError as error:
        why = marked("No model of this unit is inside: it could not be identified from these runs: {error}.")
        return None, None, Sentence(why, {"error": str(error)})
    fits = found.model.origin.get("fit_percent") or {}
    fit = ", ".join(f"{number(value, 3)} %" for value in fits.values())
    named = {"plant": found.model.plant, "input": found.model.input, "output": found.model.output}
    about = Sentence(marked("Plant {plant}, {input} to {output}; fit {fit}."), named, {"fit": fit or "—"})
    inside = marked("The model of this unit, identified from these runs, is inside (model.json; fit {fit}).")
    return found.model, about, Sentence(inside, {}, {"fit": fit or "—"})


def _diagnosed(unit: Unit, kind: Model | None, progress: Progress) -> tuple[Diagnosed | None, Sentence]:
    if kind is None:
        asked = marked("What these data excluded was not asked: no model of the type was given (--model MODEL.json).")
        return None, Sentence(asked)
    from hil.diagnosis.diagnose import diagnose
    from hil.identification.experiment import for_model
    from hil.record.read import read_recording

    progress(0.5, "comparing with the type's model")
    try:
        experiments = [for_model(kind, read_recording(run.folder)) for run in unit.runs]
        diagnosed = diagnose(kind, experiments, lambda done, text: progress(0.5 + 0.5 * done, text))
    except InputError as error:
        refused = marked("What these data excluded is not known: the diagnosis refused: {error}.")
        return None, Sentence(refused, {"error": str(error)})
    seen = sum(limit.visible for limit in diagnosed.diagnosis.limits)
    against = marked("Against the model of its type: {headline} Limits of {n} other effects are in the annex.")
    return diagnosed, Sentence(against, {"headline": diagnosed.diagnosis.headline, "n": str(seen)})
