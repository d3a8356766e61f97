"""A point of the Bode plot, as a procedure has told it of a sine that it has measured."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from typing import Any

from hil.signals.decibel import decibels


def bode_point(part: Mapping[str, Any]) -> dict[str, Any] | None:
    """The point of a part of kind `sine` that holds its response; None of any other.

    Returns frequency (Hz), gain (dB about one output unit per command unit), phase (deg), and the series to which it
    belongs.
    """
    frequency_hz, pair = part.get("frequency_hz"), part.get("response")
    if part.get("kind") != "sine" or part.get("unfinished") or not _is_number(frequency_hz):
        return None
    if not isinstance(pair, list | tuple) or len(pair) != 2 or not all(map(_is_number, pair)):
        return None
    response = complex(*pair)
    if response == 0.0:
        return None
    return {
        "frequency_hz": frequency_hz, "gain_db": round(float(decibels(response)), 3),
        "phase_deg": round(math.degrees(cmath.phase(response)), 2),
        "amplitude": part.get("amplitude"), "bias": part.get("bias"),
    }  # fmt: skip


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and math.isfinite(value)
