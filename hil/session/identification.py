"""An identification from what is on disk: samples in time, tables of a frequency response, runs of our own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from html import escape
from pathlib import Path
from typing import Any

from hil.diagnosis.skeleton.table import table_of
from hil.errors import FileError, SettingError, option
from hil.identification.frequency.table_fit import AS_THEY_SHOW, Orders, fit_tables
from hil.identification.grey_box.identify import fit_plant, starting_model
from hil.identification.preparation.experiment import Experiment, experiment
from hil.identification.preparation.informative_segments import experiments_of
from hil.language.note import Note, codes_of
from hil.physics.model import Model
from hil.physics.plant import Plant
from hil.record.plain import plain
from hil.record.reading import Reading
from hil.record.recording import Recording
from hil.record.run_folder.progress import Progress, quiet
from hil.record.simulated import SIMULATED, is_simulated, marked
from hil.record.table.response_table import ResponseTable
from hil.session.known_signal import command_for
from hil.session.sources import Source, read_source

SCHEMA = "hil.identified/1"
_LINEAR = "transfer-function"
_LONG = 100_000  # samples from which on a fit takes longer than a glance


@dataclass(frozen=True, slots=True)
class Identified:
    """A model, what to print about it, and the experiments it was fitted to.

    Attributes:
        model: the plant as found.
        text: a table of its parameters, fits and notes, for a terminal.
        experiments: the recordings as the plant saw them; none from frequency responses.
        tables: the frequency responses, where it was fitted to those.
        fits: in %, by recording.
        notes: what the reader should know of the fit.
        simulated: whether a recording is of a simulated valve.
    """

    model: Model
    text: str
    experiments: tuple[Experiment, ...] = ()
    tables: tuple[ResponseTable, ...] = ()
    fits: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[Note, ...] = ()
    simulated: bool = False

    def write_page(self, path: Path) -> None:
        """A page with the model beside all that it was fitted to. Raises `StorageError`."""
        from hil.report.fit_page import write_fit_page

        captions = {name: Note("fit {fit:.2f} %", fit=fit) for name, fit in self.fits.items()}
        write_fit_page(
            self.model, (*self.experiments, *self.tables), captions, self.notes, path, simulated=self.simulated
        )

    def as_dict(self) -> dict[str, Any]:
        """As JSON values, schema `hil.identified/1`."""
        return plain(
            {
                "schema": SCHEMA,
                "model": self.model.as_dict(),
                "fits": dict(self.fits),
                "notes": list(self.notes),
                "codes": codes_of(self.notes),
                "simulated": self.simulated,
            }
        )

    def __str__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        fits = ", ".join(f"{name} {fit:.2f} %" for name, fit in self.fits.items())
        items = "".join(f"<li>{escape(note)}</li>" for note in self.notes)
        return f"{self.model._repr_html_()}<p>fit: {escape(fits)}</p><ul>{items}</ul>"


def read_for(
    plant: str,
    sources: Sequence[Source],
    reading: Reading | None,
    part: str,
    input_name: Sequence[str],
    output_name: str,
) -> list[Recording] | list[ResponseTable]:
    """What there is to identify a plant from: all samples in time, or all frequency responses.

    Of a run that measured frequency responses a transfer function is fitted to those, unless other channels are named
    than its command and its response.

    Raises:
        FileError: the one and the other together, a frequency response for a plant that is not linear, or a parameter's
            name where a recording should be.
    """
    _refuse_parameters(plant, [one for one in sources if isinstance(one, str | Path)])
    lines = plant == _LINEAR
    read = [
        read_source(one, reading, responses=lines, part=part if lines else "", inputs=input_name, output=output_name)
        for one in sources
    ]
    tables = [one for one in read if isinstance(one, ResponseTable)]
    recordings = [one for one in read if isinstance(one, Recording)]
    if tables and recordings:
        raise FileError(
            f"{tables[0].name} is a frequency response and {recordings[0].name} are samples in time; identify from "
            "either"
        )
    if tables and plant != _LINEAR:
        raise FileError(
            f"{tables[0].name}: a frequency response, from which {option('plant', f'{_LINEAR}')} is identified; "
            f"'{plant}' needs "
            "samples in time"
        )
    return tables or recordings


def _refuse_parameters(plant: str, paths: Sequence[str | Path]) -> None:
    """A parameter behind `--free` that was read as a recording: the option takes one word."""
    for path in paths:
        if not Path(path).exists() and str(path) in starting_model(plant).values:
            raise FileError(
                f"{path}: no such recording, but a parameter of '{plant}'; parameters to free are separated by commas, "
                f"{option('free')} a,{path}, or each has its own {option('free')}"
            )


def identified(
    plant: str,
    read: Sequence[Recording] | Sequence[ResponseTable],
    free: Sequence[str] = (),
    input_name: Sequence[str] = (),
    output_name: str = "",
    orders: Orders = AS_THEY_SHOW,
    notes: Callable[[str], None] = lambda _note: None,
    progress: Progress = quiet,
) -> Identified:
    """Fit a plant, or the model of a file, to everything that was read; `notes` is called with what was assumed.

    `progress` is called with how far it is where that takes long.

    Raises:
        FileError, UnknownNameError, SettingError: what cannot be fitted, and why.
    """
    tables = [one for one in read if isinstance(one, ResponseTable)]
    simulated = any(is_simulated(one.meta) for one in read)
    if tables:
        fitted = fit_tables(tables, input_name[0] if input_name else "", output_name, orders)
        name = " + ".join(table.name for table in tables)
        fits = {name: fitted.fit.fit_percent}
        model, text = _with_origin(fitted.model, fitted.summary(), simulated=simulated)
        return Identified(model, text, (), tuple(tables), fits, fitted.notes, simulated)
    start = starting_model(plant, free)
    if orders.weights is not None:
        raise SettingError(f"{option('weights')} is for the lines of a frequency response; these are samples in time")
    if not orders.are_open and plant != _LINEAR:
        raise SettingError(
            f"poles, zeros and dead time are asked of {option('plant', _LINEAR)}; {plant} has its form already"
        )
    recordings = [one for one in read if isinstance(one, Recording)]
    plant_of = start.definition
    experiments, assumed = experiments_of(
        start, recordings, lambda one: _channels(one, plant_of, input_name, output_name)[0][0],
        lambda one: bound(one, plant_of, input_name, output_name),
    )  # fmt: skip
    given = _channels(recordings[0], plant_of, input_name, output_name)[0][0]
    for note in (*assumed, *(note for one in experiments for note in one.notes)):
        notes(note)
    if plant == _LINEAR and (better := command_for(recordings[0], given)):
        notes(better.of(recordings[0].name))
    is_long = sum(len(one.output) for one in experiments) >= _LONG
    found = fit_plant(start, experiments, free, progress if is_long else quiet, orders)
    paths = {one.name: str(Path(one.name).resolve()) for one in recordings if Path(one.name).exists()}
    model = replace(found.model, origin={**found.model.origin, "paths": paths})
    table = table_of(model, [e for e in experiments if not e.stands_still])
    model = replace(model, skeleton=None if table is None else table.as_dict())
    model, text = _with_origin(model, found.summary(), simulated=simulated)
    return Identified(model, text, tuple(experiments), (), dict(found.fits), found.notes, simulated)


def _with_origin(model: Model, text: str, *, simulated: bool) -> tuple[Model, str]:
    """The model and what is printed of it, which both say where a simulated valve was recorded."""
    if not simulated:
        return model, text
    head, line, rest = text.partition("\n")
    return replace(model, origin={**model.origin, SIMULATED: True}), f"{marked(head, simulated=True)}{line}{rest}"


def bound(recording: Recording, plant: Plant, input_name: Sequence[str] = (), output_name: str = "") -> Experiment:
    """A recording bound to a plant: by the names given, else by the plant's, else by the roles that a run declares.

    A plant that takes any channel takes the only two there are, the input first.
    """
    given, answer = _channels(recording, plant, input_name, output_name)
    return experiment(recording, plant, given, answer or None)


def _channels(recording: Recording, plant: Plant, input_name: Sequence[str], output_name: str) -> tuple[list[str], str]:
    roles, both = recording.meta.get("roles", {}), list(recording.channels)
    given, answer = list(input_name), output_name
    are_all = plant.output.unit == "any" and len(both) == 2
    if not given and plant.inputs[0].name not in both and (are_all or "command" in roles):
        given = [str(roles.get("command") or next(name for name in both if name != answer))]
    if not answer and plant.output.name not in both and (are_all or "response" in roles):
        answer = str(roles.get("response") or next((name for name in both if name not in given), ""))
    return given or [plant.inputs[0].name], answer
