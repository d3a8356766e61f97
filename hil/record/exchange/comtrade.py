"""COMTRADE (IEEE C37.111, IEC 60255-24), read only: a `.cfg` and the `.dat` beside it, or both in one `.cff`."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import BinaryIO

import numpy as np

from hil.errors import FileError
from hil.record.extra import library
from hil.record.gathered import gathered, parts_of, text_of, whole
from hil.record.table.columns import Column, Contents, Table

SUFFIXES = (".cfg", ".cff")
KIND = "COMTRADE"
LIBRARIES = ("comtrade",)
CHANNELS = re.compile(rb"[^\n]*\n\s*\d+\s*,\s*\d+\s*A\s*,\s*\d+\s*D", re.IGNORECASE)
"""How a `.cfg` begins: the station, then so many channels, analogue and digital."""


def files_of(path: Path, file: BinaryIO) -> BinaryIO:
    """The channels' description and their samples.

    Raises:
        FileError: it describes no channels, or its samples are not beside it.
    """
    described = file.read()
    if path.suffix.lower() == ".cff":
        return gathered(described)
    if not CHANNELS.match(described):
        raise FileError(f"{path}: cannot be read as COMTRADE: its second line counts no channels")
    for ending in (".dat", ".DAT"):
        if (samples := path.with_suffix(ending)).is_file():
            return gathered(described, whole(samples))
    raise FileError(f"{path}: describes a COMTRADE recording whose samples, {path.stem}.dat, are not beside it")


def contents(path: Path, file: BinaryIO) -> Contents:
    """The channels of a recording, analogue and digital."""
    comtrade = library("comtrade", path)
    described, *samples = parts_of(file)
    read = comtrade.Comtrade(ignore_warnings=True, use_double_precision=True)
    if samples:
        text = text_of(described)
        is_text = any(line.strip().upper() == "ASCII" for line in text.splitlines())
        read.read(text, text_of(samples[0]) if is_text else samples[0])
    else:
        vars(comtrade)["open"] = lambda *_: io.BytesIO(described)  # this process opens nothing
        read.load(path.name)
    columns = [
        Column(channel.name.strip(), np.array(values), channel.uu.strip())
        for channel, values in zip(read.cfg.analog_channels, read.analog, strict=True)
    ]
    columns += [
        Column(channel.name.strip(), np.array(values, dtype=np.float64), "1")
        for channel, values in zip(read.cfg.status_channels, read.status, strict=True)
    ]
    return [Table(path.stem, columns, np.array(read.time))], ""
