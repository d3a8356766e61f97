"""Which findings rest on what nobody measured, or on when it was: not given or less sure, and the reader is told."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hil.arrays import ROUNDING
from hil.errors import InputError
from hil.language.note import Note
from hil.record.frozen import frozen_channels
from hil.record.invalid_samples import invalid_note, invalid_samples, supposed
from hil.record.late_exchanges import late_exchanges
from hil.record.measurement import Findings, Limit, Measured
from hil.record.population_comparison import PopulationComparison
from hil.record.recording import Recording

_NOT_COMPARABLE = PopulationComparison(reason="it rests on samples that are no measurements")
_EVENLY = 3.0**-0.5  # standard deviation of a moment anywhere within a time, in halves of that
_MOSTLY = math.sqrt(2.0)  # a standard uncertainty that grows by more comes from what was added


def measured_findings(evaluate: Callable[[Recording], Findings], recording: Recording) -> Findings:
    """What an evaluation finds in a recording, of which samples may be no measurements.

    It is asked twice, with two different suppositions in their place. A value that depends on the supposition rests on
    what nobody measured and is not given; of two uncertainties the larger is given, of two bounds ("above 4.9 Hz") the
    weaker. Where exchanges with a device took too long it is asked again with other times, and what values differ by
    is a part of their uncertainty. A channel that stood frozen is told in a note.

    Raises:
        InputError: the recording does not hold what the evaluation needs.
    """
    found, late = _measured(evaluate, recording), late_exchanges(recording)
    if late is not None:
        others = [_by_name(evaluate, one) for one in (late.early, late.late)]
        measured = tuple(_less_sure(m, [other.get(m.name) for other in others]) for m in found.measured)
        pairs = zip(found.measured, measured, strict=True)
        if open_ := [m.name for m, kept in pairs if m.value is not None and _outweighs(kept, m)]:
            note = Note(
                "In {n} of {all} samples an exchange with the device took up to {late_s:.2g} s longer than usual. When "
                "it acted or measured within that is not known, which is in the uncertainty of: {names}.",
                n=late.count, all=len(recording), late_s=late.longest_s, names=tuple(open_),
            )  # fmt: skip
            found = replace(found, notes=(note, *found.notes))
        found = replace(found, measured=measured)
    return replace(found, notes=(*frozen_channels(recording), *found.notes))


def _by_name(evaluate: Callable[[Recording], Findings], recording: Recording) -> dict[str, Measured]:
    """What it measures, nothing where it cannot be evaluated."""
    try:
        return {m.name: m for m in _measured(evaluate, recording).measured}
    except InputError:
        return {}


def _outweighs(kept: Measured, before: Measured) -> bool:
    """Whether a value is not given any more, or lateness is what its uncertainty mostly comes from."""
    return kept.value is None or (kept.std or 0.0) > _MOSTLY * (before.std or 0.0)


def _less_sure(found: Measured, others: Sequence[Measured | None]) -> Measured:
    """A value with the others that a supposition of its times gives."""
    for other in others:
        if other is None or found.relation != "=" or other.relation != "=" or None in (found.value, other.value):
            found = _weaker(found, other)
    if found.value is None or found.std is None or found.relation != "=":
        return found
    apart = max(abs(other.value - found.value) for other in others if other is not None and other.value is not None)
    std = math.hypot(found.std, _EVENLY * apart)
    return replace(found, std=std).judged(Limit(found.low, found.high))


def _measured(evaluate: Callable[[Recording], Findings], recording: Recording) -> Findings:
    lacking = invalid_samples(recording)
    if not lacking:
        return evaluate(recording)
    notes = [invalid_note(recording, name, mask).stopped for name, mask in lacking.items()]
    suppositions = [supposed(recording, where) for where in ("near", "far")]
    near, far = (_evaluated(evaluate, one) for one in suppositions)
    if isinstance(near, InputError):
        raise near
    found = _common(near, Findings() if isinstance(far, InputError) else far)
    if gone := [m.name for m, kept in zip(near.measured, found.measured, strict=True) if kept.value != m.value]:
        notes.append(
            Note("Not given, or as a bound only, because they rest on these samples: {names}.", names=tuple(gone))
        )
    if curves := [name for name, curve in near.curves.items() if not _is_same_result(curve, found.curves.get(name))]:
        notes.append(Note("Not drawn for the same reason, wholly or in part: {names}.", names=tuple(curves)))
    return replace(found, notes=(*notes, *found.notes))


def _evaluated(evaluate: Callable[[Recording], Findings], recording: Recording) -> Findings | InputError:
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
        near.population if near.population == far.population else _NOT_COMPARABLE,
    )  # fmt: skip


def _weaker(near: Measured, far: Measured | None) -> Measured:
    """What holds whichever of two suppositions is true."""
    if far is not None and near.relation == far.relation and near.value is not None and far.value is not None:
        if _is_same_result(float(near.value), float(far.value)) and None not in (near.std, far.std):
            return max(near, far, key=lambda m: m.std or 0.0)
        if _is_same_result((near.value, near.std), (far.value, far.std)):
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
    if _is_same_result(near, far):
        return near
    if not (_is_list(near) and _is_list(far)):
        return None
    return [item for item in near if any(_is_same_result(item, other) for other in far)] or None


def _is_same_result(one: Any, other: Any) -> bool:
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return one.keys() == other.keys() and all(_is_same_result(one[key], other[key]) for key in one)
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray) and one.dtype.kind in "fc":
        return one.shape == other.shape and bool(np.allclose(one, other, rtol=ROUNDING, atol=0.0, equal_nan=True))
    if _is_list(one) and _is_list(other):
        return len(one) == len(other) and all(_is_same_result(a, b) for a, b in zip(one, other, strict=True))
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=ROUNDING) or (math.isnan(one) and math.isnan(other))
    return type(one) is type(other) and bool(np.all(one == other))


def _is_list(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str)
