"""MCAP, the log of PlotJuggler and Foxglove: one topic, a JSON message for each sample, units in its schema.

Also read: other logs whose messages are JSON; a topic is a table, a number anywhere in its messages a column.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from hil.errors import FileError
from hil.record.extra import library
from hil.record.recording import Recording
from hil.record.table.about import KEY, about
from hil.record.table.columns import Column, Contents, Table

SUFFIXES = (".mcap",)
KIND = "MCAP"
LIBRARIES = ("mcap.reader", "mcap.writer")
BEGINNING = rb"\x89MCAP0"
_TOPIC, _NS = "recording", 1e9
_UNIT = "unit"  # a keyword of our own in the schema of a field; JSON Schema lets unknown ones stand


def contents(path: Path, file: BinaryIO) -> Contents:
    """The topics of an open file.

    Raises:
        FileError: its messages are not JSON.
    """
    reader = library("mcap.reader", path).make_reader(file)
    messages: dict[str, list[tuple[int, dict[str, float]]]] = {}
    units: dict[str, Mapping[str, str]] = {}
    others: dict[str, str] = {}
    for schema, channel, message in reader.iter_messages():
        if channel.message_encoding != "json":
            others[channel.topic] = channel.message_encoding
            continue
        fields = dict(_fields("", json.loads(message.data)))
        messages.setdefault(channel.topic, []).append((message.log_time, fields))
        if channel.topic not in units:
            units[channel.topic] = _units(schema.data if schema else b"")
    if not messages:
        kinds = ", ".join(f"{topic} ({encoding})" for topic, encoding in others.items()) or "none"
        raise FileError(
            f"{path}: has no messages in JSON, which are read; its topics: {kinds}. Export CSV from a viewer"
        )
    first_ns = min(one[0][0] for one in messages.values())
    assumed = f"topics whose messages are not JSON are left out: {', '.join(others)}" if others else ""
    tables = [_table(topic, found, units[topic], first_ns, assumed) for topic, found in messages.items()]
    notes = {record.name: record.metadata for record in reader.iter_metadata()}
    return tables, notes.get(KEY, {}).get(KEY, "")


def write(recording: Recording, path: Path) -> None:
    """Write a recording; its stamps count from the start of the run where that is known."""
    mcap = library("mcap.writer", path)
    units = {"time": "s", **{channel.name: channel.unit for channel in recording.channels.values()}}
    properties = {name: {"type": "number", _UNIT: unit, "description": unit} for name, unit in units.items()}
    schema = {"title": _TOPIC, "type": "object", "properties": properties}
    columns = [channel.values.tolist() for channel in recording.channels.values()]
    started = recording.meta.get("started_utc")
    start_s = datetime.fromisoformat(started).timestamp() if isinstance(started, str) else 0.0
    stamps_ns = round(start_s * _NS) + np.round((recording.time_s - min(recording.time_s[0], 0.0)) * _NS).astype(int)
    with path.open("wb") as file:
        writer = mcap.Writer(file)
        writer.start(profile="", library=KEY)
        number = writer.register_schema(_TOPIC, "jsonschema", json.dumps(schema).encode())
        topic = writer.register_channel(_TOPIC, "json", number)
        writer.add_metadata(KEY, {KEY: about(recording)})
        for stamp_ns, *row in zip(stamps_ns.tolist(), recording.time_s.tolist(), *columns, strict=True):
            finite = {name: value if math.isfinite(value) else None for name, value in zip(units, row, strict=True)}
            writer.add_message(topic, stamp_ns, json.dumps(finite).encode(), stamp_ns)
        writer.finish()


def _fields(above: str, found: Any) -> Iterator[tuple[str, float]]:
    """The numbers of a message, each under the names that lead to it; NaN where one is missing."""
    if isinstance(found, dict | list):
        for key, value in found.items() if isinstance(found, dict) else enumerate(found):
            yield from _fields(f"{above}.{key}" if above else str(key), value)
    elif found is None or isinstance(found, int | float):
        yield above or "value", np.nan if found is None else float(found)


def _units(schema: bytes) -> Mapping[str, str]:
    """The units that a schema of this program states."""
    found = json.loads(schema or b"{}")
    stated = found.get("properties", {}) if isinstance(found, dict) else {}
    return {
        name: one[_UNIT] for name, one in stated.items() if isinstance(one, dict) and isinstance(one.get(_UNIT), str)
    }


def _table(
    topic: str, messages: list[tuple[int, dict[str, float]]], units: Mapping[str, str], first_ns: int, assumed: str
) -> Table:
    names = dict.fromkeys(name for _, fields in messages for name in fields)
    columns = [
        Column(name, np.array([fields.get(name, np.nan) for _, fields in messages]), units.get(name, ""))
        for name in names
    ]
    if any(column.is_time for column in columns):
        return Table(topic, columns, assumed=assumed)
    return Table(topic, columns, (np.array([stamp for stamp, _ in messages]) - first_ns) / _NS, assumed)
