"""The reference of the bench file says everything that a bench file may say, and its example works."""

import re
from pathlib import Path

import pytest
from pydantic import BaseModel

from hil.bench import file as bench_file
from hil.bench.read import read_bench
from sim_devices import _simulation
from sim_devices._settings import Fault, Settings

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "reference" / "bench-file.md").read_text(encoding="utf-8")
MODELS = [
    model
    for module in (bench_file, _simulation)
    for model in vars(module).values()
    if isinstance(model, type) and issubclass(model, BaseModel) and model.model_fields
] + [Settings, Fault]


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.__name__)
def test_every_key_is_in_the_reference(model):
    told_elsewhere = {"direction"}  # filled in by the bench, not written by anybody
    words = set(re.findall(r"\w+", PAGE))
    assert set(model.model_fields) - told_elsewhere <= words


def test_the_examples_are_benches_without_faults(tmp_path):
    examples = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    assert len(examples) == 2
    for example in examples:
        path = tmp_path / "bench.toml"
        path.write_text(example, encoding="utf-8")
        assert read_bench(path).bench.name.startswith("Bench 3")


def test_every_promise_is_in_the_reference():
    from dataclasses import fields

    from hil.daq.contract import Promises

    page = (DOCS / "reference" / "daq.md").read_text(encoding="utf-8")
    assert all(f"`{field.name}`" in page for field in fields(Promises))
