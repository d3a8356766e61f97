"""What a recording knows beside its samples, as one line of JSON that a file can carry along."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hil.errors import FileError
from hil.record.plain import to_json
from hil.record.recording import Recording
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


def parse_about(text: str | bytes | None) -> tuple[dict[str, Any], Mapping[str, Mapping[str, Any]]]:
    """`meta` and channels from such a line; nothing from a file of another program."""
    try:
        found = parse_json(text or "{}", KEY)
    except FileError:
        return {}, {}
    meta, channels = (found.get("meta"), found.get("channels")) if isinstance(found, dict) else ({}, {})
    return meta if isinstance(meta, dict) else {}, _known(channels) if isinstance(channels, dict) else {}


def _known(channels: Mapping[Any, Any]) -> dict[str, dict[str, Any]]:
    kinds = {"source": str, "calibration": dict}
    return {
        str(name): {key: stated[key] for key, kind in kinds.items() if isinstance(stated.get(key), kind)}
        for name, stated in channels.items()
        if isinstance(stated, dict)
    }
