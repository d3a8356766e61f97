"""The table of real recordings, for a terminal and for the documentation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby

from hil.physics.model import Value
from tests.studies.markdown import head, line

from .prove import Fits, Outcome

HEADINGS = (
    "set", "known to be left out", "verdict", "effects in the corrected model", "fitted part", "kept back", "reference",
)  # fmt: skip
START, STOP = "<!-- measured: python -m tests.studies.proof.real --page -->", "<!-- end of what was measured -->"


def cells(outcome: Outcome) -> tuple[str, ...]:
    """A row of the table."""
    before, after = outcome.real.reference
    said = "none" if math.isnan(after) else f"{before:g} → {after:g}"
    reference = f"{said} ({outcome.real.reference_of})"
    known = ", ".join(name.replace("_", " ") for name in outcome.real.left_out)
    if outcome.failure:
        return (outcome.real.name, known, f"failed: {outcome.failure}", "", "", "", reference, "")
    named = ", ".join(outcome.named).replace("_", " ")
    verdict = outcome.verdict.replace("_", " ") + (f": {named}" if named else "")
    return (
        outcome.real.name, known, verdict, _effects(outcome), _fits(outcome.seen),
        _fits(outcome.unseen), reference,
    )  # fmt: skip


def _effects(outcome: Outcome) -> str:
    named = set(outcome.named)
    shown = [name.replace("_", " ") if name in named else f"({name.replace('_', ' ')})" for name in outcome.described]
    return " + ".join(shown) or "none"


def _fits(fits: Fits | None) -> str:
    if fits is None:
        return "nothing kept back"
    return f"{fits.nominal:.1f} → {fits.corrected:.1f} ({fits.by_hand:.1f})"


def number(value: Value) -> str:
    """A value with its standard uncertainty and unit, in as many digits as that supports."""
    unit = "" if value.unit == "1" else f" {value.unit}"
    if value.std is None or not math.isfinite(value.std) or value.std <= 0.0:
        return f"{value.value:.3g}{unit}"
    digits = max(0, 1 - math.floor(math.log10(value.std)))
    return f"{value.value:.{digits}f} ± {value.std:.{digits}f}{unit}"


def parameters(outcome: Outcome) -> str:
    """Parameters in physical units with their standard uncertainty, those of an effect behind its name and place."""
    split = [(*label.rpartition(": "), value) for label, value in (*outcome.effects, *outcome.base)]
    return "; ".join(
        f"{of}{sign}" + ", ".join(f"{name} {number(value)}" for _, _, name, value in some)
        for (of, sign), some in groupby(split, key=lambda one: one[:2])
    )


def markdown(outcomes: Sequence[Outcome]) -> str:
    """Both tables for the documentation: verdicts with fits, and parameters of the models that were corrected."""
    lines = [*head(HEADINGS), *(line(cells(o)) for o in outcomes), ""]
    lines += head(("set", "parameters ± standard uncertainty"))
    lines += [line((o.real.name, parameters(o))) for o in outcomes if o.effects]
    return "\n".join(lines)
