"""Frequency responses as tables: frequency, gain and phase, or real and imaginary part; a recording of its own kind."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from hil.errors import FileError, UnitError, option, storing
from hil.record.csv_text import csv_text
from hil.record.durable import write_named
from hil.record.recording import Array, Complex
from hil.record.show import data_frame, dataset, table_html
from hil.record.table import heading as headings
from hil.record.table.columns import Column, Table
from hil.signals.decibel import PER_NEPER, decibels, of_decibels
from hil.units import convert

_WORDS = {
    "frequency": {"frequency", "freq", "f", "frequenz", "fréquence", "frecuencia", "omega", "ω", "w", "hz", "f hz"},
    "gain": {"gain", "magnitude", "mag", "amplitude", "ampl", "amp", "ratio", "r", "betrag", "verstärkung", "level",
             "amplitude ratio", "gain ratio", "abs", "modulus", "|h|", "|g|", "|h(jω)|", "|g(jω)|"},
    "phase": {"phase", "ph", "theta", "θ", "arg", "argument", "angle", "phi", "φ", "phasewinkel", "phasengang",
              "phase angle", "phase shift", "phase lag"},
    "real": {"real", "re", "real part", "realteil", "x"},
    "imaginary": {"imaginary", "imag", "im", "imaginary part", "imaginärteil", "y"},
}  # fmt: skip
_STD = re.compile(r"\b(std|sigma|sd|uncertainty|std dev|u)\b")
_ANGLES = frozenset({"deg", "°", "rad", "mrad", "degree", "degrees", "grad", "Deg"})
_GERMAN_DEGREES = ("Grad", "grad")  # 1/360 of a turn there, 1/400 in English, where nobody measures phases in it
_DECIBEL = frozenset({"db", "decibel"})


@dataclass(frozen=True, slots=True, eq=False)
class ResponseTable:
    """A frequency response as somebody measured it.

    Attributes:
        name: of the file.
        frequency_hz: rising, shape (n,).
        response: output over input in `unit`, shape (n,).
        unit: of the gain; 1 for a ratio.
        in_db: whether the gain is written in decibels.
        gain_std, phase_std_rad: standard uncertainty of each line, the gain's relative; None where nothing is said.
        meta: what else is known, and what was assumed.
    """

    name: str
    frequency_hz: Array
    response: Complex
    unit: str = "1"
    in_db: bool = False
    gain_std: Array | None = None
    phase_std_rad: Array | None = None
    meta: Mapping[str, Any] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.frequency_hz)

    @property
    def phase_deg(self) -> Array:
        """The phase without its jumps, shape (n,)."""
        return np.degrees(np.unwrap(np.angle(self.response)))

    def _repr_html_(self) -> str:
        lines = zip(self.frequency_hz, np.abs(self.response), self.phase_deg, strict=True)
        rows = [(f"{f:.4g}", f"{gain:.4g}", f"{phase:.1f}") for f, gain, phase in lines]
        return table_html(("frequency [Hz]", f"gain [{self.unit}]", "phase [deg]"), rows, self.name)

    def plot(self, *others: ResponseTable) -> Any:
        """A matplotlib figure: gain and phase, those of others beside them."""
        from matplotlib.figure import Figure

        figure = Figure(figsize=(8.0, 5.0), layout="constrained")
        above, below = figure.subplots(2, 1, sharex=True)
        tables = (self, *others)
        for table in tables:
            gain_db, label = decibels(np.abs(table.response)), table.name.rsplit("/", 1)[-1]
            above.plot(table.frequency_hz, gain_db, ".-", label=label, linewidth=1.0)
            below.plot(table.frequency_hz, table.phase_deg, ".-", linewidth=1.0)
        units = ", ".join(dict.fromkeys(table.unit for table in tables))
        above.set_ylabel(f"gain [dB of {units}]" if units != "1" else "gain [dB]")
        above.legend(fontsize="small")
        below.set_ylabel("phase [deg]")
        below.set_xlabel("frequency [Hz]")
        below.set_xscale("log")
        return figure

    def to_pandas(self) -> Any:
        """A pandas DataFrame: gain, phase and their uncertainty, indexed by `frequency [Hz]`."""
        return data_frame(self._headed(in_db=False), "frequency [Hz]", self.frequency_hz)

    def to_xarray(self) -> Any:
        """An xarray Dataset over `frequency`, units as attributes. Raises `InputError` without xarray."""
        return dataset(self._variables(in_db=False), ("frequency", self.frequency_hz, "Hz"), self.name)

    def csv(self) -> str:
        """As CSV: `frequency [Hz]`, `gain […]`, `phase [deg]`, and their standard uncertainties if known."""
        columns = {"frequency [Hz]": self.frequency_hz, **self._headed(in_db=self.in_db)}
        return csv_text(columns, np.column_stack(list(columns.values())).tolist())

    def _headed(self, *, in_db: bool) -> dict[str, Array]:
        return {f"{name} [{unit}]": values for name, (values, unit) in self._variables(in_db=in_db).items()}

    def _variables(self, *, in_db: bool) -> dict[str, tuple[Array, str]]:
        size, unit = np.abs(self.response), "dB" if in_db else self.unit
        found = {"gain": (decibels(size) if in_db else size, unit), "phase": (self.phase_deg, "deg")}
        if self.gain_std is not None:
            found["gain std"] = (self.gain_std * (PER_NEPER if in_db else size), unit)
        if self.phase_std_rad is not None:
            found["phase std"] = (np.degrees(self.phase_std_rad), "deg")
        return found


def are_responses(tables: Sequence[Table]) -> bool:
    """Whether the tables hold no samples in time but lines of a frequency response."""
    return any(_parts(_with_names(table.columns)) for table in tables)


def response_table(name: str, tables: Sequence[Table], meta: Mapping[str, Any] | None) -> ResponseTable:
    """The frequency response of a table.

    Raises:
        FileError: a unit is missing or no unit of what it should be, or lines that are no frequency response.
    """
    named = [replace(table, columns=_with_names(table.columns)) for table in tables]
    table = next(table for table in named if _parts(table.columns))
    parts = _parts(table.columns)
    notes = [table.assumed] if table.assumed else []
    frequency_hz = _frequency_hz(parts["frequency"])
    stds = dict(_stds(table.columns))
    if "real" in parts:
        response = _real(parts["real"]) + 1j * _real(parts["imaginary"])
        unit, in_db = parts["real"].name_and_unit[1] or "1", False
    else:
        gain, unit, in_db = _gain(parts["gain"], notes)
        phase_rad = _phase_rad(parts["phase"], notes)
        response = gain * np.exp(1j * phase_rad)
    order = np.argsort(frequency_hz, kind="stable")
    kept = order[np.isfinite(response[order]) & (response[order] != 0.0) & (frequency_hz[order] > 0.0)]
    if len(kept) < len(order):
        notes.append(f"{len(order) - len(kept)} lines without a value or at no frequency are left out")
    found = frequency_hz[kept]
    if len(found) < 2 or np.any(np.diff(found) <= 0.0):
        twice = found[1:][np.diff(found) <= 0.0]
        why = f"frequency {twice[0]:g} Hz stands in it twice" if twice.size else f"{len(found)} frequencies"
        raise FileError(f"{why}; a frequency response has at least two, each once")
    gain_std = _gain_std(stds.get("gain"), np.abs(response), in_db)
    phase_std = None if "phase" not in stds else _angle(stds["phase"], notes)
    about = {**(meta or {}), **({"assumed": notes} if notes else {})}
    return ResponseTable(
        name, found, np.asarray(response[kept], dtype=np.complex128), unit, in_db,
        None if gain_std is None else gain_std[kept], None if phase_std is None else phase_std[kept], about,
    )  # fmt: skip


def without_phase(tables: Sequence[Table]) -> str:
    """What a table with frequencies and gains alone lacks, in words; empty for any other."""
    for table in tables:
        found = {_quantity_of(column) for column in _with_names(table.columns) if column.is_number}
        if {"frequency", "gain"} <= found and "phase" not in found:
            return "frequencies and gains without a phase; a frequency response needs both, or real and imaginary part"
        others = [c.name_and_unit[0] for c in table.columns if c.is_number and _quantity_of(c) != "frequency"]
        if "frequency" in found and len(others) > 1:
            options = " ".join(
                option("rename", f"{other}={part}") for other, part in zip(others, ("re", "im"), strict=False)
            )
            return (
                f"a table over a frequency, with {', '.join(others)}; say which of them are real and imaginary part, "
                f"as in {options}"
            )
    return ""


def _with_names(columns: Sequence[Column]) -> list[Column]:
    """Columns that are called by their unit alone (`dB`, `deg`) with the names of what these units measure."""
    named = {**dict.fromkeys(_DECIBEL, "gain"), "deg": "phase", "°": "phase", "degrees": "phase"}
    what = [named.get(column.heading.strip().casefold(), "") for column in columns]
    return [
        replace(column, heading=name, unit=column.heading.strip()) if name else column
        for column, name in zip(columns, what, strict=True)
    ]


def refuse_mislabelled(columns: Sequence[Column]) -> None:
    """Raise `FileError` for samples in time that are gains and phases: their first column is a frequency."""
    units = [column.name_and_unit[1] for column in columns]
    levels, angles = [u.casefold() in _DECIBEL for u in units], [u in _ANGLES for u in units]
    if any(levels) and any(angles) and all(a or b for a, b in zip(levels, angles, strict=True)):
        raise FileError(
            f"its columns are in dB and in degrees, as those of a frequency response, but the first is "
            f"called a time; if it is a frequency, say so with {option('rename', 'time=frequency')} "
            f"{option('unit', 'frequency=Hz')}"
        )


def write_response_table(table: ResponseTable, path: Path) -> None:
    """Write a table as CSV.

    Raises:
        FileError: another ending than `.csv`. StorageError: it cannot be written.
    """
    if path.suffix.lower() != ".csv":
        raise FileError(f"{path}: a frequency response is written as .csv")
    with storing(path):
        write_named(path, table.csv())


def _parts(columns: Sequence[Column]) -> dict[str, Column]:
    """The columns of a frequency response by what they hold; empty where there is none."""
    found: dict[str, Column] = {}
    for column in columns:
        what = _quantity_of(column)
        if what and column.is_number and what not in found:
            found[what] = column
    if "frequency" not in found or any(column.is_time for column in columns):
        return {}
    if {"gain", "phase"} <= found.keys() or {"real", "imaginary"} <= found.keys():
        return found
    return {}


def _quantity_of(column: Column) -> str:
    name, unit = column.name_and_unit
    bare = headings.plain_name(name)
    if _STD.search(bare):
        return ""
    if unit in headings.FREQUENCY_UNITS and (bare in _WORDS["frequency"] or "freq" in bare):
        return "frequency"
    named = next((what for what, words in _WORDS.items() if bare in words), "")
    if named:
        return named
    if unit.casefold() in _DECIBEL:
        return "gain"
    if unit in _ANGLES or bare.startswith("phase"):
        return "phase"
    return "frequency" if "freq" in bare else "gain" if bare.startswith(("gain", "magnitude", "mag ")) else ""


def _stds(columns: Sequence[Column]) -> Iterator[tuple[str, Column]]:
    for column in columns:
        bare = headings.plain_name(column.name_and_unit[0])
        if _STD.search(bare) and column.is_number:
            yield ("phase" if "phase" in bare or column.name_and_unit[1] in _ANGLES else "gain"), column


def _real(column: Column) -> Array:
    return column.values.astype(np.float64)


def _frequency_hz(column: Column) -> Array:
    label, unit = column.name_and_unit
    if not unit:
        raise _unit_missing(label, "Hz", "rad/s")
    return _real(column) / (2.0 * math.pi) if unit == "rad/s" else _converted(column, unit, "Hz")


def _unit_missing(label: str, one: str, other: str) -> FileError:
    says = f"{option('unit', f'{label}={one}')} or {option('unit', f'{label}={other}')}"
    return FileError(f"no unit is stated for '{label}'; say it with {says}")


def _converted(column: Column, unit: str, to: str) -> Array:
    try:
        return convert(_real(column), unit, to)
    except UnitError as error:
        raise FileError(f"column '{column.heading}': {error}") from None


def _gain(column: Column, notes: list[str]) -> tuple[Array, str, bool]:
    label, unit = column.name_and_unit
    values = _real(column)
    if not unit and np.nanmin(values) < 0.0:
        notes.append(f"no unit is stated for '{label}', which goes below 0; taken as dB")
        unit = "dB"
    if not unit:
        raise _unit_missing(label, "dB", "1")
    if unit.casefold() in _DECIBEL:
        return of_decibels(values), "1", True
    if np.nanmin(values) < 0.0:
        raise FileError(
            f"'{column.heading}' goes below 0; a gain does not, if it is in decibels say "
            f"{option('unit', f'{label}=dB')}"
        )
    return (values / 100.0, "1", False) if unit == "%" else (values, unit, False)


def _phase_rad(column: Column, notes: list[str]) -> Array:
    label, _ = column.name_and_unit
    values = _angle(column, notes)
    if "lag" in headings.plain_name(label) and np.nanmedian(values) > 0.0:
        notes.append(f"'{label}' is positive and taken as a lag, so its sign is turned")
        return -values
    return values


def _angle(column: Column, notes: list[str]) -> Array:
    label, unit = column.name_and_unit
    if unit in _GERMAN_DEGREES:
        notes.append(
            f"'{label}' is in {unit}, taken as degrees of 360 to a turn; {option('unit', f'{label}=gon')} says "
            "otherwise"
        )
        unit = "deg"
    if not unit:
        raise _unit_missing(label, "deg", "rad")
    return _converted(column, {"°": "deg", "Deg": "deg"}.get(unit, unit), "rad")


def _gain_std(column: Column | None, size: Array, in_db: bool) -> Array | None:
    """Of the gain, relative to it."""
    if column is None:
        return None
    values = _real(column)
    unit = column.name_and_unit[1]
    if unit == "%":
        return values / 100.0
    return values / PER_NEPER if unit.casefold() in _DECIBEL or (not unit and in_db) else values / size
