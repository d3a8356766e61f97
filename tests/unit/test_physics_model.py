"""Model files: what is written comes back, and every fault is one clear line."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from hil.errors import FileError, UnknownNameError
from hil.physics.model import Covariance, Model, ModelEffect, Noise, Value, load_model, save_model, typical_model

FRICTION = {
    "coulomb": Value(2.4, "%", 0.1),
    "stiction": Value(1.3, "1"),
    "stribeck": Value(10.0, "%/s"),
    "presliding": Value(0.2, "%"),
}


def valve_with_friction() -> Model:
    plain = typical_model("brevini-hpv41")
    estimated = {"pilot_rate": Value(7.0, "rad/s", 0.1), "full_flow": Value(70.0, "l/min", 0.2**0.5)}
    return Model(
        plain.plant,
        {**plain.parameters, **estimated},
        (ModelEffect("friction", "force", FRICTION),),
        plain.input,
        plain.output,
        read_at=1.0,
        noise=Noise(0.4, (-0.5,), 1e-3),
        covariance=Covariance(("pilot_rate", "full_flow"), ((0.01, 0.0), (0.0, 0.2))),
        origin={"recordings": ["a.csv"]},
    )


def test_a_model_comes_back_as_it_was_written(tmp_path):
    path = tmp_path / "valve.json"
    save_model(valve_with_friction(), path)
    assert load_model(path) == valve_with_friction()


def test_parameters_left_out_take_their_typical_value(tmp_path):
    path = changed(tmp_path, lambda content: content["parameters"].pop("sensor_lag"))
    assert load_model(path).values["sensor_lag"] == typical_model("brevini-hpv41").values["sensor_lag"]


def changed(folder: Path, change: Callable[[dict[str, Any]], Any]) -> Path:
    """A model file with one fault in it."""
    path = folder / "valve.json"
    save_model(valve_with_friction(), path)
    content = json.loads(path.read_text(encoding="utf-8"))
    change(content)
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def unknown_effect(content: dict[str, Any]) -> None:
    content["effects"][0]["name"] = "gremlins"


def misplaced_effect(content: dict[str, Any]) -> None:
    content["effects"][0]["hook"] = "sensor"


FAULTS: list[tuple[Callable[[dict[str, Any]], Any], str]] = [
    (lambda c: c.update(version=2), "model file of version 2; this program reads version 1"),
    (lambda c: c.pop("version"), "model file of version None; this program reads version 1"),
    (lambda c: c.update(format="hil-run"), "field 'format' must be 'hil-model'"),
    (lambda c: c["parameters"].update(colour={"value": 1, "unit": "1"}), "has no parameter 'colour'; known: dead_time"),
    (unknown_effect, "has no effect 'gremlins' at 'force'; effects: asymmetry"),
    (misplaced_effect, "has no effect 'friction' at 'sensor'"),
    (lambda c: c["effects"][0]["parameters"].pop("coulomb"), "found presliding, stiction, stribeck"),
    (lambda c: c["parameters"]["pilot_rate"].update(value="fast"), "field 'parameters.pilot_rate.value'"),
    (lambda c: c["parameters"]["pilot_rate"].pop("unit"), "field 'parameters.pilot_rate.unit'"),
    (lambda c: c.pop("plant"), "field 'plant'"),
    (lambda c: c["parameters"]["dead_time"].update(value=0.5), "parameters.dead_time: 0.5 s; allowed are 0 … 0.2"),
    (lambda c: c["parameters"]["pilot_rate"].update(value=-7), "pilot_rate: -7 rad/s; allowed are 0.5 … 100"),
    (lambda c: c["parameters"]["dead_time"].update(unit="ms"), "dead_time: in 'ms'; the plant takes it in 's'"),
    (
        lambda c: c["effects"][0]["parameters"]["coulomb"].update(value=-1),
        "friction.coulomb: -1 %; allowed are 0 … inf",
    ),
    (lambda c: c["effects"].append(c["effects"][0]), "effect 'friction' at 'force' is given twice"),
    (lambda c: c.update(read_at=5), "field 'read_at': Input should be less than or equal to 1, found 5"),
    (lambda c: c["noise"].update(std=-1), "field 'noise.std': Input should be greater than or equal to 0, found -1"),
    (lambda c: c["covariance"].update(matrix=[[1, 0]]), "a row and a column are needed for each of the 2 names"),
    (lambda c: c["covariance"]["matrix"][1].__setitem__(1, -1), "a variance, on the diagonal, is not below 0"),
    (lambda c: c["effects"][0]["parameters"]["coulomb"].update(unit="bar"), "effects.friction.coulomb: in 'bar'"),
]


@pytest.mark.parametrize(("change", "says"), FAULTS, ids=[says for _, says in FAULTS])
def test_a_fault_is_named(tmp_path, change, says):
    path = changed(tmp_path, change)
    with pytest.raises(FileError) as caught:
        load_model(path)
    assert says in str(caught.value)
    assert str(path) in str(caught.value)


def test_a_unit_may_be_written_otherwise_and_a_share_be_more_than_full_scale(tmp_path):
    path = changed(tmp_path, lambda c: c["parameters"]["full_flow"].update(unit="L/min"))
    assert load_model(path).values["full_flow"] == 70.0
    path = changed(tmp_path, lambda c: c["effects"][0]["parameters"]["coulomb"].update(value=120.0))
    assert load_model(path).effects[0].parameters["coulomb"].value == 120.0


def test_a_plant_that_is_not_installed(tmp_path):
    path = changed(tmp_path, lambda c: c.update(plant="brevini-hpv42"))
    with pytest.raises(UnknownNameError, match="did you mean 'brevini-hpv41'"):
        load_model(path)


@pytest.mark.parametrize("content", [b"", b"{", b"[1, 2]", b"time [s],flow [l/min]\n0,1\n", b"\xff\xfe\x00"])
def test_what_is_no_model_file(tmp_path, content):
    path = tmp_path / "valve.json"
    path.write_bytes(content)
    with pytest.raises(FileError, match="not a model file"):
        load_model(path)


def test_a_plant_where_a_model_should_be_is_called_that():
    with pytest.raises(FileError, match=r"brevini-hpv41: not a model file: .*; a plant: .*`hil list models`"):
        load_model(Path("brevini-hpv41"))


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(FileError, match="not a model file"):
        load_model(tmp_path / "nothing.json")
