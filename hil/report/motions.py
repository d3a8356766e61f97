"""Motions: positions over time with the lines that were fitted to them; how a response sets out after a stop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hil.language.words import _
from hil.record.recording import Array
from hil.report.field import Curve, label_of, needed, unit_of
from hil.report.figure import BLUE, GRID, Picture, small_multiples, thinned, titled
from hil.report.number import number
from hil.report.section import Section, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STEPS_NEEDED = ("time_s", "measured", "fitted", "from_s", "to_s", "speed_per_s")
THRESHOLD_NEEDED = ("command", "measured")
TREND_NEEDED = ("cycle", "measured", "std")
DRIFT_NEEDED = ("time_s", "position", "fitted")
_MOST = 12
_MOST_DOTS = 50
_COLUMNS = 3
_ROOM = 0.08  # of what is shown, above and below it


def velocity_steps_section(curves: Sequence[Curve]) -> Section:
    """Every step, where its speed is read, and the speed."""
    caption = _("The speed is the slope of the fitted line over the shaded stretch.")
    unit = unit_of(curves[0], "response_unit").replace("]", "/s]")
    rows = tuple(
        (label_of(c), number(float(c["speed_per_s"]), 5), f"{number(float(c['from_s']))} … {number(float(c['to_s']))}")
        for c in curves
    )
    table = Table("", (_("Step"), _("Speed") + unit, _("Read from … to [s]")), rows)
    return Section(
        _("Velocity steps"), figures=(_picture("velocity-steps", curves, "measured", caption),), tables=(table,)
    )


def drift_section(curves: Sequence[Curve]) -> Section:
    """The position at every level at which the command stands."""
    caption = _("Means over one second, and the straight line whose slope is the rate of the drift.")
    return Section(_("Drift"), figures=(_picture("drift", curves, "position", caption),))


def threshold_section(curves: Sequence[Curve]) -> Section:
    """How the response sets out after each kind of stop."""

    def draw(axes: Axes, curve: Curve) -> None:
        axes.plot(*thinned(needed(curve, "command"), needed(curve, "measured")), color=BLUE, lw=1.0)
        titled(axes, label_of(curve))

    caption = _("Change of the response since a stop, mean of both directions and all repeats; its delay is taken out.")
    units = [unit_of(curves[0], key) for key in ("command_unit", "response_unit")]
    labels = _("change of command") + units[0], _("change of response") + units[1]
    return Section(_("Threshold"), figures=(small_multiples("threshold", curves[:_MOST], 2, draw, labels, caption),))


def trend_section(curves: Sequence[Curve]) -> Section:
    """Each figure over the cycles."""

    def draw(axes: Axes, curve: Curve) -> None:
        cycle, mean, std = (needed(curve, key) for key in TREND_NEEDED)
        axes.fill_between(cycle, mean - std, mean + std, color=GRID, lw=0.0)
        axes.plot(cycle, mean, color=BLUE, lw=1.0, marker="o" if len(cycle) <= _MOST_DOTS else "")
        titled(axes, label_of(curve) + unit_of(curve, "response_unit"))

    caption = _("Means of blocks of cycles; shaded, one standard deviation of the single cycles.")
    return Section(_("Trend"), figures=(small_multiples("trend", curves[:_MOST], 2, draw, (_("cycle"), ""), caption),))


def _picture(name: str, curves: Sequence[Curve], position: str, caption: str) -> Picture:
    shown, left_out = curves[:_MOST], max(0, len(curves) - _MOST)
    labels = _("time [s]"), _("position") + unit_of(shown[0], "response_unit")
    more = " " + _("{n} more are not drawn.").format(n=left_out) if left_out else ""
    return small_multiples(
        name, shown, _COLUMNS, lambda axes, curve: _motion(axes, curve, position), labels, caption + more
    )


def _span(time_s: Array, measured: Array, fitted: Array, from_s: float, to_s: float) -> tuple[float, float]:
    """What the axis shows: the motion, and the line where it was fitted; beyond that it leaves the cylinder."""
    read = fitted[(time_s >= from_s) & (time_s <= to_s)]
    shown = np.concatenate((measured, read))
    low, high = float(np.nanmin(shown)), float(np.nanmax(shown))
    room = _ROOM * (high - low) or 1.0
    return low - room, high + room


def _motion(axes: Axes, curve: Curve, position: str) -> None:
    time_s = needed(curve, "time_s")
    if "from_s" in curve:
        axes.axvspan(float(curve["from_s"]), float(curve["to_s"]), color=GRID, lw=0.0)
    measured, fitted = needed(curve, position), needed(curve, "fitted")
    axes.plot(*thinned(time_s, measured), color="#8b949e", lw=1.8, label=_("measured"))
    axes.plot(*thinned(time_s, fitted), color=BLUE, lw=1.0, ls="--", label=_("fitted line"))
    if "from_s" in curve:
        axes.set_ylim(*_span(time_s, measured, fitted, float(curve["from_s"]), float(curve["to_s"])))
    titled(axes, label_of(curve))
