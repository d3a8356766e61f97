"""What a recording knows beside its samples, as one line of JSON that a file can carry along."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from hil.errors import FileError
from hil.record.plain import to_json
from hil.record.recording import Recording
from hil.record.table.columns import Column, Table
from hil.untrusted import parse_json

KEY = "valve-hil"


def about(recording: Recording) -> str:
    """`meta`, and for every channel its source and calibration."""
    channels = {
        channel.name: {"source": channel.source, "calibration": channel.calibration}
        for channel in recording.channels.values()
        if channel.source or channel.calibration
    }
    return to_json({"meta": recording.meta, "channels": channels})


def described(tables: Sequence[Table], text: str) -> tuple[list[Table], dict[str, Any]]:
    """The tables with source and calibration of each channel, and `meta`, as such a line says; else as they are."""
    try:
        found = parse_json(text or "{}", KEY)
    except FileError:
        found = {}
    meta, channels = (found.get("meta"), found.get("channels")) if isinstance(found, dict) else ({}, {})
    known = channels if isinstance(channels, dict) else {}
    made = [replace(table, columns=[_described(column, known) for column in table.columns]) for table in tables]
    return made, meta if isinstance(meta, dict) else {}


def _described(column: Column, channels: Mapping[Any, Any]) -> Column:
    stated = channels.get(column.name_and_unit[0])
    if not isinstance(stated, dict):
        return column
    source, calibration = stated.get("source"), stated.get("calibration")
    return replace(
        column,
        source=source if isinstance(source, str) else "",
        calibration=calibration if isinstance(calibration, dict) else {},
    )
