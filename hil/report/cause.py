"""Why a unit missed its certificate, in sentences."""

from __future__ import annotations

from hil.language.words import _, marked
from hil.record.cause import Cause, Found
from hil.record.measurement import COVERAGE_FACTOR
from hil.report.name import quantity_words
from hil.report.number import with_uncertainty

_MOST = 4
_NEXT_TO_NOTHING, _FEW_PER_CENT = 0.01, 0.05
_WHOSE = {
    "valve": marked("the valve's"),
    "bench": marked("the bench's"),
    "open": marked("the valve's or the bench's"),
}


def cause_sentences(cause: Cause) -> list[str]:
    """What was found, or that nothing was; then by which command and in which time."""
    sentence = _(
        "{answer} This took {seconds} s of {budget} s at most. `{command}` looks again, for as long as it needs."
    )
    return [_answer(cause)] if not cause.command else [
        sentence.format(answer=_answer(cause), seconds=f"{cause.seconds:.0f}", budget=f"{cause.budget_s:.3g}",
                    command=cause.command)
    ]  # fmt: skip


def _answer(cause: Cause) -> str:
    beside = _("the run {run} of this unit").format(run=cause.since) if cause.since else _("the model of the type")
    if not cause.verdict:
        return _reason(cause)
    if cause.found:
        weighty = [one for one in cause.found if _is_weighty(one)] or cause.found
        found = "; ".join(_found(one) for one in weighty[:_MOST])
        more = len(cause.found) - len(weighty[:_MOST])
        found += _("; {n} smaller").format(n=more) if more > 0 else ""
        sentence = _("What differs from {beside}: {found}.").format(beside=beside, found=found)
        several = [_("Together they describe the answer; one by itself need not be so.")] if len(weighty) > 1 else []
        part = [_("This does not explain all of it.")] if _is_part(cause) else []
        return " ".join((sentence, *several, *part))
    if cause.verdict in ("consistent", "unchanged"):
        return _("The cause is not known: the recorded answer agrees with {beside} within its noise.").format(
            beside=beside
        )
    return _unexplained(cause, beside)


def _reason(cause: Cause) -> str:
    if cause.reason == "out of time":
        return _("The cause was not found within {budget} s.").format(budget=f"{cause.budget_s:.3g}")
    if cause.reason == "stopped by the operator":
        return _("The cause is not known: the search was stopped.")
    return _("The cause is not known: {reason}.").format(reason=cause.reason.rstrip("."))


def _unexplained(cause: Cause, beside: str) -> str:
    if cause.not_searched:
        return _("The cause was not found within {budget} s: {not_searched} were not looked at.").format(
            budget=f"{cause.budget_s:.3g}", not_searched=cause.not_searched
        )
    return _("The cause is not known: the answer differs from {beside}, and nothing that is known explains it.").format(
        beside=beside
    )


def _is_part(cause: Cause) -> bool:
    return cause.verdict in ("partly_explained", "unexplained")


def _is_weighty(one: Found) -> bool:
    """Whether it is worth a place on page one: nearly nothing of the change, or a few per cent of itself, is not."""
    if one.share is not None and one.share < _NEXT_TO_NOTHING:
        return False
    if not one.before or one.after is None:
        return True
    return abs(one.after / one.before - 1.0) >= _FEW_PER_CENT


def _found(one: Found) -> str:
    """`leakage 80.0 → 100.003 ± 0.015 ml/min (the valve's, 12 % of the change)`."""
    sizes = [_size(one.before, one.before_std, ""), _size(one.after, one.after_std, one.unit)]
    change = " → ".join(size for size in sizes if size)
    beside = [_(_WHOSE[one.of])] if one.of in _WHOSE else []
    if one.alike:
        names = ", ".join(_(quantity_words(name)) for name in one.alike)
        beside.append(_("or {names}: these data do not tell which").format(names=names))
    sentence = f"{_(quantity_words(one.name))} {change}".rstrip()
    return f"{sentence} ({', '.join(beside)})" if beside else sentence


def _size(value: float | None, std: float | None, unit: str) -> str:
    return "" if value is None else with_uncertainty(value, None if std is None else COVERAGE_FACTOR * std, unit)
