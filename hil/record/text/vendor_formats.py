"""Text files of programs that are known by their first lines: Rigol's scopes, TwinCAT Scope, LTspice."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import takewhile
from pathlib import Path

import numpy as np

from hil.errors import FileError, UnitError
from hil.record.table.columns import Column, Table
from hil.record.table.heading import split as split_heading
from hil.record.table.tokens import decimal_and_thousands, is_number
from hil.record.text.layout import Kind, Layout, split
from hil.record.text.text_file import Beginning
from hil.units import scale_and_offset

_NUMBER: tuple[Kind, ...] = ("number",)
_RIGOL = re.compile(r"^X,(?P<names>.+),Start,Increment,?\s*$")
_RIGOL_HEAD = re.compile(r"^(?P<names>CH.+?),\s*t0\s*=\s*(?P<start>\S+?)\s*,\s*tInc\s*=\s*(?P<step>\S+?)\s*,?\s*$")
_SPICE_TRACE = re.compile(r"^-?(?P<kind>[VI])\w*\((?P<of>.+)\)", re.IGNORECASE)
_SPICE_UNITS = {"v": "V", "i": "A"}
_SPICE_STEP = re.compile(r"^Step Information:.*\(Run:\s*\d+/(?P<runs>\d+)\)")
_POLAR = re.compile(r"^\(?(?P<db>[-+.\deE]+)dB,(?P<deg>[-+.\deE]+)[^\d]*$")
_CARTESIAN = re.compile(r"^\(?(?P<re>[-+.\deE]+),(?P<im>[-+.\deE]+)\)?$")


@dataclass(frozen=True, slots=True)
class Known:
    """How a file of a known program is laid out, and the tables that its columns are."""

    layout: Layout
    tables: Callable[[Sequence[Column]], list[Table]]


def in_vendor_format(begun: Beginning) -> Known | None:
    """The layout of a file of a program that is known; None for any other.

    Raises:
        FileError: it holds several runs, or several responses.
    """
    encoding, lines = begun.encoding, begun.lines
    if len(lines) < 3:
        return None
    return _rigol(encoding, lines) or _spice(begun.path, encoding, lines) or _twincat(encoding, lines)


def _rigol(encoding: str, lines: Sequence[str]) -> Known | None:
    """A sample's number, channels, and beside the headings where the time starts and how far samples are apart."""
    if found := _RIGOL.match(lines[0]):
        names, units = found["names"].split(","), [cell.strip() for cell in lines[1].split(",")]
        start, step = units[len(names) + 1 : len(names) + 3]
        kinds = _NUMBER * (len(names) + 1)
        headings, of_channels = ("X", *names), ("", *units[1 : len(names) + 1])
        made = Layout(encoding, ",", ".", "", headings, of_channels, 3, kinds)
        return Known(made, partial(_evenly, float(start), float(step), 1))
    if found := _RIGOL_HEAD.match(lines[0]):
        names, count = found["names"].split(","), len(lines[1].rstrip(",").split(","))
        width = len(lines[1].split(","))
        headings = (*names[:count], *[""] * (width - count))
        made = Layout(encoding, ",", ".", "", headings, ("",) * width, 2, _NUMBER * width)
        return Known(made, partial(_evenly, float(found["start"]), float(found["step"]), 0))
    return None


def _evenly(start_s: float, step_s: float, leading: int, columns: Sequence[Column]) -> list[Table]:
    """`leading`: columns before the first channel; the first numbers the samples."""
    count = len(columns[0].values)
    numbers = columns[0].values.astype(np.float64) if leading else np.arange(count, dtype=np.float64)
    note = f"even time base of {step_s:g} s from {start_s:g} s, as the headings say"
    channels = [column for column in columns[leading:] if column.heading]
    return [Table("", channels, start_s + step_s * numbers, note)]


def _spice(path: Path, encoding: str, lines: Sequence[str]) -> Known | None:
    """Traces such as `V(out)` over time or frequency; a complex one is text."""
    if not lines[0].strip():
        return None
    mark = "\t" if "\t" in lines[0] else ","
    first, *traces = split(lines[0], mark)
    if first.casefold() not in ("time", "freq.") or not any(map(_is_trace, traces)):
        return None
    if not all(_is_trace(trace) or split_heading(trace)[1] == "" for trace in traces):
        return None
    stepped = _SPICE_STEP.match(lines[1])
    if stepped and int(stepped["runs"]) > 1:
        raise FileError(f"{path}: holds {stepped['runs']} runs of a parameter that LTspice stepped; export one run")
    row = 3 if stepped else 2
    if first.casefold() == "time":
        units = ("s", *(_SPICE_UNITS[trace.lstrip("-")[0].casefold()] if _is_trace(trace) else "" for trace in traces))
        made = Layout(encoding, mark, ".", "", (first, *traces), units, row, _NUMBER * (1 + len(traces)))
        return Known(made, lambda columns: [Table("", columns)])
    if len(traces) > 1:
        raise FileError(
            f"{path}: holds {len(traces)} traces over frequency, {', '.join(traces)}; a frequency response is one of "
            "them over another: plot and export V(out)/V(in)"
        )
    kinds: tuple[Kind, ...] = ("number", "text")
    made = Layout(encoding, "\t", ".", "", (first, *traces), ("Hz", ""), row, kinds)
    return Known(made, partial(_complex, path))


def _is_trace(heading: str) -> bool:
    """Whether a heading names a voltage or a current of a circuit, `V(in)`, and not its unit, `V(mV)`."""
    found = _SPICE_TRACE.match(heading)
    return found is not None and not _measures(found["of"], _SPICE_UNITS[found["kind"].casefold()])


def _measures(unit: str, quantity: str) -> bool:
    try:
        scale_and_offset(unit, quantity)
    except UnitError:
        return False
    return True


def _complex(path: Path, columns: Sequence[Column]) -> list[Table]:
    texts = [str(text).strip() for text in columns[1].values.tolist()]
    for form, names, units in ((_POLAR, ("gain", "phase"), ("dB", "deg")), (_CARTESIAN, ("re", "im"), ("1", "1"))):
        parts = [form.match(text) for text in texts]
        if all(parts):
            values = np.array([[float(part[1]), float(part[2])] for part in parts if part])
            both = [Column(n, values[:, k], u) for k, (n, u) in enumerate(zip(names, units, strict=True))]
            return [Table("", [Column("frequency", columns[0].values, "Hz"), *both])]
    bad = next(i for i, text in enumerate(texts) if not (_POLAR.match(text) or _CARTESIAN.match(text)))
    raise FileError(f"{path}: row {bad + 1}: '{texts[bad]}' is no complex number, (…dB,…°) or re,im")


def _twincat(encoding: str, lines: Sequence[str]) -> Known | None:
    """Each channel in two columns, its time in ms and its values, below a block of what is said of it."""
    for mark in "\t;,":
        rows = [split(line, mark) for line in lines]
        start = next((i for i, cells in enumerate(rows) if _label(cells) == "Name" and _is_block(rows[i:])), None)
        if start is not None:
            break
    else:
        return None
    about: dict[str, list[str]] = {}
    at = start
    while at < len(rows) and (label := _label(rows[at])) and not is_number(label):
        about[label] = rows[at][1::2]
        at += 1
    while at < len(rows) and not any(rows[at]):
        at += 1
    names = about["Name"]
    headings = tuple(text for name in names for text in ("time [ms]", name))
    decimal, _ = decimal_and_thousands([cell for cells in rows[at:] for cell in cells])
    kinds = _NUMBER * len(headings)
    made = Layout(encoding, mark, decimal, "", headings, ("",) * len(headings), at + 1, kinds)
    return Known(made, partial(_by_twos, about))


def _label(cells: Sequence[str]) -> str:
    """What stands before every value of a line of the block; empty where that is not one thing."""
    labels = set(cells[::2])
    return labels.pop() if len(labels) == 1 else ""


def _is_block(rows: Sequence[Sequence[str]]) -> bool:
    """Whether a line of sample times follows, with nothing but such lines before it."""
    return "SampleTime[ms]" in takewhile(bool, map(_label, rows))


def _by_twos(about: dict[str, list[str]], columns: Sequence[Column]) -> list[Table]:
    """The columns with the units that the block states; each channel has its times before it."""
    units = [unit.partition("(")[0].strip() for unit in about.get("Unit", [""] * len(about["Name"]))]
    made = [replace(column, unit=units[i // 2] if i % 2 else "") for i, column in enumerate(columns)]
    notes = (_scale(name, about, k) for k, name in enumerate(about["Name"]))
    return [Table("", made, None, "; ".join(filter(None, notes)))]


def _scale(name: str, about: dict[str, list[str]], k: int) -> str:
    """What the headings state of a scale: some versions of the program export scaled values, some raw ones."""
    stated = {
        label: float(about[label][k].replace(",", "."))
        for label in ("ScaleFactor", "Offset", "Unit ScaleFactor", "Unit Offset")
        if label in about and about[label][k]
    }
    odd = [f"{label} {value:g}" for label, value in stated.items() if value != float(label.endswith("Factor"))]
    return f"'{name}': the headings state {', '.join(odd)}; the values are taken as they are written" if odd else ""
