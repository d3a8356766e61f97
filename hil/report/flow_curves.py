"""The flow curve: both branches with their uncertainty, the laws fitted to them, the width of the loop."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.language.words import _, marked
from hil.record.measurement import COVERAGE_FACTOR
from hil.report.field import Curve, array, needed, unit_of
from hil.report.figure import (
    AMBER,
    BAND,
    BLUE,
    FAINT,
    GREEN,
    INK,
    LEFT,
    LEVEL,
    RED,
    drawn,
    legend_on_top,
    line,
    thinned,
)
from hil.report.section import Listing, Section

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NEEDED = ("command", "rising", "falling")


def flow_curve_section(curve: Curve) -> Section:
    """Static characteristic of the valve."""

    def draw(figure: Figure) -> None:
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3.0, 1.0))
        _branches(above, curve)
        _loop(below, curve)
        below.set_xlabel(_("command") + unit_of(curve, "command_unit"))
        below.margins(x=0.0)

    shaded = " " + _("Shaded: dead band.") if curve.get("dead_band") is not None else ""
    caption = (
        _("Above: mean response while the command rises and while it falls; bands: ±U (k = 2).")
        + f"{shaded} "
        + _("Below: width of the loop.")
    )
    text = curve.get("polynomial_text")
    listings = (Listing(_("Coefficients of the polynomial"), str(text)),) if text else ()
    title = _("Flow curve") if str(curve.get("response_unit", "l/min")).endswith("/min") else _("Characteristic curve")
    return Section(title, figures=(drawn("flow-curve", 4.9, draw, caption),), listings=listings)


def _branches(axes: Axes, curve: Curve) -> None:
    command, std = needed(curve, "command"), array(curve, "std")
    for key, color, dash in ((marked("rising"), BLUE, "-"), (marked("falling"), RED, "--")):
        y = needed(curve, key)
        line(axes, curve, "command", key, {"color": color, "ls": dash}, _(key))
        if std is not None:
            axes.fill_between(command, y - COVERAGE_FACTOR * std, y + COVERAGE_FACTOR * std, color=color, **BAND)
    for key, label, color, dash in (
        ("spline", marked("monotone spline"), INK, ":"),
        ("polynomial", marked("polynomial"), GREEN, "-."),
    ):
        if curve.get(key) is not None:
            line(axes, curve, "command", key, {"color": color, "ls": dash, "lw": 1.0}, _(label))
    half = curve.get("half_speed")
    if half:
        for key, name in (("rising", _("at half speed")), ("falling", "")):
            line(axes, half, "command", key, {"color": AMBER, "lw": 2.4, "alpha": 0.6, "zorder": 1.5}, name)
    band = curve.get("dead_band")
    if band is not None:
        axes.axvspan(float(band[0]), float(band[1]), color=FAINT, lw=0.0, zorder=0)
    axes.set_ylabel(_("response") + unit_of(curve, "response_unit"))
    axes.margins(x=0.0)
    legend_on_top(axes)


def _loop(axes: Axes, curve: Curve) -> None:
    command, width = needed(curve, "command"), needed(curve, "falling") - needed(curve, "rising")
    std = array(curve, "std")
    axes.axhline(0.0, **LEVEL)
    axes.plot(*thinned(command, width), **LEFT)
    if std is not None:
        expanded = COVERAGE_FACTOR * 2.0**0.5 * std
        axes.fill_between(command, width - expanded, width + expanded, color=INK, **BAND)
    axes.set_ylabel((_("falling − rising") + unit_of(curve, "response_unit")).replace(" [", "\n["))
