"""Conditions of a test as its channels measured them, and where they leave the range that the bench declares."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hil.errors import UnitError
from hil.language.note import Note
from hil.record.recording import Array, Channel, Mask, Recording
from hil.units import scale_and_offset

CHANNELS: Mapping[str, tuple[tuple[str, ...], str]] = {
    "fluid_temperature_c": (("oil temperature", "fluid temperature"), "degC"),
    "ambient_temperature_c": (("ambient temperature",), "degC"),
    "supply_pressure_bar": (("supply pressure",), "bar"),
    "return_pressure_bar": (("return pressure",), "bar"),
}
"""By their name in the bench file: channels that measure them, the first that is there, and the unit of the name."""

_BROUGHT_ABOUT = frozenset(("oil temperature", "supply pressure", "tank pressure"))
"""Roles of outputs that are at rest before a run and after it, and conditions with them."""
_SHOWN = {"degC": "°C"}
_GRADES = frozenset((2, 3, 5, 7, 10, 15, 22, 32, 46, 68, 100, 150, 220, 320, 460, 680, 1000, 1500, 2200, 3200))
"""ISO 3448: viscosity at 40 °C in mm²/s."""
_FAMILIES = "VG|HLPD?|HLP-D|HVLPD?|HL|HM|HV|HG|HEES|HETG|HEPG|HEPR|HFC|HFD[RU]?"
"""Marks of DIN 51524, ISO 6743-4 and ISO 15380 that stand before the grade; the number of a brand need not be one."""
_OILS = frozenset(("oil", "fluid", "hydraulic oil", "hydraulic fluid", "öl"))

ADJUSTED = "adjusted"
"""Kind of the part in which a procedure brings conditions to other values."""

_STEADY_S = 1.0  # means over so long are looked at, not single samples


@dataclass(frozen=True, slots=True)
class Condition:
    """What a channel measured of a condition: means over the first, the whole, the last, the lowest and highest second.

    `std`: standard deviation of single samples.
    """

    channel: str
    unit: str
    first: float
    mean: float
    last: float
    low: float
    high: float
    std: float


def measured_conditions(recording: Recording) -> dict[str, Condition]:
    """Every condition that a channel measured, by its name in the bench file."""
    found = {name: _measured(recording, *known) for name, known in CHANNELS.items()}
    return {name: condition for name, condition in found.items() if condition is not None}


def condition_departures(recording: Recording) -> tuple[Note, ...]:
    """Where a condition left its declared range, a sentence each; measured where it was, else as stated."""
    stated: Mapping[str, Any] = recording.meta.get("conditions") or {}
    measured = measured_conditions(recording)
    found = [contradiction] if (contradiction := oil_contradiction(stated, recording.meta.get("notes") or {})) else []
    for name, (low, high) in (stated.get("ranges") or {}).items():
        unit = _SHOWN.get(CHANNELS[name][1], CHANNELS[name][1])
        was = measured.get(name)
        span = (was.low, was.high) if was else (stated.get(name), stated.get(name))
        values = {"quantity": Note(name.rpartition("_")[0].replace("_", " ")), "low": low, "high": high, "unit": unit}
        if span[0] is None:
            found.append(
                Note("{quantity!c} was not measured and not stated; {low:g} to {high:g} {unit} is declared.", **values)
            )
        elif span[0] < low or span[1] > high:
            values |= {"found": _span(*span)}
            found.append(
                Note("{quantity!c} was {found} {unit}; {low:g} to {high:g} {unit} is declared.", **values)
                if was
                else Note("{quantity!c} is stated as {found} {unit}; {low:g} to {high:g} {unit} is declared.", **values)
            )
    return tuple(found)


def _span(low: float, high: float) -> Note:
    if low == high:
        return Note("{value:.4g}", value=low)
    return Note("{low:.4g} to {high:.4g}", low=low, high=high)


def oil_contradiction(stated: Mapping[str, Any], notes: Mapping[str, Any]) -> Note | None:
    """Where the oil that is stated is of another viscosity class than the one stated beside it.

    `stated`: the conditions of a bench file. `notes`: of a run; one called oil or fluid names the oil too.
    """
    named = [str(stated.get("fluid") or ""), *(str(text) for key, text in notes.items() if key.casefold() in _OILS)]
    grade = _grade(str(stated.get("viscosity_class") or ""), alone=True)
    for oil in named:
        if grade and (other := _grade(oil)) and other != grade:
            return Note(
                "The oil is stated as {oil}, its viscosity class as ISO VG {grade}; one of them is wrong.",
                oil=oil, grade=grade,
            )  # fmt: skip
    return None


def _grade(text: str, *, alone: bool = False) -> int | None:
    """The ISO viscosity grade that a name of an oil has in it; `alone`: a number by itself is one too."""
    found = re.search(rf"\b(?:{_FAMILIES})[ -]?(\d{{1,4}})\b", text, re.IGNORECASE)
    found = found or (re.fullmatch(r"\s*(\d{1,4})\s*", text) if alone else None)
    grade = int(found[1]) if found else 0
    return grade if grade in _GRADES else None


def _measured(recording: Recording, names: tuple[str, ...], unit: str) -> Condition | None:
    channel = next((recording.channels[name] for name in names if name in recording.channels), None)
    values = None if channel is None else _in_unit(channel, unit)
    if channel is None or values is None or not np.isfinite(values).any():
        return None
    kept = np.isfinite(values) & _within_parts(recording)
    kept = kept if kept.any() else np.isfinite(values)
    values, time_s = values[kept], recording.time_s[kept]
    means = _means_per_second(time_s, values)
    return Condition(
        channel.name, _SHOWN.get(unit, unit), float(means[0]), float(values.mean()), float(means[-1]),
        float(means.min()), float(means.max()), float(values.std()),
    )  # fmt: skip


def _within_parts(recording: Recording) -> Mask:
    """Samples of a procedure's parts: conditions come about before them, are adjusted between, and fall after them.

    Where no output of the bench brings them about all samples count, as page one of earlier passports has it.
    """
    every = recording.meta.get("parts") or ()
    parts = [part for part in every if part.get("kind") != ADJUSTED]
    stand = len(parts) == len(every) and not _BROUGHT_ABOUT.intersection(recording.meta.get("roles") or {})
    within = np.full(len(recording.time_s), not parts or stand)
    for part in parts:
        within[int(part["first"]) : int(part["first"]) + int(part["count"])] = True
    return within


def _in_unit(channel: Channel, unit: str) -> Array | None:
    try:
        scale, offset = scale_and_offset(channel.unit, unit)
    except UnitError:
        return None
    return scale * channel.values + offset


def _means_per_second(time_s: Array, values: Array) -> Array:
    """Over every second that holds samples; what is left at the end belongs to the last whole one."""
    seconds = np.floor((time_s - time_s[0]) / _STEADY_S).astype(np.int64)
    whole = max(1, int(np.floor((time_s[-1] - time_s[0]) / _STEADY_S + 1e-9)))
    starts = np.unique(np.searchsorted(seconds, np.arange(whole)))
    counts = np.diff(np.append(starts, len(values)))
    return np.add.reduceat(values, starts) / counts
