"""Whether results say what their samples say: two evaluations of one run, held together."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from hil.arrays import ROUNDING
from hil.findings.difference import by_name
from hil.findings.results import Curve, FittedFunction, Results
from hil.record.measurement import COVERAGE_FACTOR, Measured

SHARE = 0.01
"""How far a figure may be moved, as a share of its own expanded uncertainty: less than a page prints of it."""
_DRAWN = 1e-3  # of the height of a curve: the width of its line


def disagreements(kept: Results, anew: Results, *, words: bool) -> list[str]:
    """What kept results say otherwise than an evaluation now, a sentence each.

    Args:
        kept: results as they lie in the run folder.
        anew: of the same samples and limits, evaluated now.
        words: whether notes and deviations are compared too; another version of the program may word them otherwise.
    """
    return [
        *_about(kept, anew), *_values(kept.values, anew.values, words),
        *_values(kept.figures, anew.figures, words),
        *_curves(kept.curves, anew.curves), *_functions(kept.transfer_functions, anew.transfer_functions),
        *(_sentences(kept, anew) if words else ()),
    ]  # fmt: skip


def _about(kept: Results, anew: Results) -> Iterator[str]:
    for name in ("procedure", "serial", "operator", "started_utc", "verdict"):
        stated, found = getattr(kept, name), getattr(anew, name)
        if stated != found and not (name == "started_utc" and stated is None):  # version 0.1.0 did not state it
            yield f"{name}: {stated or 'none'} in {kept.run}, {found or 'none'} by its samples"


def _values(kept: Sequence[Measured], anew: Sequence[Measured], words: bool) -> Iterator[str]:
    for name, one, other in by_name(kept, anew):
        if one is None or other is None or not _same(one, other, words):
            yield f"{name}: {_text(one)} in the results, {_text(other)} by the samples"


def _same(one: Measured, other: Measured, words: bool) -> bool:
    exact = ("unit", "low", "high", "verdict", "relation", *(("meaning",) if words else ()))
    figures = (
        (one.value, other.value, _freedom(other)),
        *((a, b, SHARE * (b or 0.0)) for a, b in ((one.std, other.std), (one.calibration_std, other.calibration_std))),
    )
    return all(getattr(one, name) == getattr(other, name) for name in exact) and all(_near(*one) for one in figures)


def _freedom(value: Measured) -> float:
    """How far a figure may lie from where it lies now. A bound has its uncertainty in it."""
    if value.relation != "=":
        return SHARE * abs(value.value or 0.0)
    return SHARE * COVERAGE_FACTOR * value.std if value.std is not None and math.isfinite(value.std) else 0.0


def _near(one: float | None, other: float | None, allowed: float) -> bool:
    if one is None or other is None:
        return one is other
    return abs(one - other) <= max(allowed, ROUNDING * abs(other))


def _text(value: Measured | None) -> str:
    if value is None:
        return "none"
    width = "" if value.expanded is None else f" ± {value.expanded:.3g}"
    limits = f", limits {value.limits}" if value.limits else ""
    number = "not determined" if value.value is None else f"{value.relation.strip('=')}{value.value:.6g}{width}"
    return f"{number} {value.unit}{limits}{', ' + value.verdict if value.verdict else ''}"


def _curves(kept: Sequence[Curve], anew: Sequence[Curve]) -> Iterator[str]:
    for name, one, other in by_name(kept, anew):
        if one is None or other is None or one.columns != other.columns or not _drawn_alike(one, other):
            yield f"curve {name}: not the one that the samples give"


def _drawn_alike(one: Curve, other: Curve) -> bool:
    mine, given = (np.array(curve.rows, dtype=float).reshape(-1, len(curve.columns)) for curve in (one, other))
    if mine.shape != given.shape or not np.array_equal(np.isnan(mine), np.isnan(given)):
        return False
    allowed = _DRAWN * np.nanmax(np.abs(given), axis=0, initial=0.0)
    return bool(np.all(np.isnan(given) | (np.abs(mine - given) <= allowed)))


def _functions(kept: Sequence[FittedFunction], anew: Sequence[FittedFunction]) -> Iterator[str]:
    for name, one, other in by_name(kept, anew):
        if one is None or other is None or not _fits_alike(one, other):
            yield f"transfer function {name}: not the one that the samples give"


def _fits_alike(one: FittedFunction, other: FittedFunction) -> bool:
    if (one.unit, one.coefficients) != (other.unit, other.coefficients):
        return False
    variances = [row[i] for i, row in enumerate(other.covariance)]
    return all(
        _near(a, b, SHARE * COVERAGE_FACTOR * math.sqrt(max(variance or 0.0, 0.0)))
        for a, b, variance in zip(one.coefficient_values, other.coefficient_values, variances, strict=True)
    )


def _sentences(kept: Results, anew: Results) -> Iterator[str]:
    for kind in ("notes", "deviations"):
        stated, found = getattr(kept, kind), getattr(anew, kind)
        yield from (f"{kind}: {text!r} is missing in the results" for text in found if text not in stated)
        yield from (f"{kind}: {text!r} stands in the results alone" for text in stated if text not in found)
