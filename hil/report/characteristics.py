"""Steady characteristics under adjusted conditions: load pressure, leakage, flow over pressure drop, nulls."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np

from hil.language.words import _
from hil.report.field import Curve, array, label_of, needed, unit_of
from hil.report.figure import (
    BLUE,
    GREEN,
    GRID,
    MARKERS,
    RED,
    SERIES,
    SKY,
    SOFT,
    drawn,
    legend_on_top,
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
_MOST = 6
_BAR_L_MIN_PER_KW = 600.0
_ROOM = 0.05  # beside the outer points


def pressure_gain_section(curves: Sequence[Curve]) -> Section:
    """Load pressure over command, both branches."""

    def draw(axes: Axes, curve: Curve) -> None:
        axes.axhspan(-40.0, 40.0, color=GRID, lw=0.0)
        axes.plot(needed(curve, "command"), needed(curve, "rising"), color=BLUE, lw=1.2, label=_("rising command"))
        axes.plot(
            needed(curve, "command"), needed(curve, "falling"), color=RED, lw=1.2, ls="--", label=_("falling command")
        )

    labels = _("command") + unit_of(curves[0], "command_unit"), _("load pressure [% of supply]")
    caption = _("Ports A and B are blocked. Shaded: where the gain is read.")
    return Section(
        _("Pressure gain"), figures=(small_multiples("pressure-gain", curves[:1], 1, draw, labels, caption),)
    )


def internal_leakage_section(curves: Sequence[Curve]) -> Section:
    """Flow from supply to tank over the command."""

    def draw(axes: Axes, curve: Curve) -> None:
        axes.plot(needed(curve, "command"), needed(curve, "measured"), color=BLUE, lw=1.2)
        titled(axes, label_of(curve))

    units = [unit_of(curves[0], key) for key in ("command_unit", "response_unit")]
    labels = _("command") + units[0], _("leakage") + units[1]
    caption = _("Flow from supply to tank with ports A and B blocked; between the branches of each sweep.")
    picture = small_multiples("internal-leakage", curves[:_MOST], 2, draw, labels, caption)
    return Section(_("Internal leakage"), figures=(picture,))


def flow_over_pressure_drop_section(curves: Sequence[Curve]) -> Section:
    """Flow over the valve pressure drop, with the power law."""

    def draw(axes: Axes, curve: Curve) -> None:
        drop, fitted = needed(curve, "drop"), array(curve, "fitted")
        axes.plot(drop, needed(curve, "measured"), color=BLUE, ls="", marker="o", label=_("measured"))
        if fitted is not None:
            axes.plot(drop, fitted, color=RED, lw=1.0, label=_("power law"))
        titled(axes, label_of(curve))
        axes.margins(x=_ROOM)

    units = [unit_of(curves[0], key) for key in ("drop_unit", "response_unit")]
    labels = _("valve pressure drop") + units[0], _("flow") + units[1]
    caption = _("Each point is the steady flow at one supply pressure.")
    picture = small_multiples("flow-pressure-drop", curves[:_MOST], 2, draw, labels, caption)
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
            axes.plot(drop[flow <= size], sign * flow[flow <= size], color=SOFT, lw=0.8, ls=":")
            axes.annotate(
                f"{power_kw:g} kW", (end_bar, sign * flow[-1]), (3.0, 0.0), textcoords="offset points", color=SOFT,
                va="center", fontsize=8,
            )  # fmt: skip


def load_step_section(curves: Sequence[Curve]) -> Section:
    """What the response does after each step of the load."""

    def draw(axes: Axes, curve: Curve) -> None:
        time_ms = 1e3 * needed(curve, "time_s")
        axes.plot(*thinned(time_ms, needed(curve, "measured")), color=SKY, lw=2.6, label=_("measured"))
        axes.plot(*thinned(time_ms, needed(curve, "fitted")), color=RED, lw=1.0, label=_("smooth curve"))
        for place, dash in ((float(curve["before"]), ":"), (float(curve["final"]), "--")):
            axes.axhline(place, color=SOFT, lw=0.8, ls=dash)
        if curve.get("settled_s") is not None:
            axes.axvline(1e3 * float(curve["settled_s"]), color=GREEN, lw=1.0, ls="--", label=_("settling time"))
        titled(axes, label_of(curve))

    labels = _("time after the step [ms]"), _("response") + unit_of(curves[0], "response_unit")
    caption = _("Mean of the repeats. Dotted: before the step; dashed: the final value.")
    return Section(_("Load step"), figures=(small_multiples("load-step", curves[:_MOST], 2, draw, labels, caption),))


def null_shift_section(curves: Sequence[Curve]) -> Section:
    """The null over each condition, with the line whose slope is the shift."""

    def draw(axes: Axes, curve: Curve) -> None:
        condition, null, std, fitted = (needed(curve, key) for key in CONDITIONS_NEEDED)
        axes.errorbar(condition, null, 2.0 * std, color=BLUE, ls="", marker="o", capsize=2.0, label=_("null ± U"))
        axes.plot(condition, fitted, color=RED, lw=1.0, label=_("least-squares line"))
        titled(axes, label_of(curve) + unit_of(curve, "condition_unit").replace("degC", "°C"))
        axes.margins(x=_ROOM)

    labels = _("condition"), _("null") + unit_of(curves[0], "response_unit")
    caption = _("Each null is that of a whole sweep. U is without the calibration, which moves all nulls alike.")
    return Section(_("Null shift"), figures=(small_multiples("null-shift", curves[:_MOST], 3, draw, labels, caption),))
