"""Entries of a curve's mapping, as docs/reference/procedures.md names them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hil.record.recording import Array
from hil.report.number import label_text

Curve = Mapping[str, Any]


def array(curve: Curve, key: str) -> Array | None:
    """An array of the curve; None where it has none."""
    value = curve.get(key)
    return None if value is None else np.asarray(value, dtype=np.float64)


def needed(curve: Curve, key: str) -> Array:
    """An array that every curve of this kind has."""
    return np.asarray(curve[key], dtype=np.float64)


def label_of(curve: Curve) -> str:
    """How one of several is called."""
    return label_text(str(curve.get("label", ""))).replace(" ", "\N{NO-BREAK SPACE}")


def unit_of(curve: Curve, key: str) -> str:
    """`[l/min]`, or nothing for a pure number."""
    unit = str(curve.get(key) or "1")
    return "" if unit == "1" else f" [{unit}]"
