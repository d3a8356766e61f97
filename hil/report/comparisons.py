"""The unit beside the model of its type, itself before and good ones, in sentences: why it missed its certificate."""

from __future__ import annotations

from hil.language.words import _, marked
from hil.record.cause import Cause, Found
from hil.record.measurement import Findings, Measured, is_accepted
from hil.record.population_comparison import PopulationComparison
from hil.record.previous_run import Moved, PreviousRunComparison
from hil.report.local_time import local_text
from hil.report.name import quantity_words
from hil.report.number import label_text, number, unit_text, with_std, with_unit

_MOST_FOUND, _MOST_MOVED = 4, 6
_OUT_OF_TIME = "out of time"  # a reason, which says the time itself
_NEXT_TO_NOTHING, _FEW_PER_CENT = 0.01, 0.05
_WHOSE = {
    "valve": marked("the valve's"),
    "bench": marked("the bench's"),
    "open": marked("the valve's or the bench's"),
}


def comparison_sentences(findings: Findings) -> list[str]:
    """The unit beside itself before and beside good ones, where something was missed or cannot be told.

    No part of the verdict.
    """
    if is_accepted(findings.verdict):
        return []
    cause = [] if findings.cause is None else _cause(findings.cause)
    before = [] if findings.since is None else _previous_run(findings.since)
    return [*cause, *before, *([] if findings.population is None else _population(findings.population))]


def _cause(cause: Cause) -> list[str]:
    """What was found, or that nothing was; then by which command and in which time."""
    if not cause.command:
        return [_answer(cause)]
    taken = _("This took {seconds} s of {budget} s at most.").format(
        seconds=f"{cause.seconds:.0f}", budget=f"{cause.budget_s:.3g}"
    )
    again = _("`{command}` looks again, for as long as it needs.").format(command=cause.command)
    return [" ".join((_answer(cause), *(() if cause.reason == _OUT_OF_TIME else (taken,)), again))]


def _answer(cause: Cause) -> str:
    beside = _("the run {run} of this unit").format(run=cause.since) if cause.since else _("the model of the type")
    if not cause.verdict:
        return _reason(cause)
    if cause.found:
        weighty = [one for one in cause.found if _is_weighty(one)] or cause.found
        found = "; ".join(_found(one) for one in weighty[:_MOST_FOUND])
        more = len(cause.found) - len(weighty[:_MOST_FOUND])
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
    if cause.reason == _OUT_OF_TIME:
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
    return "" if value is None else with_std(value, std, unit)


def _previous_run(found: PreviousRunComparison) -> list[str]:
    """What changed and how much did not; then on what that rests and how to ask for the cause."""
    when = local_text(found.started_utc)
    if found.moved:
        figures = ", ".join(_change(one) for one in found.moved[:_MOST_MOVED])
        more = len(found.moved) - _MOST_MOVED
        figures += _(" and {n} more").format(n=more) if more > 0 else ""
        sentence = _("Since the run of this unit on {when} ({verdict}): {figures}.").format(
            when=when, verdict=_verdict(found), figures=figures
        )
    else:
        sentence = _(
            "Since the run of this unit on {when} ({verdict}) no value changed beyond its uncertainty."
        ).format(when=when, verdict=_verdict(found))
    instruments = (
        _("Both were measured with the same instruments.")
        if found.same_instruments
        else _("The instruments or their calibrations differ; that is in the uncertainty of each change.")
    )
    rests = _(
        "{same} other values did not change beyond their uncertainty, {not_compared} cannot be compared. {instruments} "
        "`hil diff {run} RUN --model MODEL.json` looks for the cause, in the valve or in the bench."
    ).format(same=found.same, not_compared=found.not_compared, instruments=instruments, run=found.run)
    return [sentence, rests]


def _change(one: Moved) -> str:
    """`friction 3.1 ± 0.2 → 172.2 ± 1.3 mA`."""
    quantity, _comma, place = one.now.name.partition(", ")
    where = _(" at {place}").format(place=label_text(place)) if place else ""
    then, now = (with_std(m.value, m.std, unit) for m, unit in ((one.then, ""), (one.now, one.now.unit)))
    return f"{_(quantity_words(quantity))}{where} {then} → {now}"


def _verdict(found: PreviousRunComparison) -> str:
    return _(found.verdict or "not judged")


def _population(found: PopulationComparison) -> list[str]:
    """What differs, what does not and what cannot be told; then on what that rests."""
    if not found.figures:
        return [_("What differs from good units of its type is not known: {reason}.").format(reason=found.reason)]
    sentences = [
        (_("differs in {figures}"), [_beyond(m) for m in found.those("fail")]),
        (_("is like them in {figures}"), [_within(m) for m in found.those("pass")]),
        (_("may be either in {figures}"), [_within(m) for m in found.those("cannot tell")]),
    ]
    parts = [text.format(figures=", ".join(figures)) for text, figures in sentences if figures]
    return [
        _("Beside good units of its type, this one {parts}.").format(parts="; ".join(parts)),
        _(
            "This rests on figures of this run and on {n} simulated good units, of which {percent} % lie beyond either "
            "end of a range. It names what differs, not the cause, and does not tell valve from bench; `hil diagnose` "
            "looks for the cause."
        ).format(n=found.good_units, percent=number(100.0 * found.beyond)),
    ]


def _beyond(m: Measured) -> str:
    """`friction 45 ± 3 mA (good 3 … 20 mA: above by 25 mA)`."""
    value, low, high = m.value or 0.0, m.low or 0.0, m.high or 0.0
    above = value > high
    by = with_unit(value - high if above else low - value, m.unit, 2)
    where = (_("above by {by}") if above else _("below by {by}")).format(by=by)
    return f"{_figure(m)} ({_range(m)}: {where})"


def _within(m: Measured) -> str:
    return f"{_figure(m)} ({_range(m)})"


def _figure(m: Measured) -> str:
    return f"{_(quantity_words(m.quantity))} {with_std(m.value, m.std, m.unit)}"


def _range(m: Measured) -> str:
    return _("good {low} … {high} {unit}").format(low=number(m.low, 2), high=number(m.high, 2), unit=unit_text(m.unit))
