"""Measured values as a table for the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hil.record.measurement import Findings, Measured


def findings_text(findings: Findings, *, simulated: bool = False) -> str:
    """Every measured value with its expanded uncertainty as in the report, limits and verdict; then notes and verdict.

    Where the calibration has a part in the uncertainty, what is left without it stands behind. Before the verdict of
    the run stands every limit that was missed or cannot be told, with how far it is, and the unit beside good ones.
    The line of the verdict says where a simulated valve was tested.
    """
    from hil.findings.collect import functions_of
    from hil.record.simulated import marked
    from hil.report.number import limits_text
    from hil.report.results import beside_good, reasons, value_text

    rows = [
        (m.name, _plain(value_text(m)), m.unit, _plain(limits_text(m.low, m.high)), m.verdict or "", _beside(m))
        for m in findings.measured
    ]
    widths = [max((len(row[i]) for row in rows), default=0) for i in range(6)]
    table = ["  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    functions = [f"transfer function: {one.name}: {_plain(one.formula)}" for one in functions_of(findings.curves)]
    notes = [f"note: {note}" for note in findings.notes]
    deviations = [f"deviation: {deviation}" for deviation in findings.deviations]
    verdict = (
        f"verdict: {findings.verdict}" if findings.verdict else "verdict: none; no limit was given, nothing was judged"
    )
    kept_from_passing = [_plain(text) for text in (*reasons(findings), *beside_good(findings))]
    last = marked(verdict, simulated=simulated)
    return "\n".join([*table, *functions, *notes, *deviations, *kept_from_passing, last])


def _beside(m: Measured) -> str:
    from hil.report.results import repeatability_text

    text = repeatability_text(m)
    return f"(repeatability ± {text})" if text else ""


def _plain(text: str) -> str:
    """With a hyphen for minus: what is printed here is pasted into spreadsheets and read by scripts."""
    from hil.report.number import MINUS

    return text.replace(MINUS, "-")
