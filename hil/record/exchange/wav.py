"""WAV, sound files of recorders and sound cards, read only; whole numbers are shares of full scale."""

from __future__ import annotations

import io
import warnings
from pathlib import Path
from typing import BinaryIO

import numpy as np

from hil.language.note import Note
from hil.record.extra import library
from hil.record.table.columns import Column, Contents, Table

SUFFIXES = (".wav",)
KIND = "WAV"
LIBRARIES = ("scipy.io.wavfile",)


def contents(path: Path, file: BinaryIO) -> Contents:
    """The channels of an open file, called by their numbers."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of chunks that say something about the recording
        rate_hz, values = library("scipy.io.wavfile", path).read(io.BytesIO(file.read()))
    kind = values.dtype
    note = Note("even time base from the sample rate, {rate_hz:g} Hz", rate_hz=float(rate_hz))
    if kind.kind in "iu":
        middle = 128.0 if kind.kind == "u" else 0.0
        values = (values - middle) / 2.0 ** (8 * kind.itemsize - 1)
        note = Note("{note}; values are shares of full scale", note=note)
    channels = values.astype(np.float64).reshape(len(values), -1).T
    columns = [Column(f"channel {number}", channel, "1") for number, channel in enumerate(channels, 1)]
    return [Table(path.stem, columns, np.arange(len(values), dtype=np.float64) / rate_hz, note)], ""
