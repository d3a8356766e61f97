"""Descriptions by name, or by the path of their file."""

from __future__ import annotations

from pathlib import Path

from hil.catalog import file_of, files_of
from hil.errors import FileError, UnknownNameError

_GROUPS = ("hil.drivers", "hil.sim_devices")
_FOLDER = "descriptions"


def descriptions() -> dict[str, Path]:
    """Every description that installed packages bring along in a folder `descriptions`, by name."""
    return files_of(_GROUPS, _FOLDER, "*.toml")


def description_file(model: str) -> Path:
    """The file of a model: a path that ends with `.toml`, or the name of one that is installed.

    Raises:
        FileError: there is no such file.
        UnknownNameError: no package has it.
    """
    if model.endswith(".toml"):
        if not Path(model).is_file():
            raise FileError(f"{model}: no such description; it is looked for beside the bench file")
        return Path(model)
    installed = file_of(_GROUPS, _FOLDER, f"{model}.toml")
    if installed is None:
        raise UnknownNameError("description", model, descriptions())
    return installed
