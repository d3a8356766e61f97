"""What headers and events make of Python's values."""

from __future__ import annotations

import json
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import Enum
from pathlib import Path

import numpy as np
import pytest

from hil.record.plain import plain, to_json


class Level(Enum):
    LOW = "low"


@dataclass(frozen=True)
class Setting:
    name: str
    values: tuple[float, ...]


def test_everything_a_bench_says_becomes_json():
    value = {
        "float": np.float64(1.5), "int": np.int32(3), "bool": np.True_, "array": np.array([[1.0, np.inf]]),
        "complex": 1 + 2j, "numpy complex": np.complex128(3j), "enum": Level.LOW, "dataclass": Setting("a", (1.0, 2.0)),
        "path": Path("a") / "b", "date": datetime(2026, 1, 31, tzinfo=UTC), "nan": float("nan"), 5: None,
    }  # fmt: skip
    assert json.loads(to_json(value)) == {
        "float": 1.5, "int": 3, "bool": True, "array": [[1.0, None]], "complex": [1.0, 2.0],
        "numpy complex": [0.0, 3.0], "enum": "low", "dataclass": {"name": "a", "values": [1.0, 2.0]},
        "path": str(Path("a") / "b"), "date": "2026-01-31T00:00:00+00:00", "nan": None, "5": None,
    }  # fmt: skip


def test_what_has_no_form_is_named():
    with pytest.raises(TypeError, match=r"object .* cannot be written as JSON"):
        plain({"x": object()})
