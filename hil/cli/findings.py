"""Measured values as a table for the terminal."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hil.record.measurement import Findings, Measured


def findings_text(findings: Findings) -> str:
    """Every measured value with its expanded uncertainty (k = 2), limits and verdict; then the notes."""
    rows = [(m.name, value_text(m), m.unit, limits_text(m), m.verdict or "") for m in findings.measured]
    widths = [max((len(row[i]) for row in rows), default=0) for i in range(5)]
    table = ["  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    notes = [f"note: {note}" for note in findings.notes]
    deviations = [f"deviation: {deviation}" for deviation in findings.deviations]
    verdict = [f"verdict: {findings.verdict}"] if findings.verdict else []
    return "\n".join([*table, *notes, *deviations, *verdict])


def value_text(measured: Measured) -> str:
    """`1.269 ± 0.012`: the uncertainty to two digits, the value to the same place; k = 2."""
    if measured.value is None:
        return "not determined"
    sign = "" if measured.relation == "=" else f"{measured.relation} "
    if not measured.std:
        return f"{sign}{measured.value:.6g}"
    expanded = 2.0 * measured.std
    digits = max(0, 1 - math.floor(math.log10(expanded)))
    return f"{sign}{measured.value:.{digits}f} ± {expanded:.{digits}f}"


def limits_text(measured: Measured) -> str:
    """`0.8 … 1.2`, `≥ 0.8`, or nothing."""
    low, high = measured.low, measured.high
    if low is None and high is None:
        return ""
    if low is None:
        return f"≤ {high:g}"
    return f"≥ {low:g}" if high is None else f"{low:g} … {high:g}"
