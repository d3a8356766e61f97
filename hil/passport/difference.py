"""What changed between two dates, in physics: the second diagnosed against what the first was."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from hil.diagnosis.diagnose import Diagnosed, diagnose
from hil.diagnosis.diagnosis import Diagnosis, Finding
from hil.diagnosis.evidence.coverage import Limit
from hil.diagnosis.intake.work import SAMPLES_PER_S, budget_notes
from hil.errors import SettingError, option
from hil.identification.preparation.experiment import Experiment
from hil.language.note import Note
from hil.passport.change import Change, Size, Unchanged, owner_among, owner_of
from hil.passport.conditions import condition_changes
from hil.passport.sources import Dated
from hil.physics.compose import kernel
from hil.physics.model import Model, ModelEffect
from hil.record.measurement import COVERAGE_FACTOR
from hil.record.plain import plain
from hil.record.run_folder.progress import Progress, quiet
from hil.record.simulated import is_simulated
from hil.session.diagnosis import bound_to
from hil.signals.interval import ONE_SIDED

ChangeVerdict = Literal["unchanged", "changed", "unexplained"]
SCHEMA = "hil.diff/1"


@dataclass(frozen=True, slots=True)
class DateDifference:
    """The answer. `cannot_tell`: what may have changed unseen; `simulated`: whether a recording is of such a valve.

    `is_part`: whether the changes explain only a part of what changed; `not_searched`: for want of a larger budget.
    """

    changes: tuple[Change, ...]
    unchanged: tuple[Unchanged, ...]
    verdict: ChangeVerdict
    notes: tuple[Note, ...] = ()
    cannot_tell: tuple[Unchanged, ...] = ()
    simulated: bool = False
    is_part: bool = False
    not_searched: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """`hil.diff/1`."""
        lists = ("changes", "unchanged", "cannot_tell")
        parts = {name: [one.as_dict() for one in getattr(self, name)] for name in lists}
        return {"schema": SCHEMA, **plain(self), **parts}


def difference(
    old: Dated,
    new: Dated,
    kind: Model | None,
    progress: Progress = quiet,
    inputs: Sequence[str] = (),
    output: str = "",
    computing_s: float = math.inf,
) -> DateDifference:
    """Compare two dates.

    Args:
        old: the first date.
        new: the second.
        kind: the type's model; else that of a passport, else the model of the unit in the first.
        progress: called with how far it is.
        inputs: names of the input channels, where they are not the model's own.
        output: name of the output channel, likewise.
        computing_s: budget after which no further search is begun; the dates share it, what was left out is a note.

    Raises:
        SettingError: there is no model.
        FileError: a recording cannot be bound to it.
    """
    known = kind or old.kind or new.kind
    start = known or old.unit
    if start is None:
        raise SettingError(f"{old.name}: holds no model; give that of the type with {option('model', 'MODEL.json')}")
    names, first, left_s = (inputs, output), None, computing_s
    left_out: tuple[str, ...] = ()
    if known is not None:
        half_s = 0.5 * computing_s
        experiments, left_out = bound_to(known, old.recordings, *names, half_s)
        first = diagnose(known, experiments, lambda d, t: progress(0.5 * d, f"{old.name}: {t}"), budget_s=half_s)
        left_s = max(computing_s - first.diagnosis.work["samples"] / SAMPLES_PER_S, 0.0)
    reference = start if first is None else _reference(start, first)
    experiments, more = bound_to(reference, new.recordings, *names, left_s)
    second = diagnose(reference, experiments, lambda d, t: progress(0.5 + 0.5 * d, f"{new.name}: {t}"), budget_s=left_s)
    moved, same = _moved(reference, first, second, experiments)
    changes = (*moved, *condition_changes(old.recordings, new.recordings))
    named = {change.name for change in moved}
    limits = (_excluded(x) for x in second.diagnosis.limits if x.visible)
    kept = {one.name: one for one in (*limits, *same) if one.name not in named}
    is_part = bool(moved) and second.diagnosis.verdict == "partly_explained"
    rest = (Note("a part of what changed is not explained"),) if is_part else ()
    not_searched = _not_searched(first, second)
    notes = (*_notes(old, new, first), *rest, *left_out, *more, *budget_notes(not_searched))
    return DateDifference(
        changes, tuple(one for one in kept.values() if one.is_identifiable), _verdict(second.diagnosis, moved), notes,
        tuple(one for one in kept.values() if not one.is_identifiable),
        any(is_simulated(one.meta) for one in (*old.recordings, *new.recordings)), is_part, not_searched,
    )  # fmt: skip


def _reference(kind: Model, first: Diagnosed) -> Model:
    """The unit at the first date, effects that were told apart: what grew is then found as a whole, and compared."""
    if first.diagnosis.verdict in ("unexplained", "partly_explained"):
        return kind
    named = {(f.name, f.hook) for f in first.diagnosis.effects}
    there = {(e.name, e.hook): e for e in first.corrected.effects}
    effects = tuple(e if (key := (e.name, e.hook)) in named else there[key] for e in kind.effects)
    return replace(first.corrected, effects=effects, origin=kind.origin)


def _notes(old: Dated, new: Dated, first: Diagnosed | None) -> tuple[Note, ...]:
    found = []
    if len(units := old.serials | new.serials) > 1:
        found.append(Note("these are different units: {serials}", serials=tuple(sorted(units))))
    if first is not None and first.diagnosis.verdict in ("unexplained", "partly_explained"):
        found.append(Note("{earlier} is not explained itself; {later} is compared with the model of the type",
                          earlier=old.name, later=new.name))  # fmt: skip
    return tuple(found)


def _not_searched(*found: Diagnosed | None) -> tuple[str, ...]:
    """For want of computing time; each once."""
    return tuple(dict.fromkeys(w for one in found if one is not None for w in one.diagnosis.work["not_searched"]))


def _verdict(second: Diagnosis, moved: Sequence[Change]) -> ChangeVerdict:
    if second.verdict == "unexplained":
        return "unexplained"
    if moved:
        return "changed"
    return "unexplained" if second.verdict == "partly_explained" else "unchanged"


def _moved(
    reference: Model, first: Diagnosed | None, second: Diagnosed, experiments: Sequence[Experiment]
) -> tuple[list[Change], list[Unchanged]]:
    """(what moved beyond its uncertainty, what is there at both dates and did not)."""
    earlier = {} if first is None else {(f.name, f.stage): f for f in first.diagnosis.effects}
    limits = {} if first is None else {x.effect: x.upper for x in first.diagnosis.limits if x.visible}
    shares = _shares(reference, second, experiments)
    found = [
        _of_finding(f, earlier.pop((f.name, f.stage), None), limits, reference, second.diagnosis, shares)
        for f in second.diagnosis.effects
    ]
    found += [_of_parameter(reference, c, shares.get(c.name)) for c in second.diagnosis.changed_parameters
              if c.name not in {change.parameter for change in found}]  # fmt: skip
    found += [gone for f in earlier.values() if (gone := _effect_gone(f, second.diagnosis)) is not None]
    moved = [change for change in found if _beyond_uncertainty(change)]
    return moved, [_no_change(change) for change in found if change not in moved]


def _of_finding(
    f: Finding, before: Finding | None, limits: Mapping[str, float], reference: Model, diagnosis: Diagnosis,
    shares: Mapping[str, float],
) -> Change:  # fmt: skip
    parameter, after = next(iter(f.parameters.items()))
    known = reference.parameters.get(parameter) or (before.parameters.get(parameter) if before else None)
    if known is not None:
        was = Size(known.value, known.std)
    else:
        value = _null(reference, f, parameter) if after.was is None else after.was
        std = None if after.was is None else _std_in(reference, f, parameter)
        was = Size(value, limits[f.name] / ONE_SIDED if f.name in limits else std)
    rivals = {name for names in diagnosis.not_separable if f.name in names for name in names}
    stages = {c.stage for c in diagnosis.candidates if c.name in rivals}
    of = owner_among(f.stage, stages)
    return Change(f.name, f.stage, of, parameter, was, Size(after.value, after.std), after.unit,
                  shares.get(f"{f.name}@{f.hook}"), f.probability)  # fmt: skip


def _of_parameter(reference: Model, changed: Any, share: float | None) -> Change:
    stage = reference.definition.stage(changed.name)
    was = reference.parameters[changed.name]
    return Change(changed.name, stage, owner_of(stage), changed.name, Size(changed.before, was.std),
                  Size(changed.after, changed.std), changed.unit, share, None)  # fmt: skip


def _effect_gone(f: Finding, diagnosis: Diagnosis) -> Change | None:
    """An effect of the first date that the second does not show, though it would have."""
    limit = next((x for x in diagnosis.limits if x.effect == f.name and x.visible), None)
    if limit is None:
        return None
    parameter, was = next(iter(f.parameters.items()))
    now = Size(limit.about, limit.upper / ONE_SIDED)
    return Change(
        f.name, f.stage, owner_of(f.stage), parameter, Size(was.value, was.std), now, was.unit, None, f.probability
    )


def _std_in(model: Model, f: Finding, parameter: str) -> float | None:
    """How well a model knows a parameter of an effect that it has."""
    return next((e.parameters[parameter].std for e in model.effects if e.hook == f.hook and e.name == f.name), None)


def _null(model: Model, f: Finding, parameter: str) -> float | None:
    """The value at which an effect does nothing; None where that is infinity."""
    site = next((s for s in kernel(model.plant).sites if s.hook.name == f.hook and f.name in _names(s.effect)), None)
    if site is None:
        return 0.0
    value = site.effect.null_at(site.hook).get(parameter, 0.0)
    return float(value) if math.isfinite(value) else None


def _names(effect: Any) -> tuple[str, str]:
    return effect.name, effect.known_as


def _beyond_uncertainty(change: Change) -> bool:
    before, after = change.before, change.after
    if before.value is None or after.value is None:
        return True
    stds = [size.std for size in (before, after) if size.std is not None and math.isfinite(size.std)]
    return abs(after.value - before.value) > COVERAGE_FACTOR * math.hypot(*stds)


def _no_change(change: Change) -> Unchanged:
    stds = [size.std or 0.0 for size in (change.before, change.after)]
    before, after = change.before.value or 0.0, change.after.value or 0.0
    limit = abs(after - before) + ONE_SIDED * math.hypot(*stds)
    size = max(abs(before), abs(after))
    return Unchanged(change.name, limit, change.unit, is_identifiable=limit < size or size == 0.0)


def _excluded(limit: Limit) -> Unchanged:
    return Unchanged(
        limit.effect, limit.upper, limit.unit, limit.is_place or limit.upper < limit.typical, limit.is_place
    )


def _shares(reference: Model, second: Diagnosed, experiments: Sequence[Experiment]) -> dict[str, float]:
    """What each cause explains of the change: what is missing when it alone is taken out, all together what is told."""
    corrected = second.corrected
    whole = _misfit(corrected, experiments)
    missing = {key: max(_misfit(model, experiments) - whole, 0.0) for key, model in _without(reference, second)}
    total, explained = sum(missing.values()), 1.0 - second.diagnosis.left.share
    if not total > 0.0:
        return {key: explained / len(missing) for key in missing}
    return {key: round(explained * part / total, 4) for key, part in missing.items()}


def _without(reference: Model, second: Diagnosed) -> Iterator[tuple[str, Model]]:
    """The corrected model with one cause taken back."""
    corrected = second.corrected
    for f in second.diagnosis.effects:
        base = next((name for name in f.parameters if name in reference.parameters), None)
        yield f"{f.name}@{f.hook}", _back(corrected, reference, base) if base else _less(corrected, reference, f)
    for changed in second.diagnosis.changed_parameters:
        yield changed.name, _back(corrected, reference, changed.name)


def _back(corrected: Model, reference: Model, name: str) -> Model:
    return replace(corrected, parameters={**corrected.parameters, name: reference.parameters[name]})


def _less(corrected: Model, reference: Model, f: Finding) -> Model:
    """Without an effect, or with what the reference has of it."""
    installed = {(s.hook.name, s.effect.name): _names(s.effect) for s in kernel(corrected.plant).sites}

    def is_it(e: ModelEffect) -> bool:
        return e.hook == f.hook and f.name in installed.get((e.hook, e.name), (e.name,))

    kept = [e for e in corrected.effects if not is_it(e)]
    return replace(corrected, effects=(*kept, *(e for e in reference.effects if is_it(e))))


def _misfit(model: Model, experiments: Sequence[Experiment]) -> float:
    found = 0.0
    for e in experiments:
        error = e.telling(e.output - e.simulated(model)[0])
        found += float(np.sum(error**2))
    return found
