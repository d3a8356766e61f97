"""The C side of the compiled subset of Python: types and numbers."""

from __future__ import annotations

import math
from typing import SupportsFloat

import numpy as np

from hil.errors import InputError

# One letter for each type that a kernel or an effect may use.
C_TYPES = {
    "f": "double", "i": "int64_t", "b": "int", "A": "Vec", "I": "IVec", "B": "BVec", "M": "Mat", "Z": "double complex",
}  # fmt: skip
ITEMS = {"A": "f", "I": "i", "B": "b", "M": "f"}
STRUCTS = ("A", "M", "I", "B")
FUNCTIONS = frozenset(
    {
        "atan", "atan2", "ceil", "copysign", "cos", "exp", "expm1", "fabs", "floor", "hypot", "isinf", "isnan", "log",
        "log1p", "pow", "sin", "sqrt", "tan", "tanh",
    }
)  # fmt: skip


class UntranslatableError(InputError):
    """Python that has no translation; names the function and the line."""


def number(value: SupportsFloat) -> str:
    """A number as C reads it back without loss."""
    if isinstance(value, bool | np.bool_):
        return "1" if value else "0"
    if isinstance(value, int | np.integer):
        return f"INT64_C({value})" if value >= 0 else f"(-INT64_C({-int(value)}))"
    found = float(value)
    if math.isnan(found):
        return "NAN"
    if math.isinf(found):
        return "INFINITY" if found > 0.0 else "(-INFINITY)"
    return repr(found)


def indented(lines: list[str]) -> list[str]:
    """One level deeper."""
    return ["    " + line for line in lines]
