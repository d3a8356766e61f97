"""What a section of a page consists of."""

from __future__ import annotations

from dataclasses import dataclass

from hil.report.figure import Picture


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of text under their headings; numbers stand right, `text_columns` (by index) and the first one left."""

    caption: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    text_columns: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Listing:
    """Several lines of text as they are, under a line that says what they are."""

    title: str
    text: str


@dataclass(frozen=True, slots=True)
class Section:
    """A heading, what it says in words, pictures, tables, listings."""

    title: str
    texts: tuple[str, ...] = ()
    figures: tuple[Picture, ...] = ()
    tables: tuple[Table, ...] = ()
    listings: tuple[Listing, ...] = ()

    @property
    def empty(self) -> bool:
        """Whether there is nothing under the heading."""
        return not (self.texts or self.figures or self.tables or self.listings)
