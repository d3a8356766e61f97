"""Libraries that not every installation has."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType

from hil.errors import FileError
from hil.extras import is_installed, lacking


def library(name: str, path: Path) -> ModuleType:
    """The library that a file's format needs.

    Raises:
        FileError: it is not installed; says how to get it.
    """
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        raise _missing(error.name or name, path) from None


def check_installed(name: str, path: Path) -> None:
    """Raise `FileError` where the library that a file's format needs is not installed; nothing is imported."""
    if not is_installed(package := name.partition(".")[0]):
        raise _missing(package, path)


def _missing(name: str, path: Path) -> FileError:
    asked = path.with_name(path.name.removeprefix(".part-"))  # of a file that is being written
    return FileError(f"{asked}: '{path.suffix}' files need {lacking(name)}")
