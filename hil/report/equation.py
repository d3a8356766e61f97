"""Equations in plain type: one law to a line, indices below the line."""

from __future__ import annotations

import re

_INDEX = re.compile(r"_(\{[^}]*\}|[A-Za-z0-9]+)")


def equation_lines(text: str) -> list[list[tuple[str, str]]]:
    """`F = F_C·z;  y = u` as lines of (`base` or `below`, text)."""
    return [_pieces(line.strip()) for line in text.split(";") if line.strip()]


def _pieces(line: str) -> list[tuple[str, str]]:
    pieces: list[tuple[str, str]] = []
    end = 0
    for match in _INDEX.finditer(line):
        pieces.append(("base", line[end : match.start()]))
        pieces.append(("below", match[1].strip("{}").replace("_", "")))
        end = match.end()
    return [piece for piece in (*pieces, ("base", line[end:])) if piece[1]]
