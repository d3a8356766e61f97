"""The page of two runs side by side: every value with its change, and their curves over each other."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hil.arrays import Array
from hil.findings.difference import Difference, by_name
from hil.findings.results import Curve, Results
from hil.language.words import _
from hil.record.measurement import Measured
from hil.report import results
from hil.report.figure import DASHES, MOST_DRAWN, SERIES, Picture, along, drawn, legend_above, thinned
from hil.report.local_time import local_text
from hil.report.name import quantity_words, value_words
from hil.report.number import number, with_std
from hil.report.page import page, write_page
from hil.report.section import Section, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LEAST_CHANCE = 1e-6  # a smaller one is a statement about the tail of a distribution, not about a valve
_FEW = 20  # points that come in no order are single ones, not a line


@page
def write_comparison_page(
    first: Results, second: Results, found: Sequence[Difference], one_bench: bool, path: Path
) -> None:
    """Write the page.

    Raises:
        StorageError: it cannot be written.
    """
    write_page(
        "comparison.html", path, simulated=bool(first.simulated or second.simulated), kicker=_("Two runs"),
        title=_("{first} and {second}").format(first=first.run, second=second.run),
        headline=headline(found), verdicts=verdicts_sentence(first, second), order=order_sentence(first, second),
        shared=shared_sentence(one_bench),
        sections=[Section(_("Values"), tables=(_table(first, second, found),)), *_overlays(first, second)],
    )  # fmt: skip


def dated(results: Results) -> str:
    """The name of a run with the local time at which it started."""
    return results.run if results.started_utc is None else f"{results.run} ({local_text(results.started_utc)})"


def order_sentence(first: Results, second: Results) -> str:
    """Which run is the earlier one, and what is taken from what."""
    return _("Change from {first} to {second}: the later value less the earlier one.").format(
        first=dated(first), second=dated(second)
    )


def headline(found: Sequence[Difference]) -> str:
    """How many values differ, in one sentence."""
    moved = [value_words(one.name) for one in found if one.meaning == "differs"]
    if not moved:
        return _("No value differs beyond its uncertainty.")
    names = "; ".join(moved)
    return _("{n} of {all} values differ beyond their uncertainty: {names}.").format(
        n=len(moved), all=len(found), names=names
    )


def run_heads(first: Results, second: Results) -> tuple[str, str]:
    """What stands above the values of each run: *as found* and *as left* of a unit that failed and does no more."""
    is_one = bool(first.serial) and first.serial == second.serial
    if is_one and first.verdict == "fail" != second.verdict:
        return _("as found"), _("as left")
    return _("earlier"), _("later")


def verdicts_sentence(first: Results, second: Results) -> str:
    """The verdicts of both runs, and what had another limit; nothing where neither was judged."""
    if first.verdict is None and second.verdict is None:
        return ""
    one, other = (_(found.verdict or "not judged") for found in (first, second))
    sentence = _("Verdict: {first}, then {second}.").format(first=one, second=other)
    moved = dict.fromkeys(
        _(quantity_words(now.quantity)) for _name, then, now in by_name(first.values, second.values)
        if then and now and (then.low, then.high) != (now.low, now.high)
    )  # fmt: skip
    if moved:
        sentence += " " + _("Their limits differ: {names}.").format(names="; ".join(moved))
    return sentence


def verdict_change(one: Difference) -> str:
    """`fail → pass`, or the one verdict that both runs gave; nothing for a value without a limit."""
    given = [value.verdict for value in (one.first, one.second) if value and value.verdict]
    return " → ".join(_(verdict) for verdict in dict.fromkeys(given))


def shared_sentence(one_bench: bool) -> str:
    """What was done with the calibration."""
    if one_bench:
        return _("Both runs have the same instruments; what their calibration adds cancels and is left out.")
    return _("The runs have different instruments or calibrations; these are in the uncertainty of each change.")


def value_text(value: Measured | None) -> str:
    """A value with its expanded uncertainty."""
    return results.value_text(value) if value else _("not measured")


def change_text(one: Difference) -> str:
    """The change with its expanded uncertainty; nothing where it cannot be told."""
    if one.change is None or one.std is None:
        return ""
    return with_std(one.change, one.std)


def _table(first: Results, second: Results, found: Sequence[Difference]) -> Table:
    heads = (_("Quantity"), _("Unit"), *run_heads(first, second), _("Verdict"), _("Change ± U"), _("Chance"), "")
    rows = tuple(
        (value_words(one.name), one.unit, value_text(one.first), value_text(one.second), verdict_change(one),
         change_text(one), _chance(one), _(one.meaning))
        for one in found
    )  # fmt: skip
    caption = _("Chance: how likely a change so large is when nothing has changed.")
    return Table(caption, heads, rows, text_columns=(1, 4, 7))


def _chance(one: Difference) -> str:
    if one.chance is None:
        return ""
    return "< 10⁻⁶" if one.chance < _LEAST_CHANCE else number(one.chance, 2)


def _overlays(first: Results, second: Results) -> Iterator[Section]:
    by_name = {curve.name: curve for curve in second.curves}
    pairs = [(curve, by_name[curve.name]) for curve in first.curves if curve.name in by_name]
    pictures = [picture for a, b in pairs[:MOST_DRAWN] if (picture := _overlay(a, b, first.run, second.run))]
    if pictures:
        yield Section(_("Curves"), figures=tuple(pictures))


def _overlay(a: Curve, b: Curve, first: str, second: str) -> Picture | None:
    """Both curves over their first column, a drawing for each unit."""
    if a.columns != b.columns or len(a.columns) < 2:
        return None
    units = list(dict.fromkeys(column.unit for column in a.shown))

    def draw(figure: Figure) -> None:
        grid = figure.subplots(len(units), 1, sharex=True, squeeze=False)[:, 0]
        for axes, unit in zip(grid, units, strict=True):
            for colour, column in zip(SERIES, (c for c in a.shown if c.unit == unit), strict=False):
                for curve, run, dash in ((a, first, DASHES[0]), (b, second, DASHES[1])):
                    x, y = (curve.array(name) for name in (a.columns[0].name, column.name))
                    line = {"ls": dash} if _is_line(x) else {"ls": "", "marker": "o" if run == first else "x"}
                    axes.plot(*thinned(x, y), color=colour, label=f"{column.name}, {run}", **line)
            axes.set_ylabel(unit)
            legend_above(axes, 2)
        along(grid[-1], a.columns[0])

    return drawn(re.sub(r"\W+", "-", a.name), 0.8 + 2.2 * len(units), draw, a.name)


def _is_line(x: Array) -> bool:
    return len(x) > _FEW or bool(np.all(np.diff(x) > 0.0))
