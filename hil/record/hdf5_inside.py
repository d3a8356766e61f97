"""Whether all of an HDF5 file lies in it: looked at before a sample is read."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hil.errors import FileError
from hil.untrusted import MOST_LEVELS, most_unpacked, unpacked_allowed

_MOST_ITEMS = 100_000


def check_inside(h5py: Any, path: Path, file: Any, stored_bytes: int) -> None:
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


_ALLOWED = "a recording has all of its samples in its own file"


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
