"""What changed in a unit since an earlier run, in sentences."""

from __future__ import annotations

from hil.language.words import _
from hil.record.previous_run import Moved, PreviousRunComparison
from hil.report.local_time import local_text
from hil.report.name import quantity_words
from hil.report.number import with_uncertainty

_MOST = 6


def previous_run_sentences(found: PreviousRunComparison) -> list[str]:
    """What changed and how much did not; then on what that rests and how to ask for the cause."""
    when = local_text(found.started_utc)
    if found.moved:
        figures = ", ".join(_change(one) for one in found.moved[:_MOST])
        more = len(found.moved) - _MOST
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
        else _("Instruments or calibrations are others; these are in the uncertainty of each change.")
    )
    rests = _(
        "{same} other values did not change beyond their uncertainty, {not_compared} cannot be compared. {instruments} "
        "`hil diff {run} RUN --model MODEL.json` looks for the cause, in the valve or in the bench."
    ).format(same=found.same, not_compared=found.not_compared, instruments=instruments, run=found.run)
    return [sentence, rests]


def _change(one: Moved) -> str:
    """`friction 3.1 ± 0.2 → 172.2 ± 1.3 mA`."""
    quantity, _comma, place = one.now.name.partition(", ")
    where = _(" at {place}").format(place=place) if place else ""
    then, now = (with_uncertainty(m.value, m.expanded, unit) for m, unit in ((one.then, ""), (one.now, one.now.unit)))
    return f"{_(quantity_words(quantity))}{where} {then} → {now}"


def _verdict(found: PreviousRunComparison) -> str:
    return _(found.verdict or "not judged")
