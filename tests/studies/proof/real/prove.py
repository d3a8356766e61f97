"""One set of real recordings: nominal model, diagnosis, and the fit on what neither has seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hil.diagnosis.answer.corrected import corrected as corrected_model
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.intake.problem import pose
from hil.diagnosis.search.fits import fit
from hil.diagnosis.search.fitted import nothing
from hil.diagnosis.search.terms import all_terms
from hil.errors import FileError, HilError
from hil.identification.grey_box.identify import fit_plant, starting_model
from hil.identification.preparation.experiment import Experiment, experiment
from hil.physics.compose import effect as installed_effect
from hil.physics.model import Model, Value
from hil.physics.plant import Plant
from hil.record.read import read_recording
from hil.record.recording import Recording

from .sets import RealSet


@dataclass(frozen=True, slots=True)
class Fits:
    """Mean fit % over recordings of the nominal model, one fitted by hand, and the corrected one; their number."""

    nominal: float
    by_hand: float
    corrected: float
    count: int


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a set.

    Attributes:
        verdict: of the diagnosis. `named`: effects that it names. `described`: those that the corrected model
            holds, named or not.
        values: parameters of these effects, and base parameters, by label.
        left: share of the misfit that stays.
        seen, unseen: fits on what was used and on what was kept back; None where nothing was.
        uneven: recordings with uneven time stamps.
        failure: why there is no diagnosis.
    """

    real: RealSet
    verdict: str = ""
    named: tuple[str, ...] = ()
    described: tuple[str, ...] = ()
    effects: tuple[tuple[str, Value], ...] = ()
    base: tuple[tuple[str, Value], ...] = ()
    left: float = float("nan")
    seen: Fits | None = None
    unseen: Fits | None = None
    uneven: int = 0
    warnings: tuple[str, ...] = ()
    failure: str = ""


def prove(real: RealSet, recordings: Path) -> Outcome:
    """Diagnose a set; an error of the tool is an outcome too."""
    try:
        return _proved(real, recordings / real.folder)
    except HilError as error:
        return Outcome(real, failure=str(error))


def _proved(real: RealSet, folder: Path) -> Outcome:
    files = sorted(folder.glob("*.csv"))
    fitted = [read_recording(path) for path in files if path.match(real.fitted)]
    if not fitted:
        raise FileError(f"{folder}: no recording of the set '{real.name}'")
    start = starting_model(real.plant)
    plant = start.definition
    others = [read_recording(path) for path in files if not path.match(real.fitted) and not real.alone]
    others = [r for r in others if all(s.name in r.channels for s in (*plant.inputs, plant.output))]
    used = [experiment(r.rows(0, _count(r, real)), plant) for r in fitted]
    nominal = fit_plant(start, used).model
    used = [e.reading_at(nominal.read_at) for e in used]
    found = diagnose(nominal, used)
    corrected, said = found.corrected, found.diagnosis
    models = (nominal, fitted_by_hand(real, nominal, used), corrected)
    kept_back = [_kept_back(models, experiment(r, plant), _count(r, real)) for r in fitted if real.share < 1.0]
    kept_back += [_kept_back(models, experiment(r, plant), 0) for r in others]
    effects = tuple(
        (f"{e.name} at {plant.hook(e.hook).stage}: {name}", value)
        for e in corrected.effects
        for name, value in e.parameters.items()
    )
    described = tuple(installed_effect(e.name).reported_name for e in corrected.effects)
    return Outcome(
        real, said.verdict, tuple(e.name for e in said.effects), described, effects,
        _free(plant, corrected), said.left.share, _mean([_kept_back(models, e, 0) for e in used]), _mean(kept_back),
        sum(not r.is_even() for r in fitted), said.warnings,
    )  # fmt: skip


def fitted_by_hand(real: RealSet, nominal: Model, used: Sequence[Experiment]) -> Model:
    """The nominal model with the physics of the reference, one effect after another, each from the best of its starts.

    Raises:
        KeyError: the plant has no such effect.
    """
    problem = pose(nominal, used)
    f = nothing(problem)
    for key in real.by_hand:
        term = {(t.name, t.hook): t for t in all_terms(problem, f.residuals)}[key]
        tried = [fit(problem, replace(f, terms=(*f.terms, term), values=(*f.values, start))) for start in term.starts]
        f = fit(problem, min(tried, key=lambda each: each.chi2))
    return corrected_model(problem, f, "explained")


def _count(recording: Recording, real: RealSet) -> int:
    return round(real.share * len(recording))


def _free(plant: Plant, model: Model) -> tuple[tuple[str, Value], ...]:
    return tuple((p.name, model.parameters[p.name]) for p in plant.parameters if not p.fixed)


def _kept_back(models: Sequence[Model], whole: Experiment, first: int) -> tuple[float, ...]:
    """Fits of models that run freely through a recording from its start, counted from a sample on."""
    measured = whole.output[first:]
    fits = []
    for model in models:
        moved = whole.reading_at(model.read_at)
        simulated = moved.respond(model.definition, model.values, model.active_effects)[0][first:]
        spread = np.linalg.norm(measured - measured.mean())
        fits.append(float(100.0 * (1.0 - np.linalg.norm(measured - simulated) / spread)))
    return tuple(fits)


def _mean(fits: Sequence[tuple[float, ...]]) -> Fits | None:
    if not fits:
        return None
    nominal, by_hand, corrected = np.mean(fits, axis=0)
    return Fits(float(nominal), float(by_hand), float(corrected), len(fits))
