"""MDF (ASAM), the format of vehicle and machine measurement: `.mf4`; `.mdf` and `.dat` of version 3 are read too.

Channel groups with time bases of their own are joined (see `assemble`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from io import BytesIO
from pathlib import Path
from traceback import walk_tb
from types import ModuleType
from typing import Any, BinaryIO

import numpy as np

from hil.errors import FileError
from hil.record.about import KEY, about, parse_about
from hil.record.assemble import assemble
from hil.record.columns import Column, Table
from hil.record.extra import library
from hil.record.flat import flat
from hil.record.reading import AS_IT_IS, Reading
from hil.record.recording import Recording
from hil.record.response_table import ResponseTable

SUFFIXES = (".mf4", ".mdf")
BEGINNINGS = (b"MDF     ", b"UnFinMF ")
_ATTACHMENT = f"{KEY}.json"
_FINISHED, _UNFINISHED = b"MDF     ", b"UnFinMF "
_MASTERS = (2, 3)  # channel types "master" and "virtual master"
_NO_TIME = (2, 3, 4)  # synchronised over angle, distance or index


def read(path: Path, reading: Reading = AS_IT_IS) -> Recording | ResponseTable:
    """Read a recording.

    Raises:
        FileError: not MDF, or without a time and a signal; names what is there.
    """
    asammdf = library("asammdf", path)
    with path.open("rb") as raw:
        beginning = raw.read(8)
        if beginning not in (_FINISHED, _UNFINISHED):
            raise FileError(f"{path}: cannot be read as MDF: it does not begin with 'MDF'")
        # An unfinished file is mended while it is read: in memory, not where it lies.
        stream = raw if beginning == _FINISHED else BytesIO(path.read_bytes())
        return _read(path, asammdf, stream, reading)


def _read(path: Path, asammdf: ModuleType, stream: BinaryIO, reading: Reading) -> Recording | ResponseTable:
    try:
        file = asammdf.MDF(stream)
    except Exception as error:  # asammdf raises what its parser happens to stumble over
        _let_go(error)
        raise FileError(f"{path}: cannot be read as MDF: {error}") from None
    with file:
        meta, channels = parse_about(_attached(file))
        return assemble(str(path), list(_tables(file, channels)), meta, reading)


def _let_go(error: Exception) -> None:
    # The destructor of a file that could not be opened prints a traceback of its own, unless it is closed already.
    for frame, _ in walk_tb(error.__traceback__):
        half_made = getattr(frame.f_locals.get("self"), "__dict__", {})
        if "_tempfile" in half_made:
            half_made["_tempfile"].close()
            half_made["_closed"] = True


def write(recording: Recording, path: Path) -> None:
    """Write a recording as one channel group."""
    asammdf, recording = library("asammdf", path), flat(recording)
    signals = [
        asammdf.Signal(samples=channel.values, timestamps=recording.time_s, name=channel.name, unit=channel.unit)
        for channel in recording.channels.values()
    ]
    with asammdf.MDF(version="4.10") as file:
        file.append(signals, comment=recording.name, common_timebase=True)
        file.attach(about(recording).encode(), file_name=_ATTACHMENT, mime="application/json")
        saved = file.save(path, overwrite=True)  # under an ending of its own
        Path(saved).replace(path)


def _attached(file: Any) -> bytes | None:
    if file.version < "4":
        return None  # version 3 has no attachments
    names = [Path(str(attachment.file_name)).name for attachment in file.attachments]
    return bytes(file.extract_attachment(index=names.index(_ATTACHMENT))[0]) if _ATTACHMENT in names else None


def _tables(file: Any, channels: Mapping[str, Mapping[str, Any]]) -> Iterator[Table]:
    for index, group in enumerate(file.groups):
        masters = _MASTERS if file.version >= "4" else (1,)
        if any(c.channel_type in masters and getattr(c, "sync_type", 0) in _NO_TIME for c in group.channels):
            continue
        name = getattr(group.channel_group, "acq_name", "") or f"group {index}"
        for i, channel in enumerate(group.channels):
            if channel.channel_type not in masters:
                yield _table(file, index, i, name, channels)


def _table(file: Any, index: int, i: int, name: str, channels: Mapping[str, Mapping[str, Any]]) -> Table:
    # one at a time: samples marked invalid are dropped, and with them their stamps
    signal = file.get(group=index, index=i)
    said = ""
    if signal.samples.ndim == 1 and signal.samples.dtype.kind not in "biuf":
        raw = file.get(group=index, index=i, raw=True)
        if raw.conversion is not None and raw.samples.ndim == 1 and raw.samples.dtype.kind in "biuf":
            signal, said = _numbers_of_texts(raw)
    column = Column(signal.name, signal.samples, signal.unit, **channels.get(signal.name, {}))
    return Table(name, [column], signal.timestamps, said)


def _numbers_of_texts(raw: Any) -> tuple[Any, str]:
    """A channel of numbers some of which stand for texts: the numbers, without those that a text explains away."""
    named = {
        value: text
        for k in range(getattr(raw.conversion, "val_param_nr", 0) or 0)
        if (value := getattr(raw.conversion, f"val_{k}", None)) is not None
        and (text := raw.conversion.referenced_blocks.get(f"text_{k}"))
    }
    texts = np.isin(raw.samples, list(named)) if named else np.zeros(len(raw.samples), dtype=np.bool_)
    said = f"'{raw.name}' has texts for some of its numbers; the numbers are used"
    if texts.all() or not texts.any():
        return raw, said
    kept = type(raw)(samples=raw.samples[~texts], timestamps=raw.timestamps[~texts], unit=raw.unit, name=raw.name)
    return kept, f"{said}, without the {int(texts.sum())} samples that stand for a text"
