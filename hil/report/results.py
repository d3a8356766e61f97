"""Measured values as the verdict and the table of results that a report begins with."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from itertools import groupby
from typing import Any

from hil.language.words import _, marked
from hil.record.measurement import COVERAGE_FACTOR, Findings, Measured, ending_of, present_name
from hil.record.previous_run import PreviousRunComparison
from hil.report.comparisons import comparison_sentences
from hil.report.name import capital, quantity_words
from hil.report.number import label_text, limits_text, number, rounded, unit_text, with_std, with_unit

_WORDS = {
    "pass": ("good", marked("Pass"), marked("Every limit is met for certain.")),
    "fail": ("bad", marked("Fail"), marked("At least one limit is missed.")),
    "cannot tell": (
        "open",
        marked("Cannot tell"),
        marked("No limit is missed for certain, but not all of them are met for certain."),
    ),
    None: (
        "",
        marked("Not judged"),
        marked("No limit was given, so nothing was judged; the results are stated as measured."),
    ),
}


_LEAST_PERCENT = 0.001  # a smaller one is a statement about the tail of a distribution, not about a bench
_UNFINISHED = ("open", marked("Not finished"), marked("The test did not end as planned, so it proves nothing."))


def verdict_words(verdict: str | None, *, finished: bool) -> dict[str, str]:
    """Tone, word and sentence of a verdict; of a test that was not finished nothing but a miss is one."""
    tone, word, sentence = _WORDS[verdict] if finished or verdict == "fail" else _UNFINISHED
    return {"tone": tone, "word": _(word), "sentence": _(sentence)}


def verdict_box(findings: Findings, meta: Mapping[str, Any]) -> dict[str, Any]:
    """The verdict in words, with every limit that is not met for certain and whatever went wrong."""
    details = []
    if ending := ending_of(meta):
        details.append(_("The run did not end as planned: {outcome}.").format(outcome=_(ending)))
    if missing := meta.get("incomplete"):
        details.append(_("The recording is incomplete: {missing}.").format(missing=missing))
    words = verdict_words(findings.verdict, finished=not details)
    details += reasons(findings)
    return {
        **words,
        "details": details,
        "next": next_step(findings.open_or_missed),
        "beside": comparison_sentences(findings),
    }


def value_text(m: Measured, unit: str = "") -> str:
    """`> 1.269 ± 0.012 Hz`: a measured value with its expanded uncertainty."""
    if m.value is None:
        return _("not determined")
    return _sign(m) + with_std(m.value, m.std, unit)


def repeatability_text(m: Measured) -> str:
    """The expanded uncertainty without the calibration's part; empty where the calibration has none."""
    if m.value is None or m.repeatability is None or not m.calibration_std:
        return ""
    return rounded(m.value, COVERAGE_FACTOR * m.repeatability)[1]


def reasons(findings: Findings) -> list[str]:
    """What keeps a run from passing, misses first; beside each miss how easily this bench measures one."""
    found = sorted(findings.open_or_missed, key=lambda m: m.verdict != "fail")
    return [" ".join(filter(None, (verdict_sentence(m), _fail_sentence(m, findings.since)))) for m in found]


def _fail_sentence(m: Measured, since: PreviousRunComparison | None) -> str:
    """How likely a unit exactly at the limit, and one as this unit was before, would have been measured failing."""
    if m.verdict != "fail" or (at_limit := m.fail_probability_at_limit) is None:
        return ""
    text = _("{percent} of tests on this bench would fail a unit exactly at the limit")
    parts = [text.format(percent=_percent(at_limit))]
    before = next((one for one in (since.missed if since else ()) if present_name(one.then.name) == m.name), None)
    if since and before:
        text = _("{percent} this unit as it was on {date} ({value})")
        parts.append(text.format(percent=_percent(before.fail_probability), date=since.started_utc.astimezone().date(),
                                 value=value_text(before.then, m.unit)))  # fmt: skip
    return "; ".join(parts) + "."


def _percent(share: float) -> str:
    return f"< {number(_LEAST_PERCENT)} %" if 0.0 < share < _LEAST_PERCENT / 100.0 else f"{number(100.0 * share, 2)} %"


def verdict_sentence(m: Measured) -> str:
    """`Cannot tell: rise is 71 ± 4 ms, limit ≤ 74 ms: it is met by 3 ms, but the uncertainty is 4 ms.`"""
    limit = f"{limits_text(m.low, m.high)} {unit_text(m.unit)}".strip()
    far = f": {_how_far(m)}" if _how_far(m) else ""
    place = _(" at {place}").format(place=_place(m)) if _place(m) else ""
    return _("{verdict}: {quantity}{place} is {value}, limit {limit}{far}.").format(
        verdict=capital(_(str(m.verdict))), quantity=_(quantity_words(m.quantity)), place=place,
        value=value_text(m, m.unit), limit=limit, far=far,
    )  # fmt: skip


def next_step(open_or_missed: Iterable[Measured]) -> str:
    """What to do now about what keeps a run from passing: about its misses, or else the first that is open."""
    found = list(open_or_missed)
    if any(m.verdict == "fail" for m in found):
        return _("Next: find the cause, or set the unit aside. A repeat is unlikely to change a certain miss.")
    return _(_step_of(found[0])) if found else ""


def _step_of(m: Measured) -> str:
    """What would close a value that cannot be told."""
    if m.value is None or m.std is None or not math.isfinite(m.std):
        return marked("Next: see the notes for why a value or its uncertainty is missing, then repeat the test.")
    if m.verdict_of_limits == "pass":
        return marked("Next: run the test to its end.")
    if m.relation != "=":
        return marked("Next: repeat the test with a wider range or less noise. So far there is only a bound.")
    near = min(abs(m.value - limit) for limit in (m.low, m.high) if limit is not None)
    if COVERAGE_FACTOR * m.calibration_std >= near:
        return marked("Next: use an instrument with a smaller calibration uncertainty. A repeat would not decide it.")
    return marked("Next: repeat the test or measure for longer. Noise alone leaves it open.")


def _how_far(m: Measured) -> str:
    """The distance of a value to its nearest limit beside its uncertainty, in words; empty for one not determined."""
    if m.value is None or not math.isfinite(m.value):
        return ""
    inside = min(m.value - limit if side == "low" else limit - m.value
                 for side, limit in (("low", m.low), ("high", m.high)) if limit is not None)  # fmt: skip
    if m.verdict == "cannot tell" and m.verdict_of_limits == "pass":
        return _("it is met, but the run did not end as planned")
    by = with_unit(abs(inside), m.unit, 2)
    where = (_("met by {by}") if inside > 0.0 else _("missed by {by}") if inside < 0.0 else _("met exactly")).format(
        by=by
    )
    if m.relation != "=":
        return _("a bound, the value itself may lie anywhere beyond it") if m.verdict == "cannot tell" else ""
    if m.std is None:
        return _("it is {where}, but the uncertainty is not known").format(where=where)
    if m.std == 0.0:
        return _("it is {where}").format(where=where)
    width = with_unit(COVERAGE_FACTOR * m.std, m.unit, 2)
    note = (
        _("it is {where}, but the uncertainty is {width}")
        if m.verdict == "cannot tell"
        else _("it is {where}, and the uncertainty is {width}")
    )
    return note.format(where=where, width=width)


def result_groups(measured: Iterable[Measured]) -> list[dict[str, Any]]:
    """Quantities in the order declared; one that was measured at several places has a line of its own above them."""
    found = []
    for quantity, members in groupby(_by_quantity(measured), key=lambda m: m.quantity):
        rows = list(members)
        group = {"name": capital(_(quantity_words(quantity))), "meaning": _(rows[0].meaning), "several": len(rows) > 1}
        found.append({**group, "rows": [_row(m, _place(m)) for m in rows]})
    return found


def _by_quantity(measured: Iterable[Measured]) -> list[Measured]:
    rows = list(measured)
    order = {quantity: i for i, quantity in reversed(list(enumerate(m.quantity for m in rows)))}
    return sorted(rows, key=lambda m: order[m.quantity])


def _place(m: Measured) -> str:
    return label_text(m.name.partition(", ")[2])


def _sign(m: Measured) -> str:
    return "" if m.relation == "=" else f"{m.relation} "


def _row(m: Measured, place: str) -> dict[str, Any]:
    value, uncertainty = rounded(m.value, m.expanded)
    return {
        "place": place,
        "value": _("not determined") if m.value is None else _sign(m) + value,
        "uncertainty": uncertainty,
        "repeatability": repeatability_text(m),
        "unit": unit_text(m.unit),
        "limits": limits_text(m.low, m.high),
        "verdict": m.verdict,
    }
