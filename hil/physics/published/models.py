"""The published valves as model files: what `hil list models` shows, made from the numbers of the papers.

    python -m hil.physics.published.models

writes `hil/physics/plants/models/*.json`; a test holds them against what this makes.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from hil.physics.model import Model, save_model
from hil.physics.published import efc_population, tordal

FOLDER = Path(__file__).parents[1] / "plants" / "models"


def published_models() -> Mapping[str, Model]:
    """Every model by the name of its file."""
    return dict(_published())


def _published() -> Iterator[tuple[str, Model]]:
    yield (
        "hpv41-identified",
        _titled(tordal.valve(), "HPV41 identified from tables 1 and 2: sides of their own, friction"),
    )
    for run in tordal.RUNS:
        side = "plus" if run.bias > 0.0 else "minus"
        title = f"HPV41, sine of {run.amplitude:g} % about {run.bias:+g} %: table {1 if run.bias > 0.0 else 2}"
        yield f"hpv41-{side}-{run.amplitude:g}", _titled(run.model, title)
    mean = tordal.MEAN_MODEL.to_model(tordal.INPUT, tordal.OUTPUT)
    yield "hpv41-mean", _titled(mean, "HPV41, G_M: one zero and three poles to the mean of the six responses")
    for name in efc_population.SETS:
        yield f"efc-{name}", _titled(efc_population.valve(name), f"Cummins EFC, {name} valve of the thesis")


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


if __name__ == "__main__":
    write()
