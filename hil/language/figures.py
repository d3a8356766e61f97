"""Numbers as the language that is spoken writes them: the decimal sign of its locale, from Unicode's tables."""

from __future__ import annotations

import re
from functools import cache

from hil.language.words import ENGLISH, spoken

_POINT = re.compile(r"(?<=\d)\.(?=\d)")


def localised(number: str) -> str:
    """A number that was written with a point, with the decimal sign; for numbers only, a date or a version has none."""
    return number if spoken() == ENGLISH else _POINT.sub(_decimal_sign(spoken()), number)


@cache
def _decimal_sign(language: str) -> str:
    from babel.numbers import get_decimal_symbol

    return get_decimal_symbol(language)
