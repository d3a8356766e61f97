"""Numbers and findings in words that an operator understands."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from string import Formatter

from hil.diagnosis.diagnosis import ChangedParameter, DiagnosisVerdict, Finding, Left, Quantity
from hil.diagnosis.search.terms import Term
from hil.language.note import Note
from hil.physics.effect import Effect
from hil.physics.plant import Parameter, Parameters
from hil.signals.interval import COVERED

# Differences of the laws that stay below this share of the noise do not show in a recording.
_HIDDEN_IN_NOISE = 0.25
# No wear makes a parameter so many times what it was; a heading or a time in a wrong unit does.
_BEYOND_WEAR = 5.0


def quantity_text(value: float, std: float | None, unit: str) -> Note:
    """`2.41 ± 0.12 %`: the 95 % interval, as many digits as it supports; a pure number has no unit."""
    shown = _unit_text(unit)
    if std is None or not math.isfinite(std) or std <= 0.0:
        return _label(f"{value:.3g}{shown}")
    expanded = COVERED * std
    if expanded >= abs(value):
        return _label(f"{value:.2g} ± {expanded:.2g}{shown}")
    digits = _digits(expanded)
    return _label(f"{value:.{digits}f} ± {expanded:.{digits}f}{shown}")


def _label(text: str) -> Note:
    """A text whose numbers get the decimal sign of a page."""
    return Note("{text!l}", text=text)


def _digits(expanded: float) -> int:
    """Decimal places that an interval supports."""
    return max(0, 1 - math.floor(math.log10(expanded)))


def _change_text(before: float, after: float, std: float | None, unit: str) -> Note:
    """`2.41 ± 0.12 % instead of 2.20 %`: what it was is told as exactly as what it is."""
    was = quantity_text(before, None, unit)
    if std is not None and 0.0 < COVERED * std < abs(after):
        was = _label(f"{before:.{_digits(COVERED * std)}f}{_unit_text(unit)}")
    return Note("{now} instead of {was}", now=quantity_text(after, std, unit), was=was)


def _unit_text(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"


def sentence(effect: Effect, term: Term, quantities: Mapping[str, Quantity]) -> Note:
    """The effect's sentence with its values; for a changed base parameter, what it was and what it is."""
    title = Note(effect.title)
    if term.kind == "parameter":
        now = quantities[term.name]
        change = _change_text(term.nominal, now.value, now.std, now.unit)
        return Note("{title!c}: {meaning} is {change}.", title=title, meaning=Note(now.meaning), change=change)
    if term.held:
        changes = [
            Note(
                "{meaning} is {change}",
                meaning=Note(q.meaning),
                change=_change_text(q.was or 0.0, q.value, q.std, q.unit),
            )
            for q in quantities.values()
        ]  # fmt: skip
        return Note("{title!c} has changed: {changes}.", title=title, changes=_listed(changes))
    places = {name: spec for _text, name, spec, _how in Formatter().parse(effect.sentence) if name}
    return Note(effect.sentence, **{name: _shown(quantities.get(name), name, spec) for name, spec in places.items()})


def _shown(q: Quantity | None, name: str, spec: str | None) -> str:
    """What stands in a place of an effect's sentence: `{x:%}` in percent, `{x:?}` if it was reached."""
    if q is None:
        return f"{{{name}}}"
    if spec == "?" and (q.std is None or not math.isfinite(q.std)):
        return Note("none that was reached")
    if spec == "%":
        return quantity_text(100.0 * q.value, None if q.std is None else 100.0 * q.std, "%")
    return quantity_text(q.value, q.std, q.unit)


def nothing_identifiable(ceiling: float) -> Note:
    """What stands in the place of an agreement that would mean nothing."""
    return Note(
        "This unit cannot be judged: noise allows a fit of {ceiling:.3g} % at most. Record it with a larger "
        "command, or with less noise.",
        ceiling=ceiling,
    )


def headline(
    verdict: DiagnosisVerdict,
    found: Sequence[Finding],
    changed: Sequence[ChangedParameter],
    left: Left,
    hidden: Note | None = None,
    alike: Sequence[str] = (),
    *,
    is_cut: bool = False,
    is_change: bool = False,
) -> Note:
    """The verdict in one sentence.

    `hidden`: why an agreement would mean nothing, if it would. `alike`: effects that come nearest where none is named,
    since the data do not tell them from each other or from something unknown. `is_cut`: whether the budget was spent
    before all causes were looked at. `is_change`: whether it is of what has changed since identification; shares are of
    that.
    """
    if verdict == "consistent":
        return hidden or Note("The model agrees with the recordings within their noise.")
    of_effects = {name for f in found for name in f.parameters}  # a parameter grown into an effect is that effect
    changed = [c for c in changed if c.name not in of_effects]
    causes, share = _causes(verdict, found, changed, is_change=is_change), 100.0 * left.share
    if verdict == "parameter_change":
        return _joined(causes)
    if verdict == "explained":
        far = Note("{share:.4g} % of the change is explained", share=100.0 - share) if is_change else _how_far(left)
        is_one = len(found) + len(changed) == 1
        return _joined([*causes, Note("With it {far}.", far=far) if is_one else Note("With them {far}.", far=far)])
    if verdict == "partly_explained":
        if left.share <= 0.0:  # as rounded: a percentage of a large misfit would hide what stays
            stays = Note(
                "{rms:.2g}{unit} (rms) stay beside noise of {noise:.2g}{unit}",
                rms=left.rms, noise=left.noise_std, unit=_unit_text(left.unit),
            )  # fmt: skip
        elif is_change:
            stays = Note("{share:.3g} % of the change stays", share=share)
        else:
            stays = Note("{share:.3g} % of the misfit stays", share=share)
        more = Note("Something more has changed") if is_change else Note("Something more is missing")
        return _joined([*causes, Note("{more}: {stays}.", more=more, stays=stays)])
    differ = Note(
        "The model and the recordings differ by {rms:.2g}{unit} (rms) beyond the noise",
        rms=left.nominal_rms, unit=_unit_text(left.unit),
    )  # fmt: skip
    if alike:
        names = _listed([Note(name.replace("_", " ")) for name in alike])
        come = Note("{names!c} come nearest, and something unknown explains it as well.", names=names)
        if len(alike) == 1:
            come = Note("{names!c} comes nearest, and something unknown explains it as well.", names=names)
        return _joined([differ.stopped, come])
    if is_cut:
        cut = Note("Not finished: the budget was spent before all causes were looked at.")
        return _joined([differ.stopped, cut])
    return Note("{differ}, and nothing in the library explains it.", differ=differ)


def _joined(sentences: Sequence[Note]) -> Note:
    """One after another."""
    first, *rest = sentences
    for one in rest:
        first = Note("{first} {then}", first=first, then=one)
    return first


def _causes(
    verdict: DiagnosisVerdict, found: Sequence[Finding], changed: Sequence[ChangedParameter], *, is_change: bool
) -> list[Note]:
    """What the model leaves out, or what is new in the unit, and what in the model has changed, a sentence each."""
    new, held = ([_placed(f) for f in found if f.is_new is wanted] for wanted in (True, False))
    parts = []
    if new:
        listed = _listed(new)
        left_out = Note("The model leaves out {effects}.", effects=listed)
        parts.append(Note("New since identification: {effects}.", effects=listed) if is_change else left_out)
    if held:
        parts.append(Note("What the model has of {effects} has changed.", effects=_listed(held)))
    if changed and not found:
        is_all = verdict == "parameter_change" and not is_change
        other = Note("The unit has changed since identification.")
        parts.append(Note("No physics is missing, but the unit has changed.") if is_all else other)
    return [*parts, *map(_change, changed)]


def _placed(f: Finding) -> Note:
    title = Note(f.title)
    return Note("{title} ({stage})", title=title, stage=Note(f.stage)) if f.stage else title


def _how_far(left: Left) -> Note:
    if left.rms <= _HIDDEN_IN_NOISE * left.noise_std:
        return Note("the recordings are explained down to what noise allows")
    return Note(
        "{share:.4g} % of the misfit is explained: {rms:.2g}{unit} (rms) stay beside noise of {noise:.2g}{unit}",
        share=100.0 * (1.0 - left.share), rms=left.rms, noise=left.noise_std, unit=_unit_text(left.unit),
    )  # fmt: skip


def _change(c: ChangedParameter) -> Note:
    return Note(
        "{meaning!c} is {change}.", meaning=Note(c.meaning), change=_change_text(c.before, c.after, c.std, c.unit)
    )


def unlikely(changed: Sequence[ChangedParameter]) -> tuple[Note, ...]:
    """A word on parameters that have changed by more than units do, one sentence each."""
    return tuple(
        Note(
            "{name} is {times:.3g} times what it was: if that cannot be, look at the units of the channels and of time",
            name=p.name, times=p.times,
        )
        for p in changed
        if not 1.0 / _BEYOND_WEAR < p.times < _BEYOND_WEAR
    )  # fmt: skip


def confounded(changed: ChangedParameter, others: Sequence[str], was: float) -> Note:
    """A word on a parameter that has changed and was never told by itself; `was`: what it was if it changed alone."""
    return Note(
        "the recordings that the model was identified from tell {name} only together with {others}. Which of them has "
        "changed is open; if it is {name} alone, it was {was:.4g}{unit}",
        name=changed.name, others=_listed(others), was=was, unit=_unit_text(changed.unit),
    )  # fmt: skip


def drifted(moved: Sequence[Parameter], before: Parameters, after: Parameters) -> Note:
    """What has moved where the model fits only with it, no farther than it may wander."""
    moves = [
        Note("{name} is {now:.5g}{unit} instead of {was:.5g}", name=p.name, now=after[p.name], was=before[p.name],
             unit=_unit_text(p.unit))
        for p in moved
    ]  # fmt: skip
    return Note(
        "it agrees only with parameters that have moved, within what was known of them and how units drift. The "
        "corrected model has them: {moves}",
        moves=_listed(moves),
    )


def _listed(names: Sequence[str]) -> str:
    """`a`, `a and b`, `a, b and c`."""
    *some, last = names
    return Note("{some} and {last}", some=tuple(some), last=last) if some else last
