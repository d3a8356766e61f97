"""The first description of a device, from the table, EDS or DBC of its maker, with every gap marked."""

from __future__ import annotations

from pathlib import Path

from hil.description.first_dbc import from_dbc
from hil.description.first_eds import from_eds
from hil.description.first_table import from_table
from hil.description.gaps import GAP
from hil.errors import FileError, SettingError


def first_description(path: Path) -> str:
    """The text of a first description; what the file does not say stands in it as a gap.

    Raises:
        FileError: the file cannot be read as what it is.
        SettingError: it is of another kind.
    """
    made = {".csv": from_table, ".tsv": from_table, ".txt": from_table, ".eds": from_eds, ".dcf": from_eds,
            ".dbc": from_dbc}.get(path.suffix.lower())  # fmt: skip
    if made is None:
        raise SettingError(f"{path}: a register table (.csv), an EDS or DCF (.eds, .dcf) or a DBC file (.dbc) is read")
    if not path.is_file():
        raise FileError(f"{path}: no such file")
    return "\n".join(made(path)).rstrip() + "\n"


def gaps(text: str) -> int:
    """How many gaps a description still has."""
    return text.count(GAP)
