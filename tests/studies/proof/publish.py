"""Publish a proof: on the terminal, as Markdown and as JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from rich.console import Console, JustifyMethod
from rich.table import Table

from tests.studies.markdown import head, line

from .score.bar import claims
from .score.calibration import bands
from .score.result import FAINTEST_SIGMA, Result
from .score.table import HEADINGS, cells, sections

_NOTE = (
    f"Rates with their exact 95 % intervals. Faint: shows with less than {FAINTEST_SIGMA} noise deviations beyond what "
    "base parameters absorb; counted, not scored. Gap: share of the fit between the nominal model and the truth itself "
    "that the corrected model closes, on recordings that were never handed over."
)


_PROBABILITIES = "Probabilities said, and kept"
_BAR_HEADINGS = ("figure", "found", "asked", "")
_BAND_HEADINGS = ("said between", "names", "said on average", "right")
_WRONG_HEADINGS = ("case", "concealed", "outcome", "said", "error")


def show(results: Sequence[Result], console: Console) -> None:
    """Print the proof."""
    for section in sections(results):
        if section.rows:
            console.print(_table(section.heading, HEADINGS, [cells(row) for row in section.rows], justify="right"))
    console.print(_table("The bar", _BAR_HEADINGS, _bar(results)))
    console.print(_table(_PROBABILITIES, _BAND_HEADINGS, _bands(results)))
    console.print(_NOTE, style="dim")


def markdown(results: Sequence[Result], seed: int, fingerprint: str) -> str:
    """Return the proof as a page of documentation."""
    lines = [
        "# The concealment proof", "",
        f"{len(results)} cases, seed {seed}; seals sha256 `{fingerprint}`. {_NOTE}", "",
        *_lines(_BAR_HEADINGS, _bar(results)),
    ]  # fmt: skip
    for section in sections(results):
        if section.rows:
            lines += ["", f"## {section.heading}", "", *_lines(HEADINGS, [cells(row) for row in section.rows])]
    lines += ["", f"## {_PROBABILITIES}", "", *_lines(_BAND_HEADINGS, _bands(results))]
    lines += ["", "## Every case that went wrong", "", *_lines(_WRONG_HEADINGS, _wrong(results))]
    return "\n".join(lines) + "\n"


def _table(
    title: str, headings: Sequence[str], rows: Sequence[tuple[str, ...]], justify: JustifyMethod = "left"
) -> Table:  # fmt: skip
    table = Table(title=title, title_justify="left", pad_edge=False)
    for i, heading in enumerate(headings):
        table.add_column(heading, justify="left" if i == 0 else justify)
    for row in rows:
        table.add_row(*row)
    return table


def _lines(headings: Sequence[str], rows: Sequence[tuple[str, ...]]) -> list[str]:
    return [*head(headings), *map(line, rows)]


def _bar(results: Sequence[Result]) -> list[tuple[str, ...]]:
    return [(c.what, c.found, c.asked, _mark(c.met)) for c in claims(results)]


def _bands(results: Sequence[Result]) -> list[tuple[str, ...]]:
    return [
        (f"{100 * b.low:.0f} to {100 * b.high:.0f} %", str(b.kept.trials), f"{100 * b.said:.1f} %", str(b.kept))
        for b in bands(results)
        if b.kept.trials
    ]


def _wrong(results: Sequence[Result]) -> list[tuple[str, ...]]:
    return [
        (r.label, ", ".join(r.effects) or "–", r.said, ", ".join(r.named) or r.verdict, r.error)
        for r in results
        if r.visible and not r.right
    ]


def keep(results: Sequence[Result], seed: int, fingerprint: str, out: Path) -> None:
    """Write `proof.md` and `proof.json`, a case on each line."""
    (out / "proof.md").write_text(markdown(results, seed, fingerprint))
    about = {"seed": seed, "seals_sha256": fingerprint, "bar": [asdict(claim) for claim in claims(results)]}
    cases = ",\n".join(json.dumps(asdict(result), separators=(",", ":")) for result in results)
    (out / "proof.json").write_text(f'{json.dumps(about)[:-1]}, "cases": [\n{cases}\n]}}\n')


def _mark(met: bool | None) -> str:
    return {True: "reached", False: "missed", None: "not measured"}[met]
