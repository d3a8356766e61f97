"""HDF5: one dataset per channel with its unit as an attribute; `time` in seconds.

Also read: any file whose datasets are signals beside a time, in groups or compound tables, units in headings
or in an attribute `unit` or `units`.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from hil.errors import FileError, reason
from hil.record.extra import library
from hil.record.recording import Recording
from hil.record.table.about import KEY, about
from hil.record.table.columns import Column, Contents, Table, by_length, even_table, from_matrix, numbers
from hil.record.table.heading import interval_of
from hil.untrusted import MOST_LEVELS, most_unpacked, unpacked_allowed

SUFFIXES = (".h5", ".hdf5", ".hdf")
KIND = "HDF5"
LIBRARIES = ("h5py",)
BEGINNING = rb"\x89HDF\r\n\x1a\n|MATLAB 7\.3"  # version 7.3 of a MAT file is HDF5 behind 512 bytes
_MATLAB_INSIDES = ("#refs#", "#subsystem#")
_FILLED, _PACKED = ("_FillValue", "missing_value"), ("scale_factor", "add_offset")  # of NetCDF's conventions
_MOST_ITEMS = 100_000
_ALLOWED = "a recording has all of its samples in its own file"
_UNIT_KEYS = ("unit", "units", "Unit", "Units", "unit_string")


def contents(path: Path, file: BinaryIO) -> Contents:
    """The tables of an open file.

    Raises:
        FileError: not HDF5, or a part of it leads out of it, back into itself, or beyond what is read; names the part.
    """
    h5py = library("h5py", path)
    try:
        with h5py.File(file, "r") as opened:
            _check_inside(h5py, path, opened, os.fstat(file.fileno()).st_size)
            return list(_tables(opened, path.stem)), _text(opened[KEY][()]) if KEY in opened else ""
    except (OSError, RuntimeError, KeyError) as error:
        raise FileError(f"{path}: cannot be read as HDF5: {reason(error)}") from None


def write(recording: Recording, path: Path) -> None:
    """Write a recording."""
    h5py = library("h5py", path)
    with h5py.File(path, "w", track_order=True) as file:
        file[KEY] = about(recording)
        file.create_dataset("time", data=recording.time_s).attrs["unit"] = "s"
        for channel in recording.channels.values():
            safe = channel.name.replace("/", "\u2215").replace(".", "\u2024")  # HDF5 paths: no slash, no lone dot
            name = safe if safe not in file else f"{safe} {len(file)}"
            dataset = file.create_dataset(name, data=channel.values)
            dataset.attrs["name"], dataset.attrs["unit"] = channel.name, channel.unit


def _tables(group: Any, name: str) -> Iterator[Table]:
    """The tables of a group and of all groups in it."""
    columns: list[Column] = []
    stated = numbers(group.attrs)
    for key, item in _items(group):
        if _is_text(item):
            continue
        if hasattr(item, "items"):
            yield from () if key in _MATLAB_INSIDES else _tables(item, key)
        elif item.dtype.names:
            values = item[...]
            yield even_table(key, [Column(field, values[field]) for field in item.dtype.names], stated)
        elif item.size == 1 and item.dtype.kind in "iuf":
            stated[key] = float(item[...].item())
        else:
            found = _columns(key, item)
            own = numbers(item.attrs)
            if any(interval_of(key, value) for key, value in own.items()):  # a channel that states a rate of its own
                yield even_table(key, found, own)
            else:
                columns += found
    yield from (even_table(name, found, stated) for found in by_length(columns))


def _items(group: Any) -> Iterator[tuple[str, Any]]:
    # Whoever calls a dataset "flow [l/min]" gets a group "flow [l" with a dataset "min]" in it.
    for key in group:
        item = group.get(key)
        if item is None or (hasattr(item, "items") and not _is_hard(group, key)):
            continue  # a link that leads nowhere, or to a group that is read where it stands
        if hasattr(item, "items") and (key.count("[") > key.count("]") or key.count("(") > key.count(")")):
            yield from ((f"{key}/{inner}", child) for inner, child in _items(item))
        else:
            yield key, item


def _is_hard(group: Any, key: str) -> bool:
    return type(group.get(key, getlink=True)).__name__ == "HardLink"


def _columns(key: str, dataset: Any) -> list[Column]:
    name = _text(dataset.attrs.get("name")) or key
    unit = next((_text(dataset.attrs[key]) for key in _UNIT_KEYS if key in dataset.attrs), "").partition(" since ")[0]
    values, stated = dataset[...], numbers(dataset.attrs)
    for fill in (stated[key] for key in _FILLED if key in stated):
        values = np.where(values == fill, np.nan, values)
    if not stated.keys().isdisjoint(_PACKED):
        values = values * stated.get("scale_factor", 1.0) + stated.get("add_offset", 0.0)
    return from_matrix(name, values, unit)


def _is_text(item: Any) -> bool:
    return _text(item.attrs.get("MATLAB_class")) in ("char", "cell", "function_handle")


def _text(value: Any) -> str:
    return value.decode() if isinstance(value, bytes) else str(value) if isinstance(value, str) else ""


def _check_inside(h5py: Any, path: Path, file: Any, stored_bytes: int) -> None:
    """Look at every link and every dataset of an open file of so many bytes.

    Raises:
        FileError: a part of it lies in another file, leads back into itself, or is larger than what is read.
    """
    total = 0
    for count, (name, kind, item) in enumerate(_linked(h5py, path, file["/"], "", set())):
        if count >= _MOST_ITEMS:
            raise FileError(f"{path}: more than {_MOST_ITEMS} groups and datasets; so many are read")
        if kind is h5py.ExternalLink:
            raise FileError(f"{path}: '{name}' is a link to another file ('{item.filename}'); {_ALLOWED}")
        if isinstance(item, h5py.Dataset):
            _check_stored_here(h5py, path, name, item)
            size = item.dtype.itemsize * int(item.size or 0)
            total += size
            if total > most_unpacked(stored_bytes):
                raise FileError(
                    f"{path}: dataset '{name}' says that it holds {item.size} values ({size / 1e9:.3g} GB); "
                    f"{unpacked_allowed(stored_bytes)}"
                )


def _linked(
    h5py: Any, path: Path, group: Any, above: str, seen: set[int], levels: int = 0
) -> Iterator[tuple[str, Any, Any]]:
    """(name, kind of link, what it leads to) of all that a group holds; the link itself where it is not a hard one."""
    if levels >= MOST_LEVELS:
        raise FileError(f"{path}: groups more than {MOST_LEVELS} deep; a recording has at most so many")
    place = h5py.h5o.get_info(group.id).addr
    if place in seen:
        raise FileError(f"{path}: group '{above}' is one that stands elsewhere in the file too; each stands once")
    seen.add(place)
    for name in group:
        full = f"{above}/{name}"
        link = group.get(name, getlink=True)
        if not isinstance(link, h5py.HardLink):
            yield full, type(link), link
            continue
        item = group[name]
        yield full, h5py.HardLink, item
        if isinstance(item, h5py.Group):
            yield from _linked(h5py, path, item, full, seen, levels + 1)


def _check_stored_here(h5py: Any, path: Path, name: str, dataset: Any) -> None:
    made = dataset.id.get_create_plist()
    if made.get_external_count():
        outside = made.get_external(0)[0].decode(errors="replace")
        raise FileError(f"{path}: dataset '{name}' has its samples in another file ('{outside}'); {_ALLOWED}")
    if made.get_layout() == h5py.h5d.VIRTUAL:
        sources = dict.fromkeys(made.get_virtual_filename(i) for i in range(made.get_virtual_count()))
        raise FileError(f"{path}: dataset '{name}' is made of other datasets ('{', '.join(sources)}'); {_ALLOWED}")
