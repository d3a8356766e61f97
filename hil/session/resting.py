"""Which findings rest on samples that are no measurements: those are not given, and the reader is told."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hil.errors import InputError
from hil.record.likeness import Likeness
from hil.record.measurement import Findings, Measured
from hil.record.recording import Recording
from hil.record.unmeasured import sentence, supposed, unmeasured

_UNTOLD = Likeness(reason="it rests on samples that are no measurements")
_ROUNDING = 1e-9  # relative: two evaluations of the same numbers agree better than that


def measured_findings(evaluate: Callable[[Recording], Findings], recording: Recording) -> Findings:
    """What an evaluation finds in a recording, of which samples may be no measurements.

    It is asked twice, with two different suppositions in their place. A value that depends on the supposition rests on
    what nobody measured and is not given; of two uncertainties the larger is given, of two bounds ("above 4.9 Hz") the
    weaker.

    Raises:
        InputError: the recording does not hold what the evaluation needs.
    """
    lacking = unmeasured(recording)
    if not lacking:
        return evaluate(recording)
    near, far = (_tried(evaluate, supposed(recording, where)) for where in ("near", "far"))
    if isinstance(near, InputError):
        raise near
    found = _common(near, Findings() if isinstance(far, InputError) else far)
    said = [f"{sentence(recording, name, mask)}." for name, mask in lacking.items()]
    if gone := [m.name for m, kept in zip(near.measured, found.measured, strict=True) if kept.value != m.value]:
        said.append(f"Not given, or as a bound only, because they rest on these samples: {', '.join(gone)}.")
    if curves := [name for name, curve in near.curves.items() if not _same(curve, found.curves.get(name))]:
        said.append(f"Not drawn for the same reason, wholly or in part: {', '.join(curves)}.")
    return replace(found, notes=(*said, *found.notes))


def _tried(evaluate: Callable[[Recording], Findings], recording: Recording) -> Findings | InputError:
    try:
        return evaluate(recording)
    except InputError as error:
        return error


def _common(near: Findings, far: Findings) -> Findings:
    others = {m.name: m for m in far.measured}
    measured = tuple(_weaker(m, others.get(m.name)) for m in near.measured)
    curves = {name: _kept(curve, far.curves.get(name)) for name, curve in near.curves.items()}
    return Findings(
        measured, {name: curve for name, curve in curves.items() if curve is not None},
        tuple(note for note in near.notes if note in far.notes),
        tuple(text for text in near.deviations if text in far.deviations),
        near.likeness if near.likeness == far.likeness else _UNTOLD,
    )  # fmt: skip


def _weaker(near: Measured, far: Measured | None) -> Measured:
    """What holds whichever of two suppositions is true."""
    if far is not None and near.relation == far.relation and near.value is not None and far.value is not None:
        if _same(float(near.value), float(far.value)) and None not in (near.std, far.std):
            return max(near, far, key=lambda m: m.std or 0.0)
        if _same((near.value, near.std), (far.value, far.std)):
            return near
        if near.relation != "=":
            return min(near, far, key=lambda m: (m.value or 0.0) * (1.0 if m.relation == ">" else -1.0))
    return replace(
        near,
        value=None,
        std=None,
        calibration_std=0.0,
        relation="=",
        verdict=None if near.verdict is None else "cannot tell",
    )


def _kept(near: Any, far: Any) -> Any:
    """A curve that is the same either way, or those of a list that are; None when nothing is left."""
    if _same(near, far):
        return near
    if not (_is_list(near) and _is_list(far)):
        return None
    return [item for item in near if any(_same(item, other) for other in far)] or None


def _same(one: Any, other: Any) -> bool:
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return one.keys() == other.keys() and all(_same(one[key], other[key]) for key in one)
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray) and one.dtype.kind in "fc":
        return one.shape == other.shape and bool(np.allclose(one, other, rtol=_ROUNDING, atol=0.0, equal_nan=True))
    if _is_list(one) and _is_list(other):
        return len(one) == len(other) and all(_same(a, b) for a, b in zip(one, other, strict=True))
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=_ROUNDING) or (math.isnan(one) and math.isnan(other))
    return type(one) is type(other) and bool(np.all(one == other))


def _is_list(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str)
