"""The page of a model beside what it was held against: samples in time, tables of a frequency response."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hil.identification.grey_box.free import named_values
from hil.identification.preparation.experiment import Experiment
from hil.identification.preparation.start_in_motion import begun_in_motion
from hil.language.words import _
from hil.physics.formula import formula
from hil.physics.model import Model, Value
from hil.physics.plants.transfer_function import PLANT as LINEAR
from hil.physics.transfer_function import from_parameters
from hil.record.table.response_table import ResponseTable
from hil.report.figure import COMMAND, FITTED, LEFT, MEASURED, POINTS, Picture, drawn, legend_on_top, thinned
from hil.report.name import short_name
from hil.report.number import note_text, number, with_std
from hil.report.page import page, write_page
from hil.report.responses import bode
from hil.report.section import Section, Table
from hil.signals.decibel import PER_NEPER, decibels

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@page
def write_fit_page(
    model: Model,
    measured: Sequence[Experiment | ResponseTable],
    summaries: Mapping[str, str],
    notes: Sequence[str],
    path: Path,
    *,
    simulated: bool,
) -> None:
    """Write the page.

    Args:
        model: what is held against the measurements.
        measured: bound recordings, and tables for a model that is a transfer function.
        summaries: how well it fits, in words, by the name of each measurement.
        notes: what the reader should know besides.
        path: of the page.
        simulated: whether any of the measurements is of a simulated valve.

    Raises:
        StorageError: it cannot be written.
    """
    sections = [_model_section(model)]
    for k, one in enumerate(measured):
        picture = _table(model, one, k) if isinstance(one, ResponseTable) else _samples(model, one, k)
        sections.append(
            Section(
                short_name(one.name),
                texts=tuple(map(note_text, filter(None, (summaries.get(one.name),)))),
                figures=(picture,),
            )
        )
    if notes:
        sections.append(Section(_("Notes"), texts=tuple(map(note_text, notes))))
    title = _(model.definition.title)
    write_page("fit.html", path, kicker=_("Model and measurement"), title=title, sections=sections, simulated=simulated)


def _model_section(model: Model) -> Section:
    rows = [(name, _value_text(found), found.unit) for name, found in named_values(model).items()]
    heads = (_("Parameter"), _("Value ± U"), _("Unit"))
    texts = (formula(from_parameters(model.values)),) if _is_linear(model) else ()
    return Section(_("Model"), texts=texts, tables=(Table("", heads, tuple(rows), text_columns=(2,)),))


def _value_text(found: Value) -> str:
    if found.std is None:
        return _("{value} (held)").format(value=number(found.value))
    if not np.isfinite(found.std):
        return _("{value} (not identifiable)").format(value=number(found.value))
    return with_std(found.value, found.std)


def _is_linear(model: Model) -> bool:
    return model.plant == LINEAR.name and not model.effects and not model.values.get("bend")


def _table(model: Model, table: ResponseTable, k: int) -> Picture:
    curve: dict[str, Any] = {
        "label": short_name(table.name), "frequency_hz": table.frequency_hz, **_in_db_and_deg(table.response),
        "model": _modelled(model, table) if _is_linear(model) else None,
    }  # fmt: skip
    if table.gain_std is not None and table.phase_std_rad is not None:
        curve["magnitude_std_db"] = PER_NEPER * table.gain_std
        curve["phase_std_deg"] = np.degrees(table.phase_std_rad)
    caption = _("Points: the table, bars: ±U (k = 2) where it states one. Line: the model. 0 dB is a gain of {one}.")
    one = "1" if table.unit == "1" else f"1 {table.unit}"
    return bode(f"table-{k}", [[curve]], caption.format(one=one), ())


def _modelled(model: Model, table: ResponseTable) -> dict[str, Any]:
    f = np.geomspace(table.frequency_hz[0], table.frequency_hz[-1], POINTS)
    found = _in_db_and_deg(from_parameters(model.values).at(f))
    first = float(np.degrees(np.unwrap(np.angle(table.response)))[0])
    turns = np.round((first - float(found["phase_deg"][0])) / 360.0)
    return {"frequency_hz": f, **found, "phase_deg": found["phase_deg"] + 360.0 * turns}


def _in_db_and_deg(response: np.ndarray[Any, Any]) -> dict[str, Any]:
    return {
        "magnitude_db": decibels(response),
        "phase_deg": np.degrees(np.unwrap(np.angle(response))),
    }


def _samples(model: Model, e: Experiment, k: int) -> Picture:
    e, _stated = begun_in_motion(model, e)
    simulated = e.simulated(model)[0]
    shown = np.where(e.valid, e.output, np.nan)

    def draw(figure: Figure) -> None:
        command, above, below = figure.subplots(3, 1, sharex=True, height_ratios=(1.0, 2.0, 1.0))
        command.plot(*thinned(e.time_s, e.on_grid_input()), **COMMAND)
        command.set_ylabel(e.input)
        above.plot(*thinned(e.time_s, e.output), **MEASURED, label=_("measured"))
        above.plot(*thinned(e.time_s, simulated), **FITTED, label=_("model"))
        above.set_ylabel(e.output_heading)
        below.plot(*thinned(e.time_s[e.valid], (shown - simulated)[e.valid]), **LEFT)
        below.set_ylabel(_("measured − model"))
        below.set_xlabel(_("time [s]"))
        for axes in (command, above, below):
            axes.margins(x=0.0)
        legend_on_top(above)

    return drawn(f"samples-{k}", 5.2, draw, _("Command, response and model, and what the model leaves."))
