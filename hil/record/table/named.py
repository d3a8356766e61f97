"""Columns called as their user says: `--columns`, `--rename`, `--unit`, applied to the tables of any format."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from hil.errors import FileError, SettingError, option
from hil.language.note import Note
from hil.record.invalid_samples import with_blanks
from hil.record.reading import AS_IT_IS, LEFT_OUT, Reading
from hil.record.recording import Recording
from hil.record.table import heading as headings
from hil.record.table.columns import Column, Table, even_times, from_texts


def named(tables: Sequence[Table], reading: Reading) -> list[Table]:
    """The tables with the columns that a user named, renamed, and of stated units.

    Raises:
        FileError: another number of columns than there are names, or no column of a name.
    """
    tables = [replace(table, columns=[from_texts(column) for column in table.columns]) for table in tables]
    found = _headed(tables, reading.columns) if reading.columns else list(map(_with_loose_units, tables))
    _check_known(found, reading)
    return [
        replace(table, columns=[_with_stated_unit(_renamed(column, reading), reading) for column in table.columns])
        for table in found
    ]


def _with_loose_units(table: Table) -> Table:
    """A table with the units that all its headings state in a looser form (`t/s`, `flow l/min`), and none otherwise."""
    if any(column.unit or not headings.is_loose(column.heading) for column in table.columns):
        return table
    apart = headings.split_loosely([column.heading for column in table.columns])
    if apart is None:
        return table
    named = [replace(c, heading=name, unit=unit) for c, (name, unit) in zip(table.columns, apart, strict=True)]
    return replace(table, columns=named)


def _headed(tables: Sequence[Table], names: Sequence[str]) -> list[Table]:
    count = sum(len(table.columns) for table in tables)
    if count != len(names):
        have = ", ".join(f"'{c.heading}'" for table in tables for c in table.columns if c.heading.strip())
        raise FileError(
            f"{option('columns')} names {len(names)} columns, the file has "
            f"{count}{': ' if have else ''}{have}; give a "
            f"name for each, '{LEFT_OUT}' for one to leave out"
        )
    rest = iter(names)
    made = []
    for table in tables:
        columns = [replace(c, heading=heading) for c, heading in zip(table.columns, rest, strict=False)]
        made.append(replace(table, columns=[c for c in columns if c.heading.strip() != LEFT_OUT]))
    return made


def _check_known(tables: Sequence[Table], reading: Reading) -> None:
    have = [c for table in tables for c in table.columns]
    known = {text for c in have for text in (c.name_and_unit[0], c.heading.strip())}
    asked = {**dict.fromkeys(reading.renamed, "rename"), **dict.fromkeys(reading.units, "unit")}
    if reading.time:
        asked[reading.time] = "time"
    allowed = known | set(reading.renamed.values()) | {"time"}
    for wanted, name_of in asked.items():
        if wanted not in (known if name_of == "rename" else allowed):
            there = ", ".join(_heading_text(c) for c in have) or "none"
            raise FileError(f"{option(name_of)} {wanted}: no channel '{wanted}'; it has: {there}")


def _heading_text(column: Column) -> str:
    name, unit = column.name_and_unit
    return f"{name} [{unit}]" if unit else f"'{name}'"


def _renamed(column: Column, reading: Reading) -> Column:
    name, unit = column.name_and_unit
    new = reading.renamed.get(name, reading.renamed.get(column.heading.strip(), ""))
    if not new:
        return column
    label, stated = headings.split(new)
    return replace(column, heading=label, unit=stated or unit)


def _with_stated_unit(column: Column, reading: Reading) -> Column:
    name, _ = column.name_and_unit
    unit = reading.units.get(name) or next(
        (reading.units[old] for old, new in reading.renamed.items() if new == name and old in reading.units), ""
    )
    return replace(column, heading=name, unit=unit) if unit else column


def pairs(option: str, texts: Sequence[str], example: str) -> dict[str, str]:
    """`NAME=VALUE` texts of an option.

    Raises:
        SettingError: one is not of that form.
    """
    for text in texts:
        if not all(part.strip() for part in text.rpartition("=")):
            raise SettingError(f"{option} {text}: NAME=VALUE was expected, as in '{example}'")
    return {left.strip(): right.strip() for left, _, right in (text.rpartition("=") for text in texts)}


def even_note(interval_s: float) -> Note:
    """That the samples were taken as evenly spaced."""
    return Note(
        "even time base of {interval_s:g} s, as {option} says", interval_s=interval_s, option=option("interval")
    )


def with_stated_units(recording: Recording, reading: Reading) -> Recording:
    """The recording with the names of what its user has stated the unit of: nobody needs to doubt that."""
    stated = sorted({reading.renamed.get(name, name) for name in reading.units})
    return replace(recording, meta={**recording.meta, "stated_units": stated}) if stated else recording


def as_stated(run: Recording, reading: Reading) -> Recording:
    """A run as it was recorded with the names, units and interval that its user says, and NaN for what is no sample.

    Raises:
        FileError: no such channel, or none was ever measured.
        SettingError: an option for files whose columns are not known.
    """
    recording = with_blanks(run)
    if reading == AS_IT_IS:
        return recording
    if reading.time or reading.columns:
        asked = f"{option('time')} and {option('columns')}"
        raise SettingError(f"{recording.name}: {asked} are for files of others; a run knows its columns")
    names = {old: recording.channel(old).name for old in reading.renamed}
    new = {names[old]: label for old, label in reading.renamed.items()}
    channels = {new.get(name, name): replace(c, name=new.get(name, name)) for name, c in recording.channels.items()}
    own = {new.get(name, name): taken for name, taken in recording.own.items()}
    units = {reading.renamed.get(name, name): unit for name, unit in reading.units.items()}
    time_s, meta = recording.time_s, recording.meta
    if reading.interval_s:
        time_s = even_times(len(recording), reading.interval_s)
        meta = {**meta, "assumed": [*meta.get("assumed", ()), even_note(reading.interval_s)]}
    stated = replace(recording, time_s=time_s, channels=channels, meta=meta, own=own).with_units(units)
    return with_stated_units(stated, reading)
