"""Names to modules for drivers, devices, procedures, plants and effects.

An entry point names a *package*; every public module in it is an entry under its file name. The project's
own packages are found by the very mechanism that a stranger's package uses. Listing reads files as text
and imports nothing heavy.
"""

from __future__ import annotations

import ast
import importlib
import importlib.util
import pkgutil
import sys
import tokenize
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, EntryPoints, entry_points
from pathlib import Path
from types import ModuleType
from typing import Literal, cast

from hil.errors import FileError, UnknownNameError
from hil.extras import lacking

Kind = Literal["drivers", "devices", "procedures", "plants", "effects"]
KINDS: tuple[Kind, ...] = ("drivers", "devices", "procedures", "plants", "effects")
_GROUP = {"devices": "hil.sim_devices"}
_SINGULAR = {"devices": "device", "drivers": "driver", "procedures": "procedure", "plants": "plant",
             "effects": "effect"}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Entry:
    """One installed thing: its name, the module that holds it, and the file of that module."""

    kind: Kind
    name: str
    module: str
    path: Path

    @property
    def summary(self) -> str:
        """The first line of the module's docstring, read without importing it, nor more of it than that."""
        with self.path.open(encoding="utf-8") as file:
            for token in tokenize.generate_tokens(file.readline):
                if token.type == tokenize.STRING:
                    return str(ast.literal_eval(token.string)).strip().split("\n", 1)[0]
                if token.type not in (tokenize.COMMENT, tokenize.NL):
                    break
        return ""

    def load(self) -> ModuleType:
        """The imported module.

        Raises:
            FileError: the module needs a package that is not installed (its name is in the message), or throws.
        """
        try:
            return importlib.import_module(self.module)
        except (Exception, SystemExit) as error:
            missing = error.name or "?" if isinstance(error, ModuleNotFoundError) else ""
            if missing and missing.split(".")[0] != self.module.split(".")[0]:
                raise FileError(f"{_SINGULAR[self.kind]} '{self.name}' needs {lacking(missing)}") from error
            raise FileError(
                f"{_SINGULAR[self.kind]} '{self.name}' ({self.path}) cannot be loaded: {type(error).__name__}: {error}"
            ) from error


@cache
def entries(kind: Kind) -> tuple[Entry, ...]:
    """Every installed entry of one kind, sorted by name."""
    found: dict[str, Entry] = {}
    group = _GROUP.get(kind, f"hil.{kind}")
    for point in sorted(_points(group), key=lambda point: (point.name != "hil", point.name)):
        if point.name == "hil":
            _check_not_hidden(point.value)
        for entry in _package_entries(kind, point):
            if entry.name in found and found[entry.name].module != entry.module:
                raise FileError(
                    f"{_SINGULAR[kind]} '{entry.name}' is provided twice: "
                    f"{found[entry.name].module} and {entry.module}; rename one of the files"
                )
            found[entry.name] = entry
    return tuple(found[name] for name in sorted(found))


def find(kind: Kind, name: str) -> Entry:
    """The entry of that name; `-` and `_` are the same.

    Raises:
        UnknownNameError: nothing of that name is installed; the message lists what is.
    """
    wanted = _entry_name(kind, name)
    for entry in entries(kind):
        if entry.name == wanted:
            return entry
    raise UnknownNameError(_SINGULAR[kind], name, (entry.name for entry in entries(kind)))


def packages() -> tuple[frozenset[str], frozenset[str]]:
    """Packages of this program, and those that somebody else has installed beside it, by what they plug in."""
    points = [point for kind in KINDS for point in _points(_GROUP.get(kind, f"hil.{kind}"))]
    own = frozenset({"hil", *(point.value.partition(".")[0] for point in points if point.name == "hil")})
    return own, frozenset(point.value.partition(".")[0] for point in points) - own


def files_of(groups: Iterable[str], folder: str, pattern: str) -> dict[str, Path]:
    """Files that installed packages bring along in a folder of that name, by their stem: benches, models."""
    found = {file.stem: file for home in _folders(groups, folder) for file in sorted(home.glob(pattern))}
    return dict(sorted(found.items()))


def file_of(groups: Iterable[str], folder: str, name: str) -> Path | None:
    """The one among `files_of` of that whole name: looked for, where all of them would be listed for it."""
    found = None
    for file in (home / name for home in _folders(groups, folder)):
        with suppress(OSError):  # of a name that is longer than any file's
            found = file if file.name == name and file.is_file() else found
    return found


def _folders(groups: Iterable[str], folder: str) -> Iterator[Path]:
    return (Path(home, folder) for group in groups for home in _homes_of(tuple(sys.path), group))


@cache
def _homes_of(path: tuple[str, ...], group: str) -> tuple[str, ...]:
    """Where the packages of a group are installed."""
    specs = (importlib.util.find_spec(point.value) for point in _points_of(path, group))
    return tuple(home for spec in specs for home in (spec and spec.submodule_search_locations) or ())


def models() -> dict[str, Path]:
    """Every model file that packages of plants bring along in a folder `models`, by name."""
    return files_of(["hil.plants"], "models", "*.json")


def base_plant(name: str) -> str:
    """The plant behind what a bench file names: a plant, an installed model, or a model file.

    A model file that cannot be read is of no known plant: empty.
    """
    path = Path(name) if name.endswith(".json") else models().get(name)
    if path is None:
        return _entry_name("plants", name)
    from hil.untrusted import read_json

    try:
        content = read_json(path)
    except (OSError, FileError):
        return ""
    return _entry_name("plants", str(content.get("plant") or "")) if isinstance(content, dict) else ""


def tables() -> dict[str, Path]:
    """Every table of a frequency response that packages of plants bring along in a folder `tables`, by name."""
    return files_of(["hil.plants"], "tables", "*.csv")


def _points(group: str) -> EntryPoints:
    return _points_of(tuple(sys.path), group)


@cache
def _points_of(path: tuple[str, ...], group: str) -> EntryPoints:
    """Those of one group: asked for often, and looked for among thousands."""
    return _all_points(path).select(group=group)


@cache
def _all_points(_path: tuple[str, ...]) -> EntryPoints:
    """Those of everything installed on a path: asked once, since each asking opens a file of every package."""
    return cast("EntryPoints", entry_points())  # Python 3.11 calls it by another name, and it can do the same


def _check_not_hidden(package: str) -> None:
    """Refuse to list somebody else's folder as a package of this program: they lie beside each other."""
    home = Path(__file__).resolve().parents[1]
    spec = importlib.util.find_spec(package)
    found = [Path(folder).resolve() for folder in (spec.submodule_search_locations or ())] if spec else []
    if found and home / package.replace(".", "/") not in found:
        raise FileError(
            f"{found[0]}: this folder hides the package '{package}' of valve-hil, which then cannot be found; rename "
            f"the folder, or start from another one (`hil`, not `python -m hil`)"
        )


def _package_entries(kind: Kind, point: EntryPoint) -> Iterator[Entry]:
    package, why = point.value, ""
    try:
        spec = importlib.util.find_spec(package)
    except (Exception, SystemExit) as error:  # of a package above it
        spec, why = None, f" ({type(error).__name__}: {error})"
    if spec is None or spec.submodule_search_locations is None:
        whose = f" of the installed package '{point.dist.name}'" if point.dist else ""
        raise FileError(
            f"entry point '{package}' for {kind}{whose} is not an importable package{why}; repair or uninstall it"
        )
    for folder in spec.submodule_search_locations:
        for module in pkgutil.iter_modules([folder]):
            if module.name.startswith("_") or module.ispkg:
                continue
            path = Path(folder) / f"{module.name}.py"
            yield Entry(kind, _entry_name(kind, module.name), f"{package}.{module.name}", path)


def _entry_name(kind: Kind, text: str) -> str:
    # Valves are written with dashes, as their makers print them; everything else as Python does.
    return text.replace("_", "-") if kind == "plants" else text.replace("-", "_")
