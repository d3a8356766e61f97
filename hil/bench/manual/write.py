"""A new calibration in a bench file: comments are kept, the values before stay in a history."""

from __future__ import annotations

import datetime as dt
import math
import shutil
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from hil.bench.fault import BenchError
from hil.bench.file import CalibrationLine
from hil.bench.read import BenchFile, read_bench
from hil.errors import FileError, storing
from hil.system import system
from hil.untrusted import read_text

HISTORY = "calibration_history"
_STEP, _PLACES = 1e-3, 3  # of limits that are narrowed, always inwards


def write_calibration(file: BenchFile, channel: str, new: CalibrationLine) -> BenchFile:
    """Put a calibration of a channel in the place of what stands in the bench file; returns the file as it is then.

    Limits that the terminal cannot reach any more are narrowed; the instrument's time constant stays. A file that
    stands on another one says the calibration itself from then on.

    Raises:
        FileError: it has changed since it was read, or it would have faults with this; it is left as it was.
        StorageError: it cannot be written.
    """
    path = file.path.resolve()
    old = file.bench.channels[channel].calibration
    if old is not None and new.lag_s is None:
        new = new.model_copy(update={"lag_s": old.lag_s})
    with storing(path):
        text = read_text(path)
        if read_bench(path).text != file.text:
            raise FileError(f"{path}: has changed since it was read; calibrate again")
        part = path.with_name(f".{path.name}.{system.pid()}")
        try:
            part.write_text(changed(text, channel, new, old, narrowed(file, channel, new)), encoding="utf-8")
            _refuse_faults(part, path)
            shutil.copymode(path, part)
            part.replace(path)
        finally:
            with suppress(FileNotFoundError):
                part.unlink()
    return read_bench(path)


def narrowed(file: BenchFile, channel: str, new: CalibrationLine) -> Mapping[str, float]:
    """Limits of an output that its terminal does not reach with this calibration, and what it reaches."""
    entry = file.bench.channels[channel]
    if entry.limits is None:
        return {}
    terminal = file.terminal_of(entry)
    ends = [new.slope * raw + new.offset for raw in entry.raw_range(terminal)]
    low, high = math.ceil(min(ends) / _STEP) * _STEP, math.floor(max(ends) / _STEP) * _STEP
    ends_beyond = {"low": round(low, _PLACES)} if entry.limits.low < min(ends) else {}
    return ends_beyond | ({"high": round(high, _PLACES)} if entry.limits.high > max(ends) else {})


def _refuse_faults(part: Path, path: Path) -> None:
    try:
        read_bench(part)
    except BenchError as error:
        faults = "; ".join(fault.replace(str(part), path.name) for fault in error.faults)
        raise FileError(f"{path}: with this calibration it would have faults, nothing was written: {faults}") from None


def changed(
    text: str, channel: str, new: CalibrationLine, old: CalibrationLine | None, limits: Mapping[str, float]
) -> str:
    """The text of a bench file with another calibration and limits of a channel, the old line in its history."""
    import tomlkit
    from tomlkit.items import InlineTable

    content: Any = tomlkit.parse(text)
    channels = content.setdefault("channels", tomlkit.table(is_super_table=True))
    entry = channels.setdefault(channel, tomlkit.table())
    if old is not None:
        entry.setdefault(HISTORY, tomlkit.aot()).append(tomlkit.item(_stated_fields(old)))
    if "calibration" not in entry:
        entry["calibration"] = tomlkit.inline_table()
    calibration = entry["calibration"]
    if isinstance(calibration, InlineTable):  # made anew: what is put into one that is there runs together
        kept = [key for key in calibration if key in _stated_fields(new)]
        calibration = tomlkit.inline_table()
        calibration.update({key: _stated_fields(new)[key] for key in [*kept, *_stated_fields(new)]})
        entry["calibration"] = calibration
    for key, value in _stated_fields(new).items():
        calibration[key] = value
    for key in [key for key in calibration if key not in _stated_fields(new)]:
        del calibration[key]
    for key, value in limits.items():
        entry.setdefault("limits", tomlkit.inline_table())[key] = value
    return tomlkit.dumps(content)


def _stated_fields(line: CalibrationLine) -> Mapping[str, float | str | dt.date]:
    """What a calibration says, without what it leaves open."""
    return {key: value for key, value in line.model_dump().items() if value is not None and value != ""}
