"""Motions: positions over time with the lines that were fitted to them; how a response sets out after a stop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from hil.language.words import _
from hil.report.field import Curve, label_of, needed, unit_of
from hil.report.figure import BLUE, FITTED, GRID, MEASURED, Picture, line, small_multiples, titled
from hil.report.number import number
from hil.report.section import Section, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STEPS_NEEDED = ("time_s", "measured", "fitted", "from_s", "to_s", "speed_per_s")
THRESHOLD_NEEDED = ("command", "measured")
TREND_NEEDED = ("cycle", "measured", "std")
DRIFT_NEEDED = ("time_s", "position", "fitted")


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
        line(axes, curve, "command", "measured", {"color": BLUE})

    caption = _("Change of the response since a stop, mean of both directions and all repeats; its delay is taken out.")
    x, y = (_("change of command"), "command_unit"), (_("change of response"), "response_unit")
    return Section(_("Threshold"), figures=(small_multiples("threshold", curves, draw, x, y, caption),))


def trend_section(curves: Sequence[Curve]) -> Section:
    """Each figure over the cycles."""

    def draw(axes: Axes, curve: Curve) -> None:
        cycle, mean, std = (needed(curve, key) for key in TREND_NEEDED)
        axes.fill_between(cycle, mean - std, mean + std, color=GRID, lw=0.0)
        axes.plot(cycle, mean, **FITTED)
        titled(axes, label_of(curve) + unit_of(curve, "response_unit"))

    caption = _("Means of blocks of cycles; shaded, one standard deviation of the single cycles.")
    picture = small_multiples("trend", curves, draw, (_("cycle"), ""), ("", ""), caption)
    return Section(_("Trend"), figures=(picture,))


def _picture(name: str, curves: Sequence[Curve], position: str, caption: str) -> Picture:
    def draw(axes: Axes, curve: Curve) -> None:
        line(axes, curve, "time_s", position, MEASURED, _("measured"))
        if "from_s" in curve:
            axes.axvspan(float(curve["from_s"]), float(curve["to_s"]), color=GRID, lw=0.0)
            axes.set_ylim(axes.get_ylim())  # beyond the motion the fitted line leaves the cylinder
        line(axes, curve, "time_s", "fitted", {**FITTED, "ls": "--"}, _("fitted line"))

    x, y = (_("time [s]"), ""), (_("position"), "response_unit")
    return small_multiples(name, curves, draw, x, y, caption)
