"""Whether what was recorded is of a real valve: one fact, from the header of the run, and its word in a text."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from hil.errors import FileError
from hil.untrusted import parse_toml

SIMULATED = "simulated"


def marked(text: str, *, simulated: bool | None) -> str:
    """`pass (SIMULATED)`: a line of a terminal that could be taken for one of a real valve."""
    return f"{text} (SIMULATED)" if simulated else text


def is_simulated(meta: Mapping[str, Any]) -> bool:
    """Whether a simulated device had a part in a run.

    Runs of versions that did not write it down say it by the bench file in their header. A recording that is no run
    says nothing, and is not called simulated.
    """
    if isinstance(stated := meta.get(SIMULATED), bool):
        return stated
    return _names_simulated(str(meta.get("bench_file") or ""))


@lru_cache(maxsize=64)
def _names_simulated(bench_file: str) -> bool:
    """Whether a device of a bench file is simulated; False where that is none."""
    try:
        devices = parse_toml(bench_file, "bench_file").get("devices")
    except FileError:
        return False
    named = devices.values() if isinstance(devices, Mapping) else ()
    return any(isinstance(device, Mapping) and bool(device.get(SIMULATED)) for device in named)
