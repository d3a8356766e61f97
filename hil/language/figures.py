"""Numbers as the language that is spoken writes them, with the decimal sign that stands in its catalogue."""

from __future__ import annotations

import re

from hil.language.words import ENGLISH, _, spoken

POINT = "."
"""The decimal sign of the code; the catalogue of a language has its own."""
_IN_A_NUMBER = re.compile(r"(?<=\d)\.(?=\d)")


def localised(number: str) -> str:
    """A number that was written with a point, with the decimal sign; for numbers only, a date or a version has none."""
    return number if spoken() == ENGLISH else _IN_A_NUMBER.sub(_(POINT), number)
