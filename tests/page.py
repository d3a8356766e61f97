"""What a reader sees of an HTML page, and a check that it stands alone."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path

_VOID = {"meta", "link", "br", "hr", "img", "input", "col"}


@dataclass
class Page:
    """Text without markup, white space joined; tags with how often; identifiers."""

    text: str
    tags: dict[str, int]
    identifiers: list[str] = field(default_factory=list)

    @property
    def drawings(self) -> int:
        return self.tags.get("svg", 0)


class _Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.words: list[str] = []
        self.tags: dict[str, int] = {}
        self.identifiers: list[str] = []
        self.references: list[str] = []
        self.addresses: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._seen(tag, attrs)
        if tag not in _VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._seen(tag, attrs)

    def handle_endtag(self, tag: str) -> None:
        assert self.open and self.open[-1] == tag, f"</{tag}> closes {self.open[-3:]}"
        self.open.pop()

    def handle_data(self, data: str) -> None:
        if "style" not in self.open:
            self.words.append(data)

    def _seen(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags[tag] = self.tags.get(tag, 0) + 1
        for name, value in attrs:
            if name == "id":
                self.identifiers.append(value or "")
            if name in ("href", "src", "xlink:href", "data", "action", "srcset"):
                self.addresses.append(value or "")
            assert not name.startswith("on"), f"<{tag} {name}>"
            self.references += re.findall(r"url\(#([^)]+)\)", value or "")


def read_page(path: Path) -> Page:
    """The page, after a check that it is closed in order, refers to nothing outside, and names nothing twice."""
    content = path.read_text(encoding="utf-8")
    assert content.startswith("<!DOCTYPE html>")
    reader = _Reader()
    reader.feed(content)
    reader.close()
    assert reader.open == []
    assert len(set(reader.identifiers)) == len(reader.identifiers), "an identifier occurs twice"
    inside = {f"#{name}" for name in reader.identifiers}
    assert set(reader.addresses) <= inside, set(reader.addresses) - inside
    assert {f"#{name}" for name in reader.references} <= inside
    assert not re.search(r"@import|url\((?!#)|https?://", content), "the page refers to something outside"
    return Page(" ".join(" ".join(reader.words).split()), reader.tags, reader.identifiers)
