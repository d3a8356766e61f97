"""Numbers and findings in words that an operator understands."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

from hil.diagnosis.diagnosis import ChangedParameter, DiagnosisVerdict, Finding, Left, Quantity
from hil.diagnosis.search.terms import Term
from hil.physics.effect import Effect
from hil.physics.plant import Parameter
from hil.signals.interval import COVERED

_PLACE = re.compile(r"\{(\w+)(:%|:\?)?\}")
_NOT_REACHED = "none that was reached"
_LEFT_OUT, _NEW = "The model leaves out", "New since identification:"
_NO_PHYSICS = "No physics is missing, but the unit has changed."
# Differences of the laws that stay below this share of the noise do not show in a recording.
_HIDDEN_IN_NOISE = 0.25
# No wear makes a parameter so many times what it was; a heading or a time in a wrong unit does.
_BEYOND_WEAR = 5.0


def quantity_text(value: float, std: float | None, unit: str) -> str:
    """`2.41 ± 0.12 %`: the 95 % interval, as many digits as it supports; a pure number has no unit."""
    shown = _unit_text(unit)
    if std is None or not math.isfinite(std) or std <= 0.0:
        return f"{value:.3g}{shown}"
    expanded = COVERED * std
    if expanded >= abs(value):
        return f"{value:.2g} ± {expanded:.2g}{shown}"
    digits = _digits(expanded)
    return f"{value:.{digits}f} ± {expanded:.{digits}f}{shown}"


def _digits(expanded: float) -> int:
    """Decimal places that an interval supports."""
    return max(0, 1 - math.floor(math.log10(expanded)))


def _change_text(before: float, after: float, std: float | None, unit: str) -> str:
    """`2.41 ± 0.12 % instead of 2.20 %`: what it was is told as exactly as what it is."""
    now = quantity_text(after, std, unit)
    if std is None or not 0.0 < COVERED * std < abs(after):
        return f"{now} instead of {quantity_text(before, None, unit)}"
    return f"{now} instead of {before:.{_digits(COVERED * std)}f}{_unit_text(unit)}"


def _unit_text(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"


def sentence(effect: Effect, term: Term, quantities: Mapping[str, Quantity]) -> str:
    """The effect's sentence with its values; for a changed base parameter, what it was and what it is."""
    title = effect.title[0].upper() + effect.title[1:]
    if term.kind == "parameter":
        now = quantities[term.name]
        return f"{title}: {now.meaning} is {_change_text(term.nominal, now.value, now.std, now.unit)}."
    if term.held:
        changes = [f"{q.meaning} is {_change_text(q.was or 0.0, q.value, q.std, q.unit)}" for q in quantities.values()]
        return f"{title} has changed: {_listed(changes)}."

    def text(match: re.Match[str]) -> str:
        q = quantities.get(match.group(1))
        if q is None:
            return match.group(0)
        if match.group(2) == ":?" and (q.std is None or not math.isfinite(q.std)):
            return _NOT_REACHED
        if match.group(2) == ":%":  # a share, told in percent
            return quantity_text(100.0 * q.value, None if q.std is None else 100.0 * q.std, "%")
        return quantity_text(q.value, q.std, q.unit)

    return _PLACE.sub(text, effect.sentence)


def nothing_identifiable(ceiling: float) -> str:
    """What stands in the place of an agreement that would mean nothing."""
    return (
        f"Nothing can be said of this unit: noise allows a fit of {ceiling:.3g} % at most. "
        "Record it with a larger command, or with less noise."
    )


def headline(
    verdict: DiagnosisVerdict,
    found: Sequence[Finding],
    changed: Sequence[ChangedParameter],
    left: Left,
    hidden: str = "",
    alike: Sequence[str] = (),
    *,
    is_cut: bool = False,
    is_change: bool = False,
) -> str:
    """The verdict in one sentence.

    `hidden`: why an agreement would mean nothing, if it would. `alike`: effects that come nearest where none is named,
    since the data do not tell them from each other or from something unknown. `is_cut`: whether the budget was spent
    before all causes were looked at. `is_change`: whether it is of what has changed since identification; shares are of
    that.
    """
    if verdict == "consistent" and hidden:
        return hidden
    if verdict == "consistent":
        return "The model agrees with the recordings within their noise."
    if verdict == "parameter_change":
        first = "The unit has changed since identification." if is_change else _NO_PHYSICS
        return " ".join([first, *(_change(c) for c in changed)])
    if verdict == "explained":
        them = "it" if len(found) == 1 else "them"
        how_far = f"{100.0 * (1.0 - left.share):.4g} % of the change is explained" if is_change else _how_far(left)
        return f"{_what(found, is_change=is_change)} With {them} {how_far}."
    if verdict == "partly_explained":
        more = "has changed" if is_change else "is missing"
        whole = "change" if is_change else "misfit"
        return (
            f"{_what(found, is_change=is_change)} Something more {more}: {100 * left.share:.3g} % of the {whole} stays."
        )
    differ = (
        f"The model and the recordings differ by {left.nominal_rms:.2g}{_unit_text(left.unit)} (rms) beyond the noise"
    )
    if alike:
        names = _listed([name.replace("_", " ") for name in alike])
        come = "comes" if len(alike) == 1 else "come"
        return f"{differ}. {names.capitalize()} {come} nearest, and something unknown explains it as well."
    if is_cut:
        return f"{differ}. Not finished: the budget was spent before all causes were looked at."
    return f"{differ}, and nothing in the library explains it."


def _what(found: Sequence[Finding], *, is_change: bool) -> str:
    """What the model leaves out, or what is new in the unit, and what in the model has changed, a sentence each."""
    new, held = ([_placed(f) for f in found if f.is_new is wanted] for wanted in (True, False))
    parts = [f"{_NEW if is_change else _LEFT_OUT} {_listed(new)}."] if new else []
    return " ".join([*parts, *([f"What the model has of {_listed(held)} has changed."] if held else [])])


def _placed(f: Finding) -> str:
    return f"{f.title} ({f.stage})" if f.stage else f.title


def _how_far(left: Left) -> str:
    if left.rms <= _HIDDEN_IN_NOISE * left.noise_std:
        return "the recordings are explained down to what noise allows"
    explained = f"{100.0 * (1.0 - left.share):.4g} % of the misfit is explained"
    unit = _unit_text(left.unit)
    return f"{explained}: {left.rms:.2g}{unit} (rms) stay beside noise of {left.noise_std:.2g}{unit}"


def _change(c: ChangedParameter) -> str:
    return f"{c.meaning[0].upper()}{c.meaning[1:]} is {_change_text(c.before, c.after, c.std, c.unit)}."


def unlikely(changed: Sequence[ChangedParameter]) -> tuple[str, ...]:
    """A word on parameters that have changed by more than units do, one sentence each."""
    return tuple(
        f"{p.name} is {p.times:.3g} times what it was: if that cannot be, look at the units of the channels and of time"
        for p in changed
        if not 1.0 / _BEYOND_WEAR < p.times < _BEYOND_WEAR
    )


def confounded(changed: ChangedParameter, others: Sequence[str], was: float) -> str:
    """A word on a parameter that has changed and was never told by itself; `was`: what it was if it changed alone."""
    before = f"{was:.4g}{_unit_text(changed.unit)}"
    return (
        f"the recordings that the model was identified from tell {changed.name} only together with {_listed(others)}. "
        f"Which of them has changed is open; if it is {changed.name} alone, it was {before}"
    )


def drifted(moved: Sequence[Parameter], before: Mapping[str, float], after: Mapping[str, float]) -> str:
    """What has moved where the model fits only with it, no farther than it may wander."""
    moves = [f"{p.name} is {after[p.name]:.5g}{_unit_text(p.unit)} instead of {before[p.name]:.5g}" for p in moved]
    return (
        "it agrees only with parameters that have moved, within what was known of them and how units drift. "
        f"The corrected model has them: {_listed(moves)}"
    )


def _listed(names: Sequence[str]) -> str:
    """`a`, `a and b`, `a, b and c`."""
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
