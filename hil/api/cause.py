"""The process that looks for the cause of a missed certificate; started by `hil.session.cause`, answers on stdout."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from hil.record.cause import ANSWER, Cause, Found

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.diagnosis.diagnosis import Diagnosis
    from hil.passport.difference import DateDifference


def main() -> None:
    """Answer the question on the command line: the model of the type, the run, the earlier run or nothing, budget."""
    from hil.errors import HilError, options_of

    model, run, earlier, budget_s = sys.argv[1:]
    try:
        with options_of("prompt"):
            found = searched(model, Path(run), Path(earlier) if earlier else None, float(budget_s))
    except HilError as error:
        found = Cause("", reason=str(error))
    sys.stdout.buffer.write(ANSWER.dump_json(found, by_alias=True))


def searched(model: str, run: Path, earlier: Path | None, budget_s: float) -> Cause:
    """What a run differs in from an earlier one, or from the model of its type.

    Args:
        model: an installed one by its name, the path of one, or a plant at its typical values.
        run: folder of the run that missed its certificate.
        earlier: folder of a run of the same unit.
        budget_s: after so many times 10 million simulated samples no further search is begun.

    Raises:
        InputError: why nothing can be said.
    """
    from hil.api.calculations import diagnose
    from hil.api.units import diff
    from hil.session.analyses import model_to_linearise

    kind = model_to_linearise(Path(model))
    if earlier is not None:
        return of_difference(diff(earlier, run, model=kind, budget_s=budget_s))
    return of_diagnosis(diagnose(kind, run, budget_s=budget_s).diagnosis)


def of_difference(found: DateDifference) -> Cause:
    """The cause that a comparison of two dates names."""
    named = tuple(
        Found(c.name, c.of, c.before.value, c.before.std, c.after.value, c.after.std, c.unit, share=c.share)
        for c in sorted(found.changes, key=lambda one: -(one.share or 0.0))
    )
    verdict = "partly_explained" if found.is_part else found.verdict
    return Cause("", verdict=verdict, found=named, not_searched=", ".join(found.not_searched))


def of_diagnosis(found: Diagnosis) -> Cause:
    """The cause that a diagnosis names."""
    return Cause(
        "", verdict=found.verdict, found=tuple(_named(found)), not_searched=", ".join(found.work["not_searched"])
    )


def _named(diagnosis: Diagnosis) -> Iterator[Found]:
    changed = {c.name: c for c in diagnosis.changed_parameters}
    for effect in diagnosis.effects:
        parameter, size = next(iter(effect.parameters.items()))
        alike = tuple(
            other for pair in diagnosis.not_separable if effect.name in pair for other in pair if other != effect.name
        )
        was = changed[parameter].before if size.was is None and parameter in changed else size.was
        yield Found(effect.name, "", was, None, size.value, size.std, size.unit, alike=alike)
    named = {name for effect in diagnosis.effects for name in effect.parameters}
    for name, c in changed.items():
        if name not in named:
            yield Found(name, "", c.before, None, c.after, c.std, c.unit, meaning=c.meaning)


if __name__ == "__main__":
    main()
