"""Measured values as a table for the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from hil.record.measurement import Findings, Measured

_WIDEST = 120  # characters of a column, but of the last one


def where(page: Path, name: str = "report") -> list[str]:
    """The line that says where a page is; none where it was not made."""
    return [f"{name}: {page}"] if page.is_file() else []


def findings_text(findings: Findings, *, simulated: bool = False, ended: str = "") -> str:
    """Every measured value with its expanded uncertainty as in the report, limits and verdict; then notes and verdict.

    Where the calibration has a part in the uncertainty, what is left without it stands behind. Before the verdict of
    the run stands every limit that was missed or cannot be told, with how far it is, and the unit beside good ones.
    The line of the verdict says where a simulated valve was tested. `ended`: what kept the run from ending as planned.
    """
    from hil.findings.collect import functions_of
    from hil.record.simulated import marked
    from hil.report.comparisons import comparison_sentences
    from hil.report.number import limits_text, unit_text
    from hil.report.results import reasons, value_text

    rows = [
        (
            m.name,
            typed(value_text(m)),
            unit_text(m.unit),
            typed(limits_text(m.low, m.high)),
            m.verdict or "",
            _spread(m),
        )
        for m in findings.measured
    ]
    functions = [one.line for one in functions_of(findings.curves)]
    notes = [f"note: {note}" for note in findings.notes]
    deviations = [f"deviation: {deviation}" for deviation in findings.deviations]
    verdict = (
        f"verdict: {findings.verdict}" if findings.verdict else "verdict: none; no limit was given, nothing was judged"
    )
    why = map(typed, (*reasons(findings), *comparison_sentences(findings)))
    last = marked(verdict, simulated=simulated)
    ending = [f"the run did not end as planned: {ended}"] if ended else []
    return "\n".join([*aligned(rows), *map(typed, functions), *notes, *deviations, *why, *ending, last])


def _spread(m: Measured) -> str:
    from hil.report.results import repeatability_text

    text = repeatability_text(m)
    return f"(repeatability ± {text})" if text else ""


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Rows of as many texts each as lines in which those of one column stand below each other.

    Of a longer text than `_WIDEST` the beginning is shown: one name of ten thousand letters moves no other column.
    """
    rows = [
        [text if len(text) <= _WIDEST else f"{text[: _WIDEST - 1]}…" for text in row[:-1]] + [*row[-1:]] for row in rows
    ]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def typed(text: str) -> str:
    """With a hyphen for minus: what is printed here is pasted into spreadsheets and read by scripts."""
    from hil.report.number import MINUS

    return text.replace(MINUS, "-")
