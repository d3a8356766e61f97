"""Step responses: samples, fitted model and the figures read from them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hil.record.measurement import COVERAGE_FACTOR
from hil.record.recording import Array
from hil.report.field import Curve, array, label_of, needed, unit_of
from hil.report.figure import BLUE, INK, SOFT, Picture, small_multiples, thinned
from hil.report.number import with_uncertainty
from hil.report.section import Section, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NEEDED = ("time_s", "measured", "start", "final")
_FEW = 4  # steps that are drawn two beside each other, more of them three
_MOST_STEPS = 12
_FIGURES = (
    ("dead_time_s", "Dead time [s]"), ("rise_s", "Rise 10…90 % [s]"), ("response_s", "To 90 % [s]"),
    ("settling_s", "Settling [s]"), ("reaches_s", "First in band [s]"), ("overshoot_percent", "Overshoot [%]"),
)  # fmt: skip


def steps_section(curves: Sequence[Curve]) -> Section:
    """Every step with its figures."""
    shown = curves[:_MOST_STEPS]
    tables = [table for table in (_figures(curves), _models(curves)) if table.rows]
    return Section("Step response", figures=(_picture(shown, len(curves) - len(shown)),), tables=tuple(tables))


def _picture(curves: Sequence[Curve], left_out: int) -> Picture:
    caption = (
        "Time counts from the step of the command, which is drawn to the scale of the response. Dotted: 10 % and "
        "90 % of the change."
    )
    if left_out:
        caption += f" {left_out} more steps are in the table only."
    labels = "time [s]", f"response{unit_of(curves[0], 'response_unit')}"
    return small_multiples("steps", curves, 2 if len(curves) <= _FEW else 3, _step, labels, caption)


def _step(axes: Axes, curve: Curve) -> None:
    time_s, start, final = needed(curve, "time_s"), float(curve["start"]), float(curve["final"])
    axes.plot(*thinned(time_s, needed(curve, "measured")), color="#8b949e", lw=1.0, label="measured")
    fitted, command = array(curve, "fitted"), array(curve, "command")
    if fitted is not None:
        axes.plot(*thinned(time_s, fitted), color=BLUE, lw=1.2, label="fitted model")
    if command is not None and (change := _step_of(time_s, command)):
        scaled = start + (command - command[0]) / change * (final - start)
        axes.plot(*thinned(time_s, scaled), color=INK, lw=0.8, ls="--", label="command")
    for share in (0.1, 0.9):
        axes.axhline(start + share * (final - start), color=SOFT, lw=0.8, ls=":")
    axes.set_title(label_of(curve), fontweight="normal", loc="right", pad=3.0)
    axes.margins(x=0.0)


def _step_of(time_s: Array, command: Array) -> float:
    """By how much the command steps at time zero; it may go back later."""
    after = min(int(np.searchsorted(time_s, 0.0, side="right")), len(command) - 1)
    return float(command[after] - command[0])


def _figures(curves: Sequence[Curve]) -> Table:
    rows = tuple(
        (label_of(c), *(_value(c["figures"].get(key)) for key, _head in _FIGURES)) for c in curves if c.get("figures")
    )
    return Table("Figures of each step with ±U (k = 2)", ("Step", *(head for _key, head in _FIGURES)), rows)


def _value(pair: Any) -> str:
    if pair is None or pair[0] is None:
        return "—"
    value, std = pair
    if std is not None and not math.isfinite(std):
        return "not determined"
    return with_uncertainty(float(value), None if std is None else COVERAGE_FACTOR * float(std))


def _models(curves: Sequence[Curve]) -> Table:
    rows = tuple((label_of(c), str(c["fitted_text"])) for c in curves if c.get("fitted_text"))
    return Table("Fitted models", ("Step", "Model"), rows, text_columns=(1,))
