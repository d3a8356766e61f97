"""Values as JSON: what numpy, dataclasses, dates and paths look like in a header or an event."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from datetime import date, datetime
from enum import Enum
from pathlib import PurePath
from typing import Any

import numpy as np


def plain(value: Any) -> Any:
    """The value in terms that JSON knows; numbers that are not finite become None.

    Complex numbers become `[real, imaginary]`, arrays nested lists, dataclasses mappings.

    Raises:
        TypeError: something that has no such form; names its type.
    """
    if value is None or (isinstance(value, bool | int | str) and not isinstance(value, Enum)):
        return value
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    return _plain_object(value)


def _plain_object(value: Any) -> Any:
    if isinstance(value, Enum):
        return plain(value.value)
    if isinstance(value, complex | np.complexfloating):
        return [plain(float(value.real)), plain(float(value.imag))]
    if isinstance(value, np.ndarray) and (value.dtype.kind in "iub" or _finite(value)):
        return value.tolist()
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, datetime | date):
        return value.isoformat()
    if isinstance(value, PurePath):
        return str(value)
    raise TypeError(f"{type(value).__name__} {value!r:.60} cannot be written as JSON")


def _finite(values: np.ndarray[Any, Any]) -> bool:
    """Whether these are real numbers, all of them finite: then nothing in them needs another form."""
    return values.dtype.kind == "f" and bool(np.isfinite(values).all())


def to_json(value: Any, indent: int | None = None) -> str:
    """JSON as every language reads it, on one line unless indented."""
    return json.dumps(plain(value), ensure_ascii=False, allow_nan=False, indent=indent)
