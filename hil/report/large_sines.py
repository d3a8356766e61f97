"""Large sines: samples and fit over two periods, what the fit leaves, and the harmonics."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from hil.language.words import _
from hil.report.field import Curve, array, label_of, needed, unit_of
from hil.report.figure import (
    COMMAND,
    FITTED,
    LEFT,
    LEVEL,
    MEASURED,
    Picture,
    drawn,
    legend_on_top,
    line,
    thinned,
    titled,
)
from hil.report.number import fixed
from hil.report.section import Section, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NEEDED = ("time_s", "measured", "fitted")
_SIDE_BY_SIDE = 3


def large_sines_section(curves: Sequence[Curve]) -> Section:
    """Every sine of a run, three beside each other."""
    groups = [curves[i : i + _SIDE_BY_SIDE] for i in range(0, len(curves), _SIDE_BY_SIDE)]
    pictures = tuple(_picture(f"large-sines-{k}", group) for k, group in enumerate(groups))
    table = _harmonics(curves)
    return Section(_("Large sines"), figures=pictures, tables=(table,) if table.rows else ())


def _picture(name: str, curves: Sequence[Curve]) -> Picture:
    def draw(figure: Figure) -> None:
        rows = figure.subplots(2, len(curves), sharex="col", sharey="row", squeeze=False, height_ratios=(2.4, 1.0))
        for above, below, curve in zip(rows[0], rows[1], curves, strict=True):
            _sine(above, curve)
            left = needed(curve, "measured") - needed(curve, "fitted")
            below.axhline(0.0, **LEVEL)
            below.plot(*thinned(needed(curve, "time_s"), left), **LEFT)
            below.set_xlabel(_("time [s]"))
            below.margins(x=0.0)
        rows[0][0].set_ylabel(_("response") + unit_of(curves[0], "response_unit"))
        rows[1][0].set_ylabel((_("difference") + unit_of(curves[0], "response_unit")).replace(" [", "\n["))
        legend_on_top(rows[0][0])

    caption = _(
        "Above: samples, the fundamental with harmonics 2 to 5 that was fitted to them, and the command in its own "
        "unit. Below: what the fit leaves."
    )
    return drawn(name, 3.6, draw, caption)


def _sine(axes: Axes, curve: Curve) -> None:
    line(axes, curve, "time_s", "measured", MEASURED, _("measured"))
    line(axes, curve, "time_s", "fitted", FITTED, _("fitted"))
    if curve.get("command") is not None:
        line(axes, curve, "time_s", "command", COMMAND, _("command") + unit_of(curve, "command_unit"))
    titled(axes, label_of(curve))


def _harmonics(curves: Sequence[Curve]) -> Table:
    found = [(label_of(c), array(c, "harmonics_percent")) for c in curves]
    rows = tuple((label, *(fixed(float(v), 2) for v in values)) for label, values in found if values is not None)
    orders = range(2, 2 + max((len(row) - 1 for row in rows), default=0))
    return Table(_("Harmonics over the fundamental"), (_("Sine"), *(f"{k} · f [%]" for k in orders)), rows)
