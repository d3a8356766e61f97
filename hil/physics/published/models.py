"""The published valves as model files: what `hil list models` shows, made from the numbers of the papers.

    python -m hil.physics.published.models

writes `hil/physics/plants/models/*.json`, and the six frequency responses as `hil/physics/plants/tables/*.csv`; a test
holds them against what this makes.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from hil.physics.model import Model, save_model
from hil.physics.published import efc_population, gunay, tordal
from hil.record.table.response_table import ResponseTable, write_response_table

FOLDER = Path(__file__).parents[1] / "plants" / "models"
TABLES = FOLDER.with_name("tables")


def published_models() -> Mapping[str, Model]:
    """Every model by the name of its file."""
    return dict(_published())


def _published() -> Iterator[tuple[str, Model]]:
    yield (
        "hpv41-identified",
        _titled(tordal.valve(), "HPV41 identified from tables 1 and 2: sides of their own, friction"),
    )
    for run in tordal.RUNS:
        title = f"HPV41, sine of {run.amplitude:g} % about {run.bias:+g} %: table {1 if run.bias > 0.0 else 2}"
        yield _name(run), _titled(run.model, title)
    mean = tordal.MEAN_MODEL.to_model(tordal.INPUT, tordal.OUTPUT)
    yield "hpv41-mean", _titled(mean, "HPV41, G_M: one zero and three poles to the mean of the six responses")
    for name in efc_population.SETS:
        yield f"efc-{name}", _titled(efc_population.valve(name), f"Cummins EFC, {name} valve of the thesis")
    yield from _directions()


def _directions() -> Iterator[tuple[str, Model]]:
    """The cylinder by direction, about a current at which the spool is half open."""
    for name, linear, sign in (("extending", gunay.EXTENDING, "+"), ("retracting", gunay.RETRACTING, "-")):
        model = linear.to_model("current change [A]", "position [mm]")
        title = f"SP08-47C with cylinder, {name}: linearised about {sign}{gunay.LINEARISED_AT_A:g} A"
        yield f"hydraforce-{name}", _titled(model, title)


def published_tables() -> Mapping[str, ResponseTable]:
    """The frequency responses of tables 1 and 2 on the paper's 25 frequencies, by the name of their file."""
    frequency_hz = np.array(tordal.FREQUENCIES_HZ)
    return {
        _name(run): ResponseTable(_name(run), frequency_hz, run.transfer_function.at(frequency_hz), in_db=True)
        for run in tordal.RUNS
    }


def _name(run: tordal.Run) -> str:
    return f"hpv41-{'plus' if run.bias > 0.0 else 'minus'}-{run.amplitude:g}"


def _titled(model: Model, title: str) -> Model:
    return replace(model, origin={"title": title, **model.origin})


def write() -> None:
    """Write every file that differs."""
    FOLDER.mkdir(exist_ok=True)
    for name, model in published_models().items():
        path = FOLDER / f"{name}.json"
        part = path.with_suffix(".part")
        save_model(model, part)
        if path.exists() and json.loads(path.read_text("utf-8")) == json.loads(part.read_text("utf-8")):
            part.unlink()
        else:
            part.replace(path)
    TABLES.mkdir(exist_ok=True)
    for name, table in published_tables().items():
        write_response_table(table, TABLES / f"{name}.csv")


if __name__ == "__main__":
    write()
