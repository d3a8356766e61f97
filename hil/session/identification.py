"""An identification from what is on disk: samples in time, tables of a frequency response, runs of our own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hil.errors import FileError, SettingError
from hil.identification.experiment import Experiment, experiment
from hil.identification.grey_box import fit_plant, starting_model
from hil.identification.table_fit import AS_THEY_SHOW, Orders, fit_tables
from hil.physics.model import Model
from hil.physics.plant import Plant
from hil.record.read import read_any
from hil.record.reading import Reading
from hil.record.recording import Recording
from hil.record.response_table import ResponseTable
from hil.session.responses import holds_responses, response_of_run

_LINEAR = "transfer-function"


@dataclass(frozen=True, slots=True)
class Identified:
    """A model, what to print about it, and the experiments it was fitted to."""

    model: Model
    text: str
    experiments: tuple[Experiment, ...] = ()


def read_for(
    plant: str, paths: Sequence[Path], reading: Reading, part: str = ""
) -> list[Recording] | list[ResponseTable]:
    """What there is to identify a plant from: all samples in time, or all frequency responses.

    Of a run that measured frequency responses a transfer function is fitted to those.

    Raises:
        FileError: the one and the other together, or a frequency response for a plant that is not linear.
    """
    read = [
        response_of_run(path, part) if plant == _LINEAR and holds_responses(path) else read_any(path, reading)
        for path in paths
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
            f"{tables[0].name}: a frequency response, from which --plant {_LINEAR} is identified; '{plant}' needs "
            "samples in time"
        )
    return tables or recordings


def identified(
    plant: str,
    read: Sequence[Recording] | Sequence[ResponseTable],
    free: Sequence[str] = (),
    input_name: Sequence[str] = (),
    output_name: str = "",
    orders: Orders = AS_THEY_SHOW,
) -> Identified:
    """Fit a plant, or the model of a file, to everything that was read.

    Raises:
        FileError, UnknownNameError, SettingError: what cannot be fitted, and why.
    """
    tables = [one for one in read if isinstance(one, ResponseTable)]
    if tables:
        fitted = fit_tables(tables, input_name[0] if input_name else "", output_name, orders)
        return Identified(fitted.model, fitted.summary())
    if not orders.are_open:
        raise SettingError(
            "poles, zeros and dead time are asked for where a frequency response is fitted; from samples in time they "
            "are chosen by evidence"
        )
    start = starting_model(plant, free)
    recordings = [one for one in read if isinstance(one, Recording)]
    experiments = [bound(one, start.definition, input_name, output_name) for one in recordings]
    found = fit_plant(start, experiments, free)
    return Identified(found.model, found.summary(), tuple(experiments))


def bound(recording: Recording, plant: Plant, input_name: Sequence[str] = (), output_name: str = "") -> Experiment:
    """A recording bound to a plant: by the names given, else by the plant's, else by the roles that a run declares."""
    roles = recording.meta.get("roles", {})
    given, answer = list(input_name), output_name
    if not given and plant.inputs[0].name not in recording.channels and "command" in roles:
        given = [str(roles["command"])]
    if not answer and plant.output.name not in recording.channels and "response" in roles:
        answer = str(roles["response"])
    return experiment(recording, plant, given, answer or None)
