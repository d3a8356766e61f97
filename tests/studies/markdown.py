"""Tables of studies as Markdown, and the file that they are put into."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path


def line(cells: Iterable[str]) -> str:
    """A row of a table."""
    return f"| {' | '.join(cells)} |"


def head(headings: Sequence[str]) -> list[str]:
    """The two lines that a table begins with."""
    return [line(headings), line(["---"] * len(headings))]


def put(page: Path, begin: str, end: str, made: str) -> None:
    """Into a page, between the lines that mark the place."""
    before, _, rest = page.read_text(encoding="utf-8").partition(begin)
    page.write_text(f"{before}{begin}\n\n{made}\n\n{end}{rest.partition(end)[2]}", encoding="utf-8")
