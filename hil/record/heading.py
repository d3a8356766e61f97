"""Headings as other programs write them: one reader of names, units and clocks for every format."""

from __future__ import annotations

import re
from typing import Any

from numpy.typing import NDArray

from hil.errors import UnitError
from hil.units import check_unit

Array = NDArray[Any]

_SQUARE = re.compile(r"^\s*(?P<name>.*\S)\s*\[(?P<unit>[^\[\]]*)\]\s*$")
_ROUND = re.compile(r"^\s*(?P<name>.*\S)\s*\((?P<unit>[^()]+)\)\s*$")
_AFTER = re.compile(r"^\s*(?P<name>.*\S)(\s+/\s+|\s*[,;]\s+|\s+in\s+)(?P<unit>\S+)\s*$")

# Names that can only be a time; others must have a unit of time and increase besides.
_TIMES = frozenset({
    "time", "t", "timestamp", "timestamps", "zeit", "x value", "relative time", "elapsed time", "elapsed", "time stamp",
    "datetime", "date time", "absolute time", "clock", "zeitstempel", "uhrzeit", "temps", "tiempo", "tempo", "rel time",
    "abs time", "run time", "test time", "seconds", "sec", "master time", "time axis",
})  # fmt: skip
_DATES = frozenset({"date", "datum", "day", "fecha"})
_TIME_WORDS = frozenset({"time", "zeit", "t", "timestamp", "temps", "tiempo"})
_TIME_UNITS = {
    "s": "s", "sec": "s", "secs": "s", "second": "s", "seconds": "s", "ms": "ms", "msec": "ms", "milliseconds": "ms",
    "us": "us", "µs": "us", "usec": "us", "ns": "ns", "min": "min", "minutes": "min", "h": "h", "sek": "s",
}  # fmt: skip
_COUNTERS = frozenset({"", "index", "idx", "no", "nr", "#", "row", "point", "n", "unnamed: 0", "sample", "samples"})
_INTERVALS = frozenset({"ts", "dt", "delta_t", "sample_time", "sampling_time", "sampling_interval", "wf_increment",
                        "sampletime", "samplingtime", "deltat", "interval", "tsample", "t_s", "t_sample"})  # fmt: skip
_RATES = frozenset({"fs", "sample_rate", "samplerate", "sampling_rate", "sampling_frequency", "rate_hz", "f_s", "rate"})
_YEAR_2000_S, _YEAR_2100_S = 946_684_800.0, 4_102_444_800.0  # after the beginning of 1970
_NO_UNIT = frozenset({"-", "--", "none", "n/a", "no unit", "unitless", "dimensionless"})


def split(heading: str) -> tuple[str, str]:
    """Name and unit; the unit is empty when none is stated.

    `flow [l/min]`, and where what stands there is a unit also `flow (l/min)`, `flow / l/min`, `flow, l/min` and
    `flow in l/min`.
    """
    if match := _SQUARE.match(heading):
        return match["name"], unit_text(match["unit"])
    for pattern in (_ROUND, _AFTER):
        match = pattern.match(heading)
        if match and is_unit(match["unit"]):
            return match["name"], unit_text(match["unit"])
    return heading.strip(), ""


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
    return " ".join(re.sub(r"[_\-./:]+", " ", name.casefold()).split())


def is_time(name: str) -> bool:
    """Whether a column of this name can only hold the time."""
    bare = plain_name(name)
    return bare in _TIMES or time_unit(name) != ""


def may_be_time(name: str) -> bool:
    """Whether a column of this name holds the time if its unit and its values agree: `time flow`, `t_2`."""
    words = plain_name(name).split()
    return bool(words) and (is_time(name) or words[0] in _TIME_WORDS)


def is_date(name: str) -> bool:
    """Whether a column of this name holds days."""
    return plain_name(name) in _DATES


def time_unit(name: str) -> str:
    """The unit that a name of a time ends with: `time_ms`, `t_s`; empty without one."""
    before, _, last = plain_name(name).rpartition(" ")
    return _TIME_UNITS.get(last, "") if before in _TIMES else ""


def is_time_unit(unit: str) -> bool:
    """Whether a unit measures time."""
    return unit in _TIME_UNITS or unit.casefold() in _TIME_UNITS


def spelt_time_unit(unit: str) -> str:
    """A unit of time as this program spells it; anything else as it is."""
    return _TIME_UNITS.get(unit, _TIME_UNITS.get(unit.casefold(), unit))


def unit_of_stamps(values: Array) -> tuple[str, str]:
    """The unit of stamps that state none, and what they are taken for: seconds, or parts of one since 1970."""
    first = float(values[0]) if len(values) else 0.0
    for unit, size, words in (("s", 1.0, "s"), ("ms", 1e3, "ms"), ("us", 1e6, "µs"), ("ns", 1e9, "ns")):
        if _YEAR_2000_S * size < first < _YEAR_2100_S * size:
            return unit, f"{words} since 1970"
    return "s", "seconds"


def is_counter(name: str) -> bool:
    """Whether a column of this name may number the rows."""
    return plain_name(name) in _COUNTERS or name.strip() == "#"


def interval_of(name: str, value: float) -> float:
    """The sampling interval that a number of this name states (`Ts`, `dt`, `fs`), in s; 0 for any other."""
    bare = name.strip().casefold()
    if value <= 0.0:
        return 0.0
    return value if bare in _INTERVALS else 1.0 / value if bare in _RATES else 0.0
