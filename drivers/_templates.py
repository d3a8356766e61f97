"""Lines of a description with holes in them: filled before they are sent, matched when they come back."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from hil.description.text import HOLE, TIMES

_NUMBER = r"[+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?"
_WORD = r"[+-]?[A-Za-z][A-Za-z0-9_]*"
_NO_NUMBER, _BEYOND = 9.91e37, 9.9e37  # not a number, and infinity, as SCPI writes them
_WORDS = {"NAN": math.nan, "OL": math.inf, "OVLD": math.inf, "OVERLOAD": math.inf, "INF": math.inf}
_WIDTH = re.compile(r"[+ -]?0?(\d+)(?:\.\d+)?[feEgGdxX]?")


@dataclass(frozen=True, slots=True)
class Numbers:
    """How a device writes numbers.

    Attributes:
        decimal: its decimal point.
        none: words and numbers that are no measurement.
    """

    decimal: str = "."
    none: tuple[str, ...] = ()

    def written(self, value: float, form: str) -> str:
        """A number in a form of `format`."""
        text = format(value, form or ".6g")
        if text.startswith("-") and not re.search("[1-9]", text.partition("e")[0].partition("E")[0]):
            text = format(0.0, form or ".6g")  # a zero with a sign is refused here and there
        return text.replace(".", self.decimal)

    def read(self, text: str) -> float | None:
        """A number, NaN or infinite where the device says so; None when it is none."""
        bare = text.strip()
        word = bare.lstrip("+-").upper()
        if bare in self.none or word in self.none:
            return math.nan
        if word in _WORDS:
            return -_WORDS[word] if bare.startswith("-") else _WORDS[word]
        if not re.fullmatch(_NUMBER, bare) or (other := "," if self.decimal == "." else ".") in bare:
            return None
        value = float(bare.replace(self.decimal, ".")) if other not in bare else math.nan
        if any(value == float(none.replace(self.decimal, ".")) for none in self.none if _is_number(none)):
            return math.nan
        if abs(value) >= _NO_NUMBER:
            return math.nan
        return math.copysign(math.inf, value) if abs(value) >= _BEYOND else value


def filled(template: str, numbers: Numbers, time_s: float = 0.0, safe: Mapping[str, float] | None = None,
           value: float = 0.0) -> str:  # fmt: skip
    """A line to be sent."""

    def hole(found: re.Match[str]) -> str:
        name, form = found[1], found[2] or ""
        if name in TIMES:
            return format(max(1, round(TIMES[name] * time_s)), form or "d")
        return numbers.written((safe or {})[name.removeprefix("safe:")] if name.startswith("safe:") else value, form)

    return HOLE.sub(hole, template)


def names_safe(template: str) -> Iterable[str]:
    """The terminals whose safe values a line has."""
    return [hole[1].removeprefix("safe:") for hole in HOLE.finditer(template) if hole[1].startswith("safe:")]


def matched(template: str, text: str, numbers: Numbers) -> float | None:
    """The number in an answer, 0 where the template has none; None when the answer is of another form."""
    found = re.fullmatch(_pattern(template, numbers.none), text.strip())
    if found is None:
        return None
    if "value" not in found.groupdict():
        return 0.0
    digits, form = found["value"], next(hole[2] or "" for hole in HOLE.finditer(template) if hole[1] == "value")
    width = _WIDTH.fullmatch(form)
    value = numbers.read(digits)
    if width and value is not None and math.isfinite(value) and len(digits) != int(width[1]):
        return None  # one byte less is a number too
    return value


def remedy(text: str, numbers: Numbers) -> str:
    """What a description may lack where an answer is of another form than it says; empty where nothing does."""
    bare, other = text.strip(), "," if numbers.decimal == "." else "."
    if re.fullmatch(rf"[+-]?\d+{re.escape(other)}\d+(?:[eE][+-]?\d+)?", bare):
        return f'; a decimal {"comma" if other == "," else "point"}? Then say decimal = "{other}"'
    if found := re.fullmatch(rf"{_NUMBER}(\s*)([A-Za-z%°µ/]+)", bare):
        return f'; a unit behind the number? Then say answer = "{{value}}{found[1]}{found[2]}"'
    if bare and not any(letter.isdigit() for letter in bare):
        return f'; a word for no measurement? Then say no_measurement = ["{bare}"]'
    return ""


def _pattern(template: str, none: tuple[str, ...]) -> str:
    number = "|".join([*(re.escape(word) for word in none), _NUMBER, _WORD])
    parts, at = [], 0
    for hole in HOLE.finditer(template):
        parts.append(_literal(template[at : hole.start()]))
        parts.append(rf"(?P<value>\s*(?:{number})\s*?)" if hole[1] == "value" else ".*?")
        at = hole.end()
    return "".join(parts) + _literal(template[at:])


def _literal(text: str) -> str:
    """What stands between the holes; as many blanks as the device likes where there is one."""
    return r"\s+".join(re.escape(part) for part in re.split(r"\s+", text))


def _is_number(text: str) -> bool:
    return re.fullmatch(_NUMBER, text) is not None
