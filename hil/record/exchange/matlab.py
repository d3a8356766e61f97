"""MATLAB `.mat`: `time` and one column vector per channel; `channels` says which has which name and unit.

Also read: plain vectors beside `t` or a sampling interval (`Ts`, `fs`), structs, Simulink's structure with
time, results of Dymola and OpenModelica, and version 7.3, which is HDF5 inside.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from hil.errors import FileError
from hil.record.recording import Recording
from hil.record.table.about import about
from hil.record.table.columns import Column, Contents, Table, by_length, even_table, from_matrix

SUFFIXES = (".mat",)
KIND = "MAT"
LIBRARIES = ("scipy.io",)
BEGINNING = rb"MATLAB 5\.0|.{20}Aclass"
_INDEX, _ABOUT = "channels", "valve_hil"
_FIELDS = ("variable", "name", "unit")
_MODELICA_UNIT = re.compile(r"\[(?P<unit>[^\[\]|;:#]+)[^\[\]]*\][^\[\]]*$")
_MOST_BYTES = 1 << 31
_LONGEST_NAME = 63


def contents(path: Path, file: BinaryIO) -> Contents:
    """The tables of an open file; one of version 7.3 is read as HDF5, by its first bytes."""
    from scipy.io import loadmat

    content = loadmat(file, simplify_cells=True)  # type: ignore[arg-type]  # an open file is taken too
    if "Aclass" in content:
        return [_of_modelica(path, content)], ""
    about = str(content.pop(_ABOUT, ""))
    known = _index(content)
    signals = {key: value for key, value in content.items() if not key.startswith("__") and key != _INDEX * bool(known)}
    return list(_tables(path.stem, signals, known)), about


def _of_modelica(path: Path, content: Mapping[str, Any]) -> Table:
    """The variables of a simulation of a Modelica tool, under their own names; what never changes is left out.

    `name` and `description` hold a text a variable; `dataInfo` its matrix, and in that its row, negative where the
    variable is minus that row. Each matrix begins with the time, and holds two rows where the model jumps.
    """
    kind = ["".join(row).strip() for row in _characters(content["Aclass"])]
    if kind[:2] != ["Atrajectory", "1.1"]:
        raise FileError(
            f"{path}: is a file of {' '.join(kind[:2])}; results of a simulation (Atrajectory 1.1) are read"
        )
    transposed = kind[3:] == ["binTrans"]
    names, texts = (
        ["".join(row).strip() for row in (made.T if transposed else made)]
        for made in (_characters(content[key]) for key in ("name", "description"))
    )
    info = np.atleast_2d(content["dataInfo"] if transposed else content["dataInfo"].T)
    places = info[:2].T.astype(int).tolist()
    blocks = {block for block, _ in places if block > 0}
    rows = {block: np.atleast_2d(content[f"data_{block}"] if transposed else content[f"data_{block}"].T)
            for block in blocks}  # fmt: skip
    longest = max(rows, key=lambda block: rows[block].shape[1])
    time_s = rows[longest][0].astype(np.float64)
    last = np.append(np.diff(time_s) > 0.0, True)
    stated = [match["unit"].strip() if (match := _MODELICA_UNIT.search(text)) else "" for text in texts]
    varying = [
        place for place in zip(names, stated, places, strict=True) if place[2][0] == longest and abs(place[2][1]) > 1
    ]
    columns = [
        Column(name, np.sign(row) * rows[longest][abs(row) - 1][last], unit or "1") for name, unit, (_, row) in varying
    ]
    bare, left = sum(not unit for _, unit, _ in varying), np.count_nonzero(~last)
    notes = [f"no unit is stated for {bare} of {len(varying)} variables; taken as 1"] * bool(bare)
    notes += [f"{left} rows before a jump at the same time are left out"] * bool(left)
    return Table(path.stem, columns, time_s[last], "; ".join(notes))


def _characters(texts: NDArray[np.str_]) -> NDArray[np.str_]:
    """A matrix of characters from texts of one length, shape (texts, characters)."""
    texts = np.atleast_1d(texts)
    return texts.view("U1").reshape(len(texts), -1)


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
    stated = _name_and_unit(struct)
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


def _name_and_unit(struct: Mapping[str, Any]) -> tuple[str, str]:
    """Name and unit that a structure states of its one signal, as those of Simulink and dSPACE do."""
    texts = {key.casefold(): value for key, value in struct.items() if isinstance(value, str)}
    return texts.get("name") or texts.get("label", ""), texts.get("unit", "")
