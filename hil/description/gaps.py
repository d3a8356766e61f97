"""What first descriptions of every kind have in common: the mark of a gap, heads, names, ranges and units."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from hil.errors import UnitError
from hil.units import check_unit

GAP = "# GAP:"
_SAME_UNITS = {"°c": "degC", "c": "degC", "°": "deg", "rpm": "1/min", "": "1", "-": "1", "none": "1", "lpm": "l/min"}


def head(path: Path, protocol: str) -> Iterator[str]:
    """The first lines: which file, protocol, what is to be said of the device."""
    yield f"# From {path.name}. Fill in every gap and take its mark away, and what the bench does not need;"
    yield "# `hil describe` checks it."
    yield f'protocol = "{protocol}"'
    yield f'summary = "{path.stem}"   {GAP} what it is, in one line'
    yield f'source = "{path.name}"   {GAP} the manual and its edition'


def number_in(text: str) -> float | None:
    """A factor: `0.1`, `1/10`, `x0.1`."""
    found = re.fullmatch(r"[x×*]?\s*(-?[\d.]+)(?:\s*/\s*(\d+))?", text.replace(",", "."))
    try:
        return float(found[1]) / float(found[2] or 1) if found else None
    except (ValueError, ZeroDivisionError):
        return None


def range_line(low: str, high: str) -> Iterator[str]:
    """A range, or the gap where one is missing."""
    ends = number_in(low), number_in(high)
    if ends[0] is not None and ends[1] is not None and ends[0] < ends[1]:
        yield f"range = [{ends[0]:g}, {ends[1]:g}]"
    else:
        yield f"# range = [0, 0]   {GAP} lowest and highest value, in the unit"


def unit_line(stated: str, there: bool, where: str = "table") -> str:
    """A unit, or the gap where none is said or known."""
    unit = _SAME_UNITS.get(stated.lower(), stated)
    try:
        check_unit(unit)
    except UnitError:
        return f'unit = "1"   {GAP} {stated!r} is no unit that is known here'
    return f'unit = "{unit}"' if there else f'unit = "1"   {GAP} the {where} says none'


def unique(name: str, taken: set[str], more: str = "") -> str:
    """A name that no other terminal has, which it then takes."""
    plain = " ".join(name.replace('"', "").replace("{", "").replace("}", "").split())
    if plain in taken and more:
        plain = f"{more} {plain}"
    number, free = 2, plain
    while free in taken:
        free, number = f"{plain} {number}", number + 1
    taken.add(free)
    return free
