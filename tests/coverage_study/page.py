"""Tables on a page of the documentation."""

from __future__ import annotations

from pathlib import Path


def put(page: Path, place: str, made: str) -> None:
    """Into a page, between the marks of its place."""
    begin, end = f"<!-- {place}: begin -->", f"<!-- {place}: end -->"
    before, _, rest = page.read_text(encoding="utf-8").partition(begin)
    page.write_text(f"{before}{begin}\n\n{made}\n{end}{rest.partition(end)[2]}", encoding="utf-8")
