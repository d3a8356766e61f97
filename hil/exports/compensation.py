"""The table with which a PLC or a drive makes a valve's curve straight: which command gives which response."""

from __future__ import annotations

import numpy as np

from hil.errors import InputError
from hil.identification.steady.flow_curve import monotone
from hil.record.csv_text import csv_text
from hil.record.recording import Array
from hil.record.simulated import SIMULATED

_FINE = 4000
FEWEST = 2


def compensation(command: Array, response: Array, points: int) -> Array:
    """Responses that lie evenly from the least to the largest, and the command for each; shape (points, 2).

    The curve is the monotone spline through the levels. Within a dead band many commands give one response: the
    middle of them is taken, so that the table stays single-valued and steps over the band.

    Args:
        command: levels, rising, shape (n,).
        response: steady response at each, rising or falling, shape (n,).
        points: rows of the table.

    Raises:
        InputError: fewer than two points, or a curve that does not change.
    """
    if points < FEWEST:
        raise InputError(f"points {points}: a table has at least {FEWEST}")
    levels = np.linspace(command[0], command[-1], _FINE)
    curve = monotone(command, response)(levels)
    if curve[-1] < curve[0]:
        levels, curve = levels[::-1], curve[::-1]
    if not curve[-1] > curve[0]:
        raise InputError("the curve does not change with the command: there is nothing to make straight")
    wanted = np.linspace(curve[0], curve[-1], points)
    near = (curve[-1] - curve[0]) / _FINE
    first = np.clip(np.searchsorted(curve, wanted - near, "left"), 0, _FINE - 1)
    last = np.clip(np.searchsorted(curve, wanted + near, "right"), 0, _FINE - 1)
    middle = (levels[first] + levels[last]) / 2.0
    middle[0], middle[-1] = levels[0], levels[-1]
    return np.column_stack((wanted, middle))


def compensation_text(rows: Array, input_heading: str, output_heading: str, *, simulated: bool | None) -> str:
    """The rows of a table as CSV, and whether it is of a simulated valve; None where nobody knows."""
    heads = (output_heading, input_heading, SIMULATED)
    return csv_text(heads, ((*row, simulated) for row in rows.tolist()))
