"""What `hil results` writes of a run, held against the schema that documents it."""

from __future__ import annotations

import csv
import json
import math
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

import fastjsonschema
import pytest
from openpyxl import load_workbook

from hil.cli import app
from hil.findings.results import Results, schema
from hil.session.outcome import Outcome


@cache
def validate() -> Any:
    """The schema as a function: one that interprets it takes a second for a long curve, this one 20 ms."""
    return fastjsonschema.compile({key: value for key, value in schema().items() if key != "$id"}, use_formats=False)


def check_handed_on(found: Outcome, out: Path) -> None:
    """Every file of `hil results`, each beside what the run found."""
    files = {ending: out / f"out.{ending}" for ending in ("json", "csv", "xlsx")}
    options = [text for ending, path in files.items() for text in (f"--{ending}", str(path))]
    with patch("sys.argv", ["hil", "results", str(found.folder), *options]):
        assert app.main() == 0
    document = json.loads(files["json"].read_text("utf-8"), parse_constant=lambda name: pytest.fail(f"{name}: no JSON"))
    validate()(document)
    assert document["schema"] == schema()["$id"]
    assert [value["name"] for value in document["values"]] == [m.name for m in found.findings.measured]
    for value in document["values"]:
        assert value["unit"], value["name"]
        assert value["value"] is None or math.isfinite(value["value"])
    results = Results.model_validate(document)
    rows = list(csv.DictReader(files["csv"].read_text("utf-8").splitlines()))
    assert [row["name"] for row in rows] == [value.name for value in results.values]
    curves = list(out.glob("out_*.csv"))
    assert len(curves) == len(results.curves)
    sheets = load_workbook(files["xlsx"], read_only=True).sheetnames
    assert len(sheets) == 1 + len(curves) + bool(results.transfer_functions)
