"""MATLAB `.mat`: `time` and one column vector per channel; `channels` says which has which name and unit.

Also read: plain vectors beside `t` or a sampling interval (`Ts`, `fs`), structs, Simulink's structure with
time, and version 7.3, which is HDF5 inside.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from hil.errors import FileError
from hil.record.about import about
from hil.record.columns import Column, Contents, Table, by_length, even_table, from_matrix
from hil.record.recording import Recording

SUFFIXES = (".mat",)
KIND = "MAT"
LIBRARIES = ("scipy.io",)
BEGINNING = rb"MATLAB 5\.0"
_INDEX, _ABOUT = "channels", "valve_hil"
_FIELDS = ("variable", "name", "unit")
_MOST_BYTES = 1 << 31
_LONGEST_NAME = 63


def contents(path: Path, file: BinaryIO) -> Contents:
    """The tables of an open file; one of version 7.3 is read as HDF5, by its first bytes."""
    from scipy.io import loadmat

    content = loadmat(file, simplify_cells=True)  # type: ignore[arg-type]  # an open file is taken too
    about = str(content.pop(_ABOUT, ""))
    known = _index(content)
    signals = {key: value for key, value in content.items() if not key.startswith("__") and key != _INDEX * bool(known)}
    return list(_tables(path.stem, signals, known)), about


def write(recording: Recording, path: Path) -> None:
    """Write a recording in version 5.

    Raises:
        FileError: too long for this version.
    """
    from scipy.io import savemat

    if recording.time_s.nbytes >= _MOST_BYTES:
        raise FileError(f"{path}: {len(recording)} samples; MATLAB 5 holds 2 GB per channel at most, write .h5 instead")
    variables: dict[str, Any] = {"time": recording.time_s}
    index = []
    for channel in recording.channels.values():
        name = _variable(channel.name, variables)
        variables[name] = channel.values
        index.append((name, channel.name, channel.unit))
    structs = np.array(index, dtype=[(field, object) for field in _FIELDS])
    savemat(path, {**variables, _INDEX: structs, _ABOUT: about(recording)}, long_field_names=True, oned_as="column")


def _variable(name: str, taken: Mapping[str, Any]) -> str:
    safe = re.sub(r"[^0-9A-Za-z]+", "_", name).strip("_")[:_LONGEST_NAME]
    safe = safe if safe[:1].isalpha() else f"channel_{safe}"[:_LONGEST_NAME]
    if safe in taken or safe in (_INDEX, _ABOUT):
        safe = f"{safe[: _LONGEST_NAME - 4]}_{len(taken)}"
    return safe


def _index(content: Mapping[str, Any]) -> dict[str, tuple[str, str]]:
    entries = content.get(_INDEX, [])
    entries = [entries] if isinstance(entries, dict) else entries
    if not all(isinstance(entry, dict) and set(entry) == set(_FIELDS) for entry in entries):
        return {}
    return {entry["variable"]: (str(entry["name"]), str(entry["unit"])) for entry in entries}


def _tables(name: str, struct: Mapping[str, Any], known: Mapping[str, tuple[str, str]]) -> Iterator[Table]:
    columns: list[Column] = []
    numbers: dict[str, float] = {}
    stated = _stated(struct)
    arrays = [value for value in struct.values() if isinstance(value, np.ndarray) and value.size]
    for key, value in struct.items():
        if isinstance(value, dict):
            yield from _tables(key, value, known)
        elif isinstance(value, list):
            for i, item in enumerate(value, 1):
                yield from _tables(f"{key} {i}", item if isinstance(item, dict) else {}, known)
        elif isinstance(value, int | float):
            numbers[key] = float(value)
        elif isinstance(value, np.ndarray) and value.size:
            label, unit = known.get(key, stated if len(arrays) == 1 else ("", ""))
            columns += from_matrix(label or key, value, unit)
    yield from (even_table(name, found, numbers) for found in by_length(columns))


def _stated(struct: Mapping[str, Any]) -> tuple[str, str]:
    """Name and unit that a structure states of its one signal, as those of Simulink and dSPACE do."""
    texts = {key.casefold(): value for key, value in struct.items() if isinstance(value, str)}
    return texts.get("name") or texts.get("label", ""), texts.get("unit", "")
