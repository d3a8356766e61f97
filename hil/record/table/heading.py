"""Headings as other programs write them: one reader of names, units and clocks for every format."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil.errors import UnitError
from hil.units import check_unit

Array = NDArray[Any]

_SQUARE = re.compile(r"^\s*(?P<name>.*\S)\s*\[(?P<unit>[^\[\]]*)\]\s*$")
_IN_FRONT = re.compile(r"^\s*\[(?P<unit>[^\[\]]+)\]\s*(?P<name>[^\[\]]*\S)\s*$")
_INDEXED = re.compile(r"\S\[\d+(,\s*\d+)*\]\s*$")
_ROUND = re.compile(r"^\s*(?P<name>.*\S)\s*\((?P<unit>[^()]+)\)\s*$")
_SLASHED = re.compile(r"^\s*(?P<name>.*[^/\s])\s*/\s*\((?P<unit>[^()]+)\)\s*$")
_CURLY = re.compile(r"^\s*(?P<name>.*\S)\s*[{<](?P<unit>[^{}<>]+)[}>]\s*$")
_AFTER = re.compile(r"^\s*(?P<name>.*\S)(\s+/\s+|\s*[,;]\s+|\s+in\s+)(?P<unit>\S+)\s*$")
_UNIT_ALONE = re.compile(r"^\s*in\s+(?P<unit>\S+)\s*$")
_LETTERS = ("a", "b")  # of the parts of a complex number, `Z'(a)`, rather than years and barns
FREQUENCY_UNITS = frozenset({"Hz", "kHz", "mHz", "MHz", "rad/s", "hertz", "1/s", "rpm"})
# Forms that many a name has too: believed where every heading has them, a time or a frequency among them.
_LOOSE = (
    re.compile(r"^\s*(?P<name>[^/]*[^/\s])/(?P<unit>\S+)\s*$"),
    re.compile(r"^\s*(?P<name>.*[^\s:-])(\s*:\s*|\s+-\s+|\s+)(?P<unit>\S+)\s*$"),
)

_CONTROLS = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]+")

# Names that can only be a time; others must have a unit of time and increase besides.
_TIMES = frozenset({
    "time", "t", "timestamp", "timestamps", "zeit", "x value", "relative time", "elapsed time", "elapsed", "time stamp",
    "datetime", "date time", "absolute time", "clock", "zeitstempel", "uhrzeit", "temps", "tiempo", "tempo", "rel time",
    "abs time", "run time", "test time", "timer", "times", "seconds", "secs", "sec", "master time", "time axis",
})  # fmt: skip
_DATES = frozenset({"date", "datum", "day", "fecha"})
_TIME_WORDS = frozenset({"time", "zeit", "t", "timestamp", "temps", "tiempo"})
_TIME_UNITS = {
    "s": "s", "sec": "s", "secs": "s", "second": "s", "seconds": "s", "ms": "ms", "msec": "ms", "milliseconds": "ms",
    "us": "us", "µs": "us", "μs": "us", "usec": "us", "ns": "ns", "min": "min", "minutes": "min", "h": "h", "sek": "s",
    "sekunden": "s", "sekunde": "s", "millisecond": "ms", "minute": "min", "hour": "h", "hours": "h", "hrs": "h",
    "millis": "ms", "millitm": "ms", "micros": "us", "microseconds": "us",
}  # fmt: skip
_COUNTERS = frozenset(
    {
        "",
        "index",
        "idx",
        "time step",
        "no",
        "nr",
        "#",
        "number",
        "row",
        "point",
        "n",
        "unnamed: 0",
        "sample",
        "samples",
        "record",
        "scan",
    }
)
INTERVALS = frozenset({
    "ts", "dt", "delta t", "sample time", "sampling time", "sampling interval", "wf increment", "sampletime",
    "samplingtime", "deltat", "interval", "tsample", "t s", "t sample", "tinterval", "sample interval",
    "sampling period", "sample period", "xinc", "x increment", "xincrement", "hresolution", "time interval", "tinc",
    "abtastintervall", "intervall", "messintervall",
})  # fmt: skip
"""Names of the distance of samples, as `plain_name` spells them."""
RATES = frozenset({
    "fs", "sample rate", "samplerate", "sampling rate", "sampling frequency", "rate hz", "f s", "rate",
    "sample frequency", "scan rate", "abtastrate", "abtastfrequenz", "messrate",
})  # fmt: skip
"""Names of the number of samples a second."""
_STARTS = frozenset({"t0", "x0", "t_0", "start_time", "starttime", "time_offset", "t_start", "tstart"})
_YEARS_S = tuple(float(np.datetime64(year, "s").astype(np.int64)) for year in ("2000", "2100"))  # since 1970
SPREADSHEET_DAYS = tuple(year_s / 86_400.0 + 25_569.0 for year_s in _YEARS_S)
"""The beginnings of 2000 and 2100, in days since 1899-12-30."""
_MATLAB_DAYS = 693_960.0  # what its day numbers are ahead of a spreadsheet's
_FINE = 2e-5  # days, 1.7 s; seconds that fine, without a unit, count from the start of a recording
_NO_UNIT = frozenset({"-", "--", "none", "n/a", "no unit", "no_units", "unitless", "dimensionless"})


def on_one_line(text: str) -> str:
    """A text in which no character commands a terminal or breaks a line: such are blanks."""
    return _CONTROLS.sub(" ", text).strip()


def split(heading: str) -> tuple[str, str]:
    """Name and unit; the unit is empty when none is stated.

    `flow [l/min]`, and where what stands there is a unit also `flow (l/min)`, `flow / l/min`, `flow, l/min`,
    `[l/min] flow` and `flow in l/min`. A number right behind the name, `flow[2]`, is one of several channels, but
    `flow[1]` has the unit 1.
    """
    if (match := _SQUARE.match(heading)) and (match["unit"] == "1" or not is_indexed(heading)):
        return match["name"], unit_text(match["unit"])
    for pattern in (_SLASHED, _ROUND, _CURLY, _AFTER, _IN_FRONT):
        match = pattern.match(heading)
        if match and is_unit(match["unit"]) and not (pattern is _ROUND and match["unit"] in _LETTERS):
            return match["name"], unit_text(match["unit"])
    alone = _UNIT_ALONE.match(heading)  # `in s`, beside `CH1 in V`
    return ("time", alone["unit"]) if alone and is_time_unit(alone["unit"]) else (heading.strip(), "")


def is_indexed(heading: str) -> bool:
    """Whether a number in square brackets stands right behind the name, which tells elements of an array apart."""
    return bool(_INDEXED.search(heading))


def is_loose(heading: str) -> bool:
    """Whether a heading states no unit, or one in a form that loose ones have beside them: `flow/(l/min)`."""
    return split(heading)[1] == "" or bool(_SLASHED.match(heading))


def split_loosely(headings: Sequence[str]) -> list[tuple[str, str]] | None:
    """Names and units of a whole table whose headings are all like `t/s`, `flow: l/min` or `flow l/min`; else None."""
    for pattern in _LOOSE:
        found = [pattern.match(heading) for heading in headings]
        named = [(m["name"].strip(), unit_text(m["unit"].strip("()"))) for m in found if m and is_unit(m["unit"])]
        if len(named) == len(headings) and any(_is_axis(name, unit) for name, unit in named):
            return named
    return None


def _is_axis(name: str, unit: str) -> bool:
    return unit in FREQUENCY_UNITS or (is_time(name) and is_time_unit(unit))


def unit_text(text: str) -> str:
    """A unit without what surrounds it; 1 for the signs that stand for none."""
    bare = text.strip().strip("[]()").strip()
    return "1" if bare.casefold() in _NO_UNIT or (text.strip() and not bare) else bare


def is_unit(text: str) -> bool:
    """Whether a text in brackets is a unit; a bare number counts channels of one name."""
    bare = unit_text(text)
    if not bare or (bare.isdigit() and bare != "1") or text.strip() == "1":
        return False
    try:
        check_unit(bare)
    except UnitError:
        return False
    return True


def plain_name(name: str) -> str:
    """A name in lower case, its marks as single blanks."""
    return " ".join(re.sub(r"[_\-./:&]+", " ", name.casefold()).split())


def is_time(name: str) -> bool:
    """Whether a column of this name can only hold the time."""
    bare = plain_name(name)
    return bare in _TIMES or (" " in bare and time_unit(name) != "")


def may_be_time(name: str) -> bool:
    """Whether a column of this name holds the time if its unit and its values agree: `time flow`, `t_2`."""
    words = plain_name(name).split()
    return bool(words) and (is_time(name) or words[0] in _TIME_WORDS)


def is_date(name: str) -> bool:
    """Whether a column of this name holds days."""
    return plain_name(name) in _DATES


def time_unit(name: str) -> str:
    """The unit that a name of a time ends with, or is: `time_ms`, `t_s`, `millis`; empty without one."""
    before, _, last = plain_name(name).rpartition(" ")
    return _TIME_UNITS.get(last, "") if not before or before in _TIMES else ""


def is_time_unit(unit: str) -> bool:
    """Whether a unit measures time."""
    return unit in _TIME_UNITS or unit.casefold().rstrip(".") in _TIME_UNITS


def spelt_time_unit(unit: str) -> str:
    """A unit of time as this program spells it; anything else as it is."""
    return _TIME_UNITS.get(unit, _TIME_UNITS.get(unit.casefold().rstrip("."), unit))


def ends_as_time(name: str) -> bool:
    """Whether a name is made with a word for the time: `SimTime`, `Messzeit`."""
    return plain_name(name).endswith(("time", "zeit", "timestamp"))


def fraction_ns(name: str) -> int:
    """How many nanoseconds one is in a column that holds the parts of a second beside a clock; 0 for any other."""
    return {"ms": 1_000_000, "us": 1000}.get(_TIME_UNITS.get(plain_name(name), ""), 0)


def unit_of_stamps(values: Array) -> tuple[str, str]:
    """The unit of stamps that state none, and what they are taken for: seconds, or parts of one since 1970."""
    first = float(values[0]) if len(values) else 0.0
    for origin, words in ((0.0, "days of a spreadsheet"), (_MATLAB_DAYS, "MATLAB's days")):
        since = SPREADSHEET_DAYS[0] + origin < first < SPREADSHEET_DAYS[1] + origin
        if since and 0.0 < float(np.median(np.diff(values))) < _FINE:
            return "day", words
    for unit, size, words in (("s", 1.0, "s"), ("ms", 1e3, "ms"), ("us", 1e6, "µs"), ("ns", 1e9, "ns")):
        if _YEARS_S[0] * size < first < _YEARS_S[1] * size:
            return unit, f"{words} since 1970"
    return "s", "seconds"


def is_counter(name: str) -> bool:
    """Whether a column of this name may number the rows."""
    return plain_name(name) in _COUNTERS or name.strip() == "#"


def is_start(name: str) -> bool:
    """Whether a number of this name states the first stamp of evenly spaced samples, in s."""
    return name.strip().casefold() in _STARTS


def interval_of(name: str, value: float) -> float:
    """The sampling interval that a number of this name states (`Ts`, `dt`, `fs`), in s; 0 for any other."""
    bare, unit = split(name)
    bare = plain_name(bare)
    if value <= 0.0 or unit not in ("", "s", "Hz"):
        return 0.0
    return value if bare in INTERVALS else 1.0 / value if bare in RATES else 0.0
