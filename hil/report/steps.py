"""Step responses: samples, fitted model and the figures read from them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hil.language.words import _
from hil.physics.formula import formula
from hil.physics.transfer_function import TransferFunction, transfer_function
from hil.record.recording import Array
from hil.report.field import Curve, array, label_of, needed
from hil.report.figure import (
    COMMAND,
    DASHES,
    FITTED,
    INK,
    LEVEL,
    MEASURED,
    MOST_DRAWN,
    POINTS,
    SERIES,
    Picture,
    drawn,
    legend_above,
    line,
    plain_log,
    small_multiples,
    thinned,
)
from hil.report.number import note_text, number
from hil.report.section import Section, Table
from hil.signals.decibel import decibels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NEEDED = ("time_s", "measured", "start", "final")
_ERRORS = ("fit_percent", "gain_error_db", "phase_error_deg")


def steps_section(curves: Sequence[Curve]) -> Section:
    """Every step, and the models of each; its figures stand among the results."""
    shown = curves[:MOST_DRAWN]
    tables = [table for table in (_models(curves), _from_times(curves)) if table.rows]
    beside = [_bode(f"step-models-{k}", c) for k, c in enumerate(shown) if c.get("response") and c.get("models")]
    caption = _(
        "Time counts from the step of the command, which is drawn to the scale of the response. Dotted: 10 % and "
        "90 % of the change."
    )
    x, y = (_("time [s]"), ""), (_("response"), "response_unit")
    picture = small_multiples("steps", curves, _step, x, y, caption)
    return Section(_("Step response"), figures=(picture, *beside), tables=tuple(tables))


def _step(axes: Axes, curve: Curve) -> None:
    time_s, start, final = needed(curve, "time_s"), float(curve["start"]), float(curve["final"])
    line(axes, curve, "time_s", "measured", MEASURED, _("measured"))
    command = array(curve, "command")
    if curve.get("fitted") is not None:
        line(axes, curve, "time_s", "fitted", FITTED, _("fitted model"))
    if command is not None and (change := _step_of(time_s, command)):
        scaled = start + (command - command[0]) / change * (final - start)
        axes.plot(*thinned(time_s, scaled), **COMMAND, label=_("command"))
    for share in (0.1, 0.9):
        axes.axhline(start + share * (final - start), **LEVEL)


def _step_of(time_s: Array, command: Array) -> float:
    """By how much the command steps at time zero; it may go back later."""
    after = min(int(np.searchsorted(time_s, 0.0, side="right")), len(command) - 1)
    return float(command[after] - command[0])


def _models(curves: Sequence[Curve]) -> Table:
    rows = tuple((label_of(c), note_text(c["fitted_text"])) for c in curves if c.get("fitted_text"))
    return Table(_("Fitted models"), (_("Step"), _("Model")), rows, text_columns=(1,))


def _from_times(curves: Sequence[Curve]) -> Table:
    """Those of the HPV41 paper, eqs 11 to 22."""
    heads = (_("Step"), _("Model"), _("Transfer function"), _("Fit [%]"), _("Gain, rms [dB]"), _("Phase, rms [°]"))
    rows = tuple(
        (label_of(c), note_text(one["label"]), formula(_function(one)), *(_error(one, key) for key in _ERRORS))
        for c in curves
        for one in c.get("models") or ()
    )
    caption = _("Models from rise and settling time, and their errors beside the frequency response where there is one")
    return Table(caption, heads, rows, text_columns=(1, 2))


def _error(model: Curve, key: str) -> str:
    return "—" if model.get(key) is None else number(model[key], 3)


def _function(model: Curve) -> TransferFunction:
    return transfer_function(model["numerator"], model["denominator"])


def _bode(name: str, curve: Curve) -> Picture:
    """The measured response and every model, as figure 16 of the HPV41 paper."""
    measured = curve["response"]
    frequency_hz = needed(measured, "frequency_hz")
    fine = np.geomspace(frequency_hz[0], frequency_hz[-1], POINTS)

    def draw(figure: Figure) -> None:
        above, below = figure.subplots(2, 1, sharex=True)
        for axes, key in ((above, "magnitude_db"), (below, "phase_deg")):
            axes.plot(frequency_hz, needed(measured, key), ls="", marker="o", color=INK, label=_("measured"))
        for k, one in enumerate(curve["models"]):
            response = _function(one).at(fine)
            style = {"color": SERIES[k % len(SERIES)], "ls": DASHES[k % len(DASHES)], "label": note_text(one["label"])}
            above.plot(fine, decibels(response), **style)
            below.plot(fine, np.degrees(np.unwrap(np.angle(response))), **style)
        above.set_xscale("log")
        plain_log(below.xaxis)
        above.set_ylabel(_("amplitude ratio [dB]"))
        below.set_ylabel(_("phase [°]"))
        below.set_xlabel(_("frequency [Hz]"))
        legend_above(above)

    return drawn(
        name, 4.4, draw, label_of(curve) + ": " + _("models of the step beside the measured frequency response.")
    )
