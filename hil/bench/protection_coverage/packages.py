"""Packages that the drivers of a bench need."""

from __future__ import annotations

from collections.abc import Iterator

from hil.bench.read import BenchFile
from hil.errors import SettingError
from hil.extras import is_installed, lacking


def packages_lacking(file: BenchFile) -> Iterator[str]:
    """A sentence for each package that a driver of the bench needs and that is not there."""
    for name, device in file.devices.items():
        needs = getattr(device.module, "needs", lambda _settings: ())
        for package in needs(device.settings):
            if not is_installed(package):
                driver = file.bench.devices[name].driver
                yield f"device '{name}': driver '{driver}' needs {lacking(package)}"


def check_packages(file: BenchFile) -> None:
    """Raise `SettingError` if a package is missing that the bench needs; nothing was opened."""
    for text in packages_lacking(file):
        raise SettingError(f"{file.path}: {text}")
