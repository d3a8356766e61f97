"""Universal files, data set 58 (`.uff`, `.unv`), text or binary, read only: signals, or one frequency response."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from hil.errors import FileError
from hil.language.note import Note
from hil.record.extra import library
from hil.record.table.columns import Column, Contents, Table

SUFFIXES = (".uff", ".unv", ".uf")
KIND = "a universal file"
LIBRARIES = ("pyuff.pyuff",)
_FUNCTIONS, _FREQUENCY, _DIRECTIONS = 58, 18, {0: "", 1: "+X", 2: "+Y", 3: "+Z", -1: "-X", -2: "-Y", -3: "-Z"}
_NAMELESS = ("", "NONE")


def contents(path: Path, file: BinaryIO) -> Contents:
    """The functions of an open file: signals at their own times, or a frequency response.

    Raises:
        FileError: it holds no functions, or several over frequency.
    """
    pyuff, content = library("pyuff.pyuff", path), file.read()
    vars(pyuff)["open"] = lambda *_: io.BytesIO(content)  # this process opens nothing

    class Opened(pyuff.UFF):  # type: ignore[misc, name-defined]
        def file_exists(self) -> bool:
            return True

    opened = Opened(path.name)
    at = [k for k, kind in enumerate(opened.get_set_types()) if int(kind) == _FUNCTIONS]
    found = [opened.read_sets(k) for k in at]
    if not found:
        raise FileError(f"{path}: cannot be read as a universal file: it holds no functions (data sets {_FUNCTIONS})")
    over = [one for one in found if int(one["abscissa_spec_data_type"]) == _FREQUENCY or np.iscomplexobj(one["data"])]
    if not over:
        return _signals(found), ""
    if len(over) > 1:
        raise FileError(f"{path}: holds {len(over)} functions of frequency; export one frequency response")
    values = np.asarray(over[0]["data"], dtype=np.complex128)
    parts = [Column("re", values.real, "1"), Column("im", values.imag, "1")]
    frequency = Column("frequency", np.asarray(over[0]["x"], dtype=np.float64), "Hz")
    return [Table(path.stem, [frequency, *parts], assumed=_unit_note(over[0]))], ""


def _unit_note(one: Mapping[str, Any]) -> str:
    """What is said of the unit that the file states for a response; empty where it states none."""
    above, below = (str(one[f"{axis}_axis_units_lab"]).strip() for axis in ("ordinate", "orddenom"))
    stated = "" if above.upper() in _NAMELESS else above if below.upper() in _NAMELESS else f"{above} / {below}"
    return (
        Note("the file states the gain in {unit}; taken as 1, --unit re=… says otherwise", unit=stated)
        if stated
        else ""
    )


def _signals(found: Sequence[Mapping[str, Any]]) -> list[Table]:
    names = [str(one["id1"]).strip() for one in found]
    counts = Counter(names)
    tables = []
    for name, one in zip(names, found, strict=True):
        if name.upper() in _NAMELESS or counts[name] > 1:
            name = f"{one['rsp_node']}{_DIRECTIONS.get(int(one['rsp_dir']), '')}"
        unit = str(one["ordinate_axis_units_lab"]).strip()
        values = np.asarray(one["data"], dtype=np.float64)
        column = Column(name, values, "" if unit.upper() in _NAMELESS else unit)
        tables.append(Table(name, [column], np.asarray(one["x"], dtype=np.float64)))
    return tables
