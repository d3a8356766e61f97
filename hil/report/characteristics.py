"""Steady characteristics under adjusted conditions: load pressure, leakage, flow over pressure drop, nulls."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np

from hil.language.words import _
from hil.report.field import Curve, label_of, needed, unit_of
from hil.report.figure import (
    BLUE,
    COMMAND,
    FITTED,
    GREEN,
    GRID,
    INK,
    LEVEL,
    MARKERS,
    MEASURED,
    RED,
    SERIES,
    SOFT,
    drawn,
    legend_on_top,
    line,
    small_multiples,
    thinned,
    titled,
)
from hil.report.section import Section

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BRANCHES_NEEDED = ("command", "rising", "falling")
LEVELS_NEEDED = ("command", "measured")
DROPS_NEEDED = ("drop", "measured")
CONDITIONS_NEEDED = ("condition", "measured", "std", "fitted")
ANSWERS_NEEDED = ("time_s", "measured", "fitted", "before", "final")
_BAR_L_MIN_PER_KW = 600.0
_ROOM = 0.05  # beside the outer points


def pressure_gain_section(curves: Sequence[Curve]) -> Section:
    """Load pressure over command, both branches."""

    def draw(axes: Axes, curve: Curve) -> None:
        axes.axhspan(-40.0, 40.0, color=GRID, lw=0.0)
        line(axes, curve, "command", "rising", {"color": BLUE}, _("rising command"))
        line(axes, curve, "command", "falling", {"color": RED, "ls": "--"}, _("falling command"))

    x, y = (_("command"), "command_unit"), (_("load pressure [% of supply]"), "")
    caption = _("Ports A and B are blocked. Shaded: where the gain is read.")
    picture = small_multiples("pressure-gain", curves[:1], draw, x, y, caption)
    return Section(_("Pressure gain"), figures=(picture,))


def internal_leakage_section(curves: Sequence[Curve]) -> Section:
    """Flow from supply to tank over the command."""

    def draw(axes: Axes, curve: Curve) -> None:
        line(axes, curve, "command", "measured", {"color": BLUE})

    x, y = (_("command"), "command_unit"), (_("leakage"), "response_unit")
    caption = _("Flow from supply to tank with ports A and B blocked; between the branches of each sweep.")
    picture = small_multiples("internal-leakage", curves, draw, x, y, caption)
    return Section(_("Internal leakage"), figures=(picture,))


def flow_over_pressure_drop_section(curves: Sequence[Curve]) -> Section:
    """Flow over the valve pressure drop, with the power law."""

    def draw(axes: Axes, curve: Curve) -> None:
        line(axes, curve, "drop", "measured", {"color": INK, "ls": "", "marker": "o"}, _("measured"))
        if curve.get("fitted") is not None:
            line(axes, curve, "drop", "fitted", FITTED, _("power law"))
        axes.margins(x=_ROOM)

    x, y = (_("valve pressure drop"), "drop_unit"), (_("flow"), "response_unit")
    caption = _("Each point is the steady flow at one supply pressure.")
    picture = small_multiples("flow-pressure-drop", curves, draw, x, y, caption)
    return Section(_("Flow over pressure drop"), figures=(picture,))


def limiting_power_section(curves: Sequence[Curve]) -> Section:
    """Flow of every command over the valve pressure drop, before lines of equal hydraulic power."""

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        drops, flows = ([needed(curve, key) for curve in curves] for key in DROPS_NEEDED)
        end = (1.0 + _ROOM) * max(float(drop.max()) for drop in drops)
        for curve, drop, flow, color, marker in zip(curves, drops, flows, cycle(SERIES), cycle(MARKERS), strict=False):
            axes.plot(drop, flow, color=color, marker=marker, label=label_of(curve))
        low, high = min(0.0, *map(np.min, flows)), max(0.0, *map(np.max, flows))
        axes.set(xlim=(0.0, end), ylim=((1.0 + _ROOM) * low, (1.0 + _ROOM) * high))
        _equal_powers(axes, end, (1.0 + _ROOM) * low, (1.0 + _ROOM) * high)
        axes.set_xlabel(_("valve pressure drop") + unit_of(curves[0], "drop_unit"))
        axes.set_ylabel(_("flow") + unit_of(curves[0], "response_unit"))
        legend_on_top(axes)

    caption = _("Each point is the steady flow at one supply pressure. Dotted: equal hydraulic power of the valve.")
    return Section(_("Limiting power"), figures=(drawn("limiting-power", 3.9, draw, caption),))


def _equal_powers(axes: Axes, end_bar: float, low_l_min: float, high_l_min: float) -> None:
    """Hyperbolas of flow times pressure drop, in kW, with the power at their right end."""
    from matplotlib.ticker import MaxNLocator

    drop = np.linspace(0.01, 1.0, 200) * end_bar
    for size, sign in ((high_l_min, 1.0), (-low_l_min, -1.0)):
        for power_kw in MaxNLocator(4).tick_values(0.0, size * end_bar / _BAR_L_MIN_PER_KW)[1:]:
            flow = power_kw * _BAR_L_MIN_PER_KW / drop
            if flow[-1] > size:
                continue
            axes.plot(drop[flow <= size], sign * flow[flow <= size], **LEVEL)
            axes.annotate(
                f"{power_kw:g} kW", (end_bar, sign * flow[-1]), (3.0, 0.0), textcoords="offset points", color=SOFT,
                va="center", fontsize=8,
            )  # fmt: skip


def load_step_section(curves: Sequence[Curve]) -> Section:
    """What the response does after each step of the load."""

    def draw(axes: Axes, curve: Curve) -> None:
        time_ms = 1e3 * needed(curve, "time_s")
        axes.plot(*thinned(time_ms, needed(curve, "measured")), **MEASURED, label=_("measured"))
        axes.plot(*thinned(time_ms, needed(curve, "fitted")), **FITTED, label=_("smooth curve"))
        axes.axhline(float(curve["before"]), **LEVEL)
        axes.axhline(float(curve["final"]), **COMMAND)
        if curve.get("settled_s") is not None:
            axes.axvline(1e3 * float(curve["settled_s"]), color=GREEN, lw=1.0, ls="--", label=_("settling time"))

    x, y = (_("time after the step [ms]"), ""), (_("response"), "response_unit")
    caption = _("Mean of the repeats. Dotted: before the step; dashed: the final value.")
    return Section(_("Load step"), figures=(small_multiples("load-step", curves, draw, x, y, caption),))


def null_shift_section(curves: Sequence[Curve]) -> Section:
    """The null over each condition, with the line whose slope is the shift."""

    def draw(axes: Axes, curve: Curve) -> None:
        condition, null, std, fitted = (needed(curve, key) for key in CONDITIONS_NEEDED)
        axes.errorbar(condition, null, 2.0 * std, color=INK, ls="", marker="o", label=_("null ± U"))
        axes.plot(condition, fitted, **FITTED, label=_("least-squares line"))
        titled(axes, label_of(curve) + unit_of(curve, "condition_unit").replace("degC", "°C"))
        axes.margins(x=_ROOM)

    x, y = (_("condition"), ""), (_("null"), "response_unit")
    caption = _("Each null is that of a whole sweep. U is without the calibration, which moves all nulls alike.")
    return Section(_("Null shift"), figures=(small_multiples("null-shift", curves, draw, x, y, caption),))
