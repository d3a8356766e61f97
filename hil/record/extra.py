"""Libraries that not every installation has."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType

from hil.errors import FileError
from hil.extras import lacking


def library(name: str, path: Path) -> ModuleType:
    """The library that a file's format needs.

    Raises:
        FileError: it is not installed; says how to get it.
    """
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        asked = path.with_name(path.name.removeprefix(".part-"))  # of a file that is being written
        raise FileError(f"{asked}: '{path.suffix}' files need {lacking(error.name or name)}") from None
