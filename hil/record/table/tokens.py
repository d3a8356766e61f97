"""Single fields of a text file: numbers, stamps of a calendar or a clock, and what stands for nothing."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import date
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil.arrays import Array
from hil.record.table.heading import is_unit

BLANKS = ("", "nan", "NaN", "NAN", "-nan", "-NaN", "NA", "N/A", "n/a", "null", "NULL", "#N/A", "-nan(ind)", "1.#QNAN")

_NUMBER = re.compile(r"[+\-\u2212]?(\d+([.,]\d*)?|[.,]\d+)([eEdD][+-]?\d+)?$|[+-]?(inf|infinity)$", re.IGNORECASE)
_GROUPED = re.compile(r"[+\-\u2212]?[1-9]\d{0,2}(?P<group>[.,' \u2019\u00a0\u202f])\d{3}((?P=group)\d{3})*([.,]\d*)?$")
_MONTH = r"(jan|feb|mar|apr|may|jun|jul|aug|sep|oct|nov|dec)[a-z]*"
_DAYS = (
    r"(\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.]\d{2,4}|"
    rf"\d{{1,2}}[- ]{_MONTH}[- ]\d{{2,4}}|{_MONTH}[. ] *\d{{1,2}},? +\d{{4}})"
)
_DATE = re.compile(rf"{_DAYS}$", re.IGNORECASE)
_STAMP = re.compile(rf"({_DAYS})[ T_,-]+\d{{1,2}}(:|\.\d\d\.)\d{{2}}", re.IGNORECASE)
_CLOCK = re.compile(
    r"(\d+ days?,? )?(\d{1,3}:\d{2}(:\d{2})?([.,;]\d+)?|\d{1,2}:\d{2}:\d{2}:\d{1,3}|\d{1,2}\.\d{2}\.\d{2}[.,]\d+)"
    r"( ?[AP]M)?$",
    re.IGNORECASE,
)
_PREFIXES = {"p": "e-12", "n": "e-9", "u": "e-6", "µ": "e-6", "μ": "e-6", "m": "e-3", "k": "e3", "K": "e3", "M": "e6",
             "G": "e9", "T": "e12"}  # fmt: skip
_LETTERS = f"[{''.join(_PREFIXES)}]"
_PREFIXED = re.compile(rf"([+\-\u2212]?[\d.,]+)\s*((?<=\s)[pnuµμkM]|(?<!\s){_LETTERS})$")
_QUANTITY = re.compile(r"([+\-\u2212]?[\d.,]+([eE][+-]?\d+)?)\s*([^\d\s.,:;+-][^\s:]*)$")
_HMS = re.compile(r"(?<![\d:])(\d{1,3})([:.])(\d\d)\2(\d\d)(?:([:.,;])(\d+))?(?![\d:.])")
_DOTTED = re.compile(r"(\d{1,2})\.(\d\d)\.(\d\d)$")
_FRAMES = re.compile(r"\d:\d\d:\d\d:\d\d$")
_TWO_WAYS = re.compile(r"\s*(\d{1,2})[-/](\d{1,2})[-/](\d{2,4})")
_MONTHS = 12
_DAY, _HOUR = np.timedelta64(24, "h"), np.timedelta64(60, "m")


def is_blank(field: str) -> bool:
    """Whether a field says nothing."""
    return field.strip() in BLANKS


def is_number(field: str) -> bool:
    """Whether a field is a number, with a decimal point or comma, its thousands grouped or not."""
    return bool(_NUMBER.match(field) or _GROUPED.match(field))


def unit_of(field: str) -> str:
    """The unit that stands behind a number in a field, as in `12.5 bar`; empty where there is none."""
    match = _QUANTITY.match(field)
    return match[3] if match and is_number(match[1]) and is_unit(match[3]) else ""


def prefix_of(field: str) -> str:
    """The letter for a power of ten behind a number, as in `25.1m` or `1 k`; after a blank m is metre, K kelvin."""
    match = _PREFIXED.match(field)
    return match[2] if match and is_number(match[1]) else ""


def prefixes(texts: Any) -> set[str]:
    """The letters for powers of ten behind the numbers of a pandas Series of texts, right behind or after a blank."""
    return set(texts.str.extract(rf"[\d.,]\s*({_LETTERS})$")[0].dropna())


def is_quantity(field: str) -> bool:
    """Whether a field is a number, alone or with a unit or a power of ten behind it."""
    return is_number(field) or prefix_of(field) != "" or unit_of(field) != ""


def as_numbers(fields: Sequence[str]) -> Array:
    """Fields that are numbers (see `is_number`), as such."""
    import pandas as pd

    return numbers(pd.Series(fields, dtype=object), *decimal_and_thousands(fields))


def is_stamp(field: str) -> bool:
    """Whether a field is a date, a time of the day, or both."""
    return bool(_DATE.match(field) or _STAMP.match(field) or _CLOCK.match(field))


def decimal_and_thousands(fields: Sequence[str], between_commas: bool = False) -> tuple[str, str]:
    """The marks in numbers; (".", "") where nothing tells. A number that commas separate holds one only in quotes.

    A mark before groups of three digits stands between thousands where the other one, or a comma in quotes, shows it.
    """
    numbers = [field for field in fields if is_number(field)]
    both = next((field for field in numbers if "," in field and "." in field), "")
    if both:
        return (",", ".") if both.rindex(",") > both.rindex(".") else (".", ",")
    commas, points = ([field for field in numbers if mark in field] for mark in ",.")
    grouped = [all(map(_GROUPED.match, found)) for found in (commas, points)]
    if commas and grouped[0] and (between_commas or (points and not grouped[1])):
        return ".", ","
    return (",", "." if points and grouped[1] else "") if commas else (".", "")


def numbers(texts: Any, decimal: str, thousands: str, unit: str = "", prefixed: bool = False) -> Array:
    """Texts as numbers, however they are written; NaN for what is none.

    A typographic minus, marks or blanks between thousands, an exponent after D, and a unit behind the number are read.

    Args:
        texts: a pandas Series of them.
        decimal: the mark in them.
        thousands: the mark between groups of them.
        unit: that may stand behind each.
        prefixed: whether a letter for a power of ten may.
    """
    import pandas as pd

    bare = texts.fillna("").astype(str).str.strip().str.replace("\u2212", "-", regex=False)
    if unit:
        bare = bare.str.removesuffix(unit).str.strip()
    if prefixed:
        powers = bare.str[-1:].map(_PREFIXES)
        bare = bare.where(powers.isna(), bare.str[:-1].str.rstrip() + powers.fillna(""))
    marks = re.escape("".join(("'\u2019\u00a0\u202f ", thousands)))
    marked = bare.str.contains(f"[{marks}]")
    bare = bare.mask(marked & ~bare.str.match(_GROUPED), "")  # `5.07` holds no thousands
    bare = bare.str.replace(f"[{marks}]", "", regex=True)
    bare = bare.str.replace(decimal, ".", regex=False).str.replace(r"(?<=\d)[dD](?=[+-]?\d)", "e", regex=True)
    return pd.to_numeric(bare, errors="coerce").to_numpy(dtype=np.float64)


def stamps(texts: Sequence[str]) -> NDArray[Any]:
    """Fields with dates or clocks as numpy times; a clock that passes midnight goes on.

    Raises:
        ValueError: one cannot be read.
    """
    import pandas as pd

    texts = [text.strip() for text in texts]
    first = next(filter(None, texts), "")
    if all(map(_FRAMES.search, texts)):
        raise ValueError("behind the seconds stand always two digits: frames, or hundredths")
    if _CLOCK.match(first) or _are_dotted_clocks(texts):
        return _clock(pd, [re.sub(r",(?=\d)", ".", _HMS.sub(_with_colons, text, 1)) for text in texts])
    day_first = bool(re.match(r"\d{1,2}\.", first)) or _is_day_first(texts)
    cleaned = pd.Series([_with_blank(text) for text in texts])
    form = {"format": "ISO8601"} if re.match(r"\d{4}-", first) else {"dayfirst": day_first, "format": "mixed"}
    found = pd.to_datetime(cleaned, utc=True, **form)
    return found.dt.tz_localize(None).to_numpy().astype("M8[ns]")


def _with_colons(clock: re.Match[str]) -> str:
    """A clock however its parts are separated, as h:mm:ss.fff: behind a colon milliseconds are counted."""
    hours, _, minutes, seconds, mark, fraction = clock.groups("")
    return f"{hours}:{minutes}:{seconds}" + (f".{fraction.zfill(3) if mark == ':' else fraction}" if fraction else "")


def _with_blank(stamp: str) -> str:
    """A day and a clock however they are separated, with a blank between them."""
    match = _STAMP.match(stamp)
    day, clock = (stamp[: match.end(1)], stamp[match.end(1) :].lstrip(" T_,-")) if match else (stamp, "")
    return f"{day} {_HMS.sub(_with_colons, clock, 1).removesuffix(' UTC').removesuffix(' GMT')}".strip()


def _are_dotted_clocks(texts: Sequence[str]) -> bool:
    """Whether 10.11.12 is a clock, not a day: its last part changes more often than its first."""
    parts = [match.groups() for match in map(_DOTTED.match, texts) if match]
    if not parts or len(parts) < len(texts):
        return False
    hours, minutes, seconds = np.array(parts, dtype=np.int64).T
    possible = hours.max() < 24 and minutes.max() < 60 and seconds.max() < 60
    return bool(possible and np.count_nonzero(np.diff(seconds)) > np.count_nonzero(np.diff(hours)))


def _is_day_first(texts: Sequence[str]) -> bool:
    """Whether 12/06 is a day of June, not of December: as the file's other days tell, else those that lie closer."""
    found = dict.fromkeys(match.groups() for match in map(_TWO_WAYS.match, texts) if match)
    days = [(int(first), int(second), int(year)) for first, second, year in found]
    if any(max(first, second) > _MONTHS for first, second, _ in days):
        return any(first > _MONTHS for first, _, _ in days)
    months_first = [date(2000 + year % 100, first, second).toordinal() for first, second, year in days]
    days_first = [date(2000 + year % 100, second, first).toordinal() for first, second, year in days]
    return int(np.abs(np.diff(days_first)).sum()) < int(np.abs(np.diff(months_first)).sum())


def joined(days: NDArray[Any], clocks: NDArray[Any]) -> NDArray[Any]:
    """Days and times of the day as stamps."""
    return days + (clocks - clocks.astype("m8[D]"))


def is_date_only(text: str) -> bool:
    """Whether a field is a day without a time."""
    return bool(_DATE.match(text.strip()))


def of_two_parts(texts: Sequence[str]) -> str:
    """What the parts of clocks like 10:11 are taken for, in words; empty for other stamps, or with a fraction."""
    if not all(re.fullmatch(r"\d{1,3}:\d{2}", text.strip()) for text in texts):
        return ""
    hours = all(int(text.partition(":")[0]) < 24 for text in texts)
    return "hours and minutes" if hours else "minutes and seconds"


def _clock(pd: Any, texts: list[str]) -> NDArray[Any]:
    period = _DAY
    if re.search("[AP]M$", texts[0], re.IGNORECASE):
        moments = pd.to_datetime(pd.Series(texts), format="mixed").to_numpy().astype("M8[ns]")
        found = moments - moments.astype("M8[D]")
    elif of_two_parts(texts).startswith("hours"):
        found = pd.to_timedelta(pd.Series(texts) + ":00").to_numpy().astype("m8[ns]")
    else:
        short = all(text.count(":") == 1 for text in texts)
        whole = [f"0:{text}" if text.count(":") == 1 else text for text in texts]
        found, period = pd.to_timedelta(pd.Series(whole)).to_numpy().astype("m8[ns]"), _HOUR if short else _DAY
    again = np.cumsum(np.diff(found, prepend=found[:1]) < -(period // 2))
    return found + again * period.astype("m8[ns]")
