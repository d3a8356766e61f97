"""Bench files by path, or by the bare name of one that an installed package brings along."""

from __future__ import annotations

from pathlib import Path

from hil.catalog import files_of
from hil.errors import FileError, UnknownNameError

_GROUPS = ("hil.sim_devices", "hil.drivers")


def find_bench(name: str) -> Path:
    """The bench file of that path or bare name (`brevini-hpv41`).

    Packages of drivers and simulated devices may bring benches in a folder `benches`.

    Raises:
        FileError: a path where nothing is.
        UnknownNameError: a bare name that no package has.
    """
    path = Path(name)
    if path.is_file():
        return path
    if path.suffix == ".toml" or len(path.parts) > 1:
        raise FileError(f"{path}: no such bench file")
    known = benches()
    if name not in known:
        raise UnknownNameError("bench", name, known)
    return known[name]


def benches() -> dict[str, Path]:
    """Every bench that installed packages bring along, by name."""
    return files_of(_GROUPS, "benches", "*.toml")


def own_bench(path: Path) -> None:
    """Refuse to change the bench of a package: another version of the package would undo it.

    Raises:
        FileError: it is a package's; the message says how to have one's own.
    """
    if path.resolve() in (installed.resolve() for installed in benches().values()):
        name = path.stem
        raise FileError(
            f'{name}: the bench of a package is not changed; change a file of yours with based_on = "{name}"'
        )
