"""Publish a proof: on the terminal, as Markdown and as JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.table import Table

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
_BAND_HEADINGS = ("said between", "names", "said on average", "right")
_WRONG_HEADINGS = ("case", "concealed", "outcome", "said", "error")


def show(results: Sequence[Result], console: Console) -> None:
    """Print the proof."""
    for section in sections(results):
        if section.rows:
            table = Table(title=section.heading, title_justify="left", pad_edge=False)
            for i, heading in enumerate(HEADINGS):
                table.add_column(heading, justify="left" if i == 0 else "right")
            for row in section.rows:
                table.add_row(*cells(row))
            console.print(table)
    bar = Table(title="The bar", title_justify="left", pad_edge=False)
    for heading in ("figure", "found", "asked", ""):
        bar.add_column(heading)
    for claim in claims(results):
        bar.add_row(claim.what, claim.found, claim.asked, _mark(claim.met))
    console.print(bar)
    kept = Table(title=_PROBABILITIES, title_justify="left", pad_edge=False)
    for heading in _BAND_HEADINGS:
        kept.add_column(heading)
    for band in _bands(results):
        kept.add_row(*band)
    console.print(kept)
    console.print(_NOTE, style="dim")


def markdown(results: Sequence[Result], seed: int, fingerprint: str) -> str:
    """Return the proof as a page of documentation."""
    lines = [
        "# The concealment proof", "",
        f"{len(results)} cases, seed {seed}; seals sha256 `{fingerprint}`. {_NOTE}", "",
        "| figure | found | asked | |", "|---|---|---|---|",
        *(f"| {c.what} | {c.found} | {c.asked} | {_mark(c.met)} |" for c in claims(results)),
    ]  # fmt: skip
    for section in sections(results):
        if section.rows:
            lines += ["", f"## {section.heading}", "", _line(HEADINGS), _line(["---"] * len(HEADINGS))]
            lines += [_line(cells(row)) for row in section.rows]
    lines += ["", f"## {_PROBABILITIES}", "", _line(_BAND_HEADINGS), _line(["---"] * len(_BAND_HEADINGS))]
    lines += [_line(row) for row in _bands(results)]
    lines += ["", "## Every case that went wrong", "", _line(_WRONG_HEADINGS), _line(["---"] * len(_WRONG_HEADINGS))]
    lines += [_line(row) for row in _wrong(results)]
    return "\n".join(lines) + "\n"


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
    """Write `proof.md` and `proof.json`."""
    (out / "proof.md").write_text(markdown(results, seed, fingerprint))
    fields = {
        "seed": seed,
        "seals_sha256": fingerprint,
        "bar": [asdict(claim) for claim in claims(results)],
        "cases": [asdict(result) for result in results],
    }
    (out / "proof.json").write_text(json.dumps(fields, indent=1))


def _line(texts: Sequence[str]) -> str:
    return f"| {' | '.join(texts)} |"


def _mark(met: bool | None) -> str:
    return {True: "reached", False: "missed", None: "not measured"}[met]
