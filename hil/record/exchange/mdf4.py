"""MDF (ASAM), the format of vehicle and machine measurement: `.mf4`; `.mdf` and `.dat` of version 3 are read too.

Channel groups with time bases of their own are joined (see `assemble`).
"""

from __future__ import annotations

from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from hil.errors import FileError
from hil.record.extra import library
from hil.record.recording import Recording
from hil.record.table.about import KEY, about
from hil.record.table.columns import Column, Contents, Table

SUFFIXES = (".mf4", ".mdf")
KIND = "MDF"
LIBRARIES = ("asammdf",)
BEGINNING = rb"MDF     |UnFinMF "
_ATTACHMENT = f"{KEY}.json"
_FINISHED, _UNFINISHED = b"MDF     ", b"UnFinMF "
_MASTERS = (2, 3)  # channel types "master" and "virtual master"
_EMBEDDED = 1  # flag of an attachment
_NO_TIME = (2, 3, 4)  # synchronised over angle, distance or index


def contents(path: Path, file: BinaryIO) -> Contents:
    """The tables of an open file.

    Raises:
        FileError: not MDF, or what it knows besides lies in another file.
    """
    asammdf = library("asammdf", path)
    for module in (asammdf.blocks.mdf_v3, asammdf.blocks.mdf_v4):
        module.NamedTemporaryFile = _Scratch  # here no file can be made
    beginning = file.read(8)
    if beginning not in (_FINISHED, _UNFINISHED):
        raise FileError(f"{path}: cannot be read as MDF: it does not begin with 'MDF'")
    file.seek(0)
    # An unfinished file is mended while it is read: in memory, not where it lies.
    with asammdf.MDF(file if beginning == _FINISHED else BytesIO(file.read())) as opened:
        return list(_tables(opened)), _attached(path, opened)


class _Scratch(BytesIO):
    """What asammdf keeps a file for, in memory."""

    name = ""

    def __init__(self, **_: Any) -> None:
        super().__init__()


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
        saved = file.save(path, overwrite=True)  # under an ending of its own
        Path(saved).replace(path)


def _attached(path: Path, file: Any) -> str:
    if file.version < "4":
        return ""  # version 3 has no attachments
    names = [Path(str(attachment.file_name)).name for attachment in file.attachments]
    if _ATTACHMENT not in names:
        return ""
    index = names.index(_ATTACHMENT)
    if not file.attachments[index].flags & _EMBEDDED:
        raise FileError(f"{path}: attachment '{_ATTACHMENT}' lies in another file; only an embedded one is read")
    return bytes(file.extract_attachment(index=index)[0]).decode(errors="replace")


def _tables(file: Any) -> Iterator[Table]:
    for index, group in enumerate(file.groups):
        masters = _MASTERS if file.version >= "4" else (1,)
        if any(c.channel_type in masters and getattr(c, "sync_type", 0) in _NO_TIME for c in group.channels):
            continue
        name = getattr(group.channel_group, "acq_name", "") or f"group {index}"
        for i, channel in enumerate(group.channels):
            if channel.channel_type not in masters:
                yield _table(file, index, i, name)


def _table(file: Any, index: int, i: int, name: str) -> Table:
    # one at a time: samples marked invalid are dropped, and with them their stamps
    signal = file.get(group=index, index=i)
    note = ""
    if signal.samples.ndim == 1 and signal.samples.dtype.kind not in "biuf":
        raw = file.get(group=index, index=i, raw=True)
        if raw.conversion is not None and raw.samples.ndim == 1 and raw.samples.dtype.kind in "biuf":
            signal, note = _numbers_of_texts(raw)
    return Table(name, [Column(signal.name, signal.samples, signal.unit)], signal.timestamps, note)


def _numbers_of_texts(raw: Any) -> tuple[Any, str]:
    """A channel of numbers some of which stand for texts: the numbers, without those that a text explains away."""
    named = {
        value: text
        for k in range(getattr(raw.conversion, "val_param_nr", 0) or 0)
        if (value := getattr(raw.conversion, f"val_{k}", None)) is not None
        and (text := raw.conversion.referenced_blocks.get(f"text_{k}"))
    }
    texts = np.isin(raw.samples, list(named)) if named else np.zeros(len(raw.samples), dtype=np.bool_)
    note = f"'{raw.name}' has texts for some of its numbers; the numbers are used"
    if texts.all() or not texts.any():
        return raw, note
    kept = type(raw)(samples=raw.samples[~texts], timestamps=raw.timestamps[~texts], unit=raw.unit, name=raw.name)
    return kept, f"{note}, without the {int(texts.sum())} samples that stand for a text"
