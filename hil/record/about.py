"""What a recording knows beside its samples, as one line of JSON that a file can carry along."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from hil.record.plain import to_json
from hil.record.recording import Recording

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
        found = json.loads(text or "{}")
    except ValueError:
        return {}, {}
    if not isinstance(found, dict):
        return {}, {}
    return found.get("meta", {}), found.get("channels", {})
