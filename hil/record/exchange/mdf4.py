"""MDF4 (ASAM), the format of vehicle and machine measurement: `.mf4`.

Channel groups with time bases of their own are joined (see `assemble`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from io import BytesIO
from pathlib import Path
from traceback import walk_tb
from types import ModuleType
from typing import Any, BinaryIO

from hil.errors import FileError
from hil.record.about import KEY, about, parse_about
from hil.record.assemble import assemble
from hil.record.columns import Column, Table
from hil.record.extra import library
from hil.record.recording import Recording

SUFFIXES = (".mf4",)
_ATTACHMENT = f"{KEY}.json"
_FINISHED, _UNFINISHED = b"MDF     ", b"UnFinMF "
_MASTERS = (2, 3)  # channel types "master" and "virtual master"
_NO_TIME = (2, 3, 4)  # synchronised over angle, distance or index


def read(path: Path) -> Recording:
    """Read a recording.

    Raises:
        FileError: not MDF, or without a time and a signal; names what is there.
    """
    asammdf = library("asammdf", path)
    with path.open("rb") as raw:
        beginning = raw.read(8)
        if beginning not in (_FINISHED, _UNFINISHED):
            raise FileError(f"{path}: cannot be read as MDF4: it does not begin with 'MDF'")
        # An unfinished file is mended while it is read: in memory, not where it lies.
        stream = raw if beginning == _FINISHED else BytesIO(path.read_bytes())
        return _read(path, asammdf, stream)


def _read(path: Path, asammdf: ModuleType, stream: BinaryIO) -> Recording:
    try:
        file = asammdf.MDF(stream)
    except Exception as error:  # asammdf raises what its parser happens to stumble over
        _let_go(error)
        raise FileError(f"{path}: cannot be read as MDF4: {error}") from None
    with file:
        meta, channels = parse_about(_attached(file))
        return assemble(str(path), list(_tables(file, channels)), meta)


def _let_go(error: Exception) -> None:
    # The destructor of a file that could not be opened prints a traceback of its own, unless it is closed already.
    for frame, _ in walk_tb(error.__traceback__):
        half_made = getattr(frame.f_locals.get("self"), "__dict__", {})
        if "_tempfile" in half_made:
            half_made["_tempfile"].close()
            half_made["_closed"] = True


def write(recording: Recording, path: Path) -> None:
    """Write a recording as one channel group."""
    asammdf = library("asammdf", path)
    signals = [
        asammdf.Signal(samples=channel.values, timestamps=recording.time_s, name=channel.name, unit=channel.unit)
        for channel in recording.channels.values()
    ]
    with asammdf.MDF(version="4.10") as file:
        file.append(signals, comment=recording.name, common_timebase=True)
        file.attach(about(recording).encode(), file_name=_ATTACHMENT, mime="application/json")
        file.save(path, overwrite=True)


def _attached(file: Any) -> bytes | None:
    names = [Path(str(attachment.file_name)).name for attachment in file.attachments]
    return bytes(file.extract_attachment(index=names.index(_ATTACHMENT))[0]) if _ATTACHMENT in names else None


def _tables(file: Any, channels: Mapping[str, Mapping[str, Any]]) -> Iterator[Table]:
    for index, group in enumerate(file.groups):
        if any(c.channel_type in _MASTERS and c.sync_type in _NO_TIME for c in group.channels):
            continue
        name = group.channel_group.acq_name or f"group {index}"
        for i, channel in enumerate(group.channels):
            if channel.channel_type not in _MASTERS:
                # one at a time: samples marked invalid are dropped, and with them their stamps
                signal = file.get(group=index, index=i)
                column = Column(signal.name, signal.samples, signal.unit, **channels.get(signal.name, {}))
                yield Table(name, [column], signal.timestamps)
