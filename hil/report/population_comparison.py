"""The unit beside good ones of its type in sentences: what differs and by how much, what does not, on what it rests."""

from __future__ import annotations

from hil.language.words import _
from hil.record.measurement import Measured
from hil.record.population_comparison import PopulationComparison
from hil.report.name import quantity_words
from hil.report.number import number, unit_text, with_uncertainty


def population_sentences(found: PopulationComparison) -> list[str]:
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
    by = f"{number(value - high if above else low - value, 2)} {unit_text(m.unit)}"
    where = (_("above by {by}") if above else _("below by {by}")).format(by=by)
    return f"{_figure(m)} ({_range(m)}: {where})"


def _within(m: Measured) -> str:
    return f"{_figure(m)} ({_range(m)})"


def _figure(m: Measured) -> str:
    return f"{_(quantity_words(m.quantity))} {with_uncertainty(m.value, m.expanded, m.unit)}"


def _range(m: Measured) -> str:
    return _("good {low} … {high} {unit}").format(low=number(m.low, 2), high=number(m.high, 2), unit=unit_text(m.unit))
