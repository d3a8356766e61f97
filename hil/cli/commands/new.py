"""`hil new`: begin a driver, device, plant, effect, procedure, bench or package, with a test that passes at once."""

from __future__ import annotations

import importlib.util
import keyword
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import typer

from hil.cli.options import argument, option
from hil.errors import FileError, SettingError, reading
from hil.untrusted import parse_toml, read_text

_TEMPLATES = Path(__file__).parent / "templates"
_GROUPS = {
    "driver": "hil.drivers", "device": "hil.sim_devices", "bench": "hil.sim_devices", "procedure": "hil.procedures",
    "plant": "hil.plants", "effect": "hil.effects",
}  # fmt: skip
_KINDS = (*_GROUPS, "package")
_FOLDERS = {"hil.drivers": "drivers", "hil.sim_devices": "sim_devices", "hil.procedures": "procedures",
            "hil.plants": "plants", "hil.effects": "effects"}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Home:
    """Where files are added: the module and folder of the package of each group, and the tests."""

    root: Path
    modules: Mapping[str, str]

    def module(self, group: str) -> str:
        """The package that holds this group.

        Raises:
            SettingError: the package has none; says which lines are missing.
        """
        if group not in self.modules:
            raise SettingError(
                f'{self.root / "pyproject.toml"}: has no [project.entry-points."{group}"]; add it with one line, '
                f'NAME = "PACKAGE", that names the package for it, and install again'
            )
        return self.modules[group]

    def folder(self, group: str) -> Path:
        """Its folder."""
        below = Path(*self.module(group).split("."))
        for place in (self.root / below, self.root / "src" / below):
            if place.is_dir():
                return place
        raise FileError(
            f"{self.root.resolve() / below}: no such folder; --in takes a package (`hil new package NAME` begins "
            f"one) or a folder that has a folder '{below}'"
        )

    @property
    def tests(self) -> Path:
        """Where its tests are."""
        unit = self.root / "tests" / "unit"
        return unit if unit.is_dir() else self.root / "tests"


def command(
    kind: str = argument(..., "|".join(_KINDS), "What to begin."),
    name: str = argument("", "NAME", "Its name: lower-case letters, digits and _."),
    folder: Path | None = option(
        None, "--in", help="Folder of the package that it is added to; default: the one that this folder is in."
    ),
    source: Path | None = option(
        None, "--from", "FILE", "device: a register table (.csv), an EDS, DCF or DBC of its maker."
    ),
) -> None:
    """Begin a driver, device, plant, effect, procedure, bench or package, with a test that passes as written.

    A driver is one for a device with a register table, and has its simulated twin beside it; a device is the twin
    alone where the driver is there. Inside a package (a folder whose pyproject.toml has entry points of the program)
    files are added there.

    `hil new device --from FILE` writes the description of a device, NAME.toml, into this folder (or --in), beside its
    bench, with every gap marked that the maker's file leaves.
    """
    if source is not None:
        _described(kind, name, folder or Path(), source)
        return
    if kind not in _KINDS:
        raise SettingError(f"'{kind}' cannot be begun here; there are: {', '.join(_KINDS)}")
    plain = name.replace("-", "_") if kind in ("plant", "bench", "package") else name
    if not (plain.isascii() and plain.isidentifier() and plain[0].islower() and plain == plain.lower()):
        raise SettingError(f"'{name}' names no {kind}: lower-case letters, digits and _, a letter first")
    if keyword.iskeyword(plain):
        raise SettingError(f"'{name}' names no {kind}: a word of Python, which no module can be called")
    if kind == "package":
        files, after = _package(plain, folder or Path())
    elif kind == "bench" and folder is None and _package_around(Path.cwd()) is None:
        files, after = (
            {Path(f"{name}.toml"): _filled("bench.txt", plain, FILE=f"{name}.toml")},
            f"hil check {name}.toml",
        )
    else:
        files, after = _added(kind, plain, _home(kind, name, folder))
    _written(files)
    typer.echo(f"next: {after}")


def _described(kind: str, name: str, folder: Path, source: Path) -> None:
    """Write the first description of a device, and say what is left to do."""
    from hil.description.first import first_description, gaps

    if kind != "device":
        raise SettingError(f"--from {source}: a device is described from a file, not a {kind}")
    text = first_description(source)
    path = folder / f"{name or source.stem.lower().replace(' ', '-')}.toml"
    beside = path.parent / source.name
    _written({path: text})
    if source.suffix.lower() in (".eds", ".dcf", ".dbc") and not beside.exists():
        beside.write_bytes(source.read_bytes())
        typer.echo(beside)
    typer.echo(f"next: fill in {gaps(text)} gaps, then hil describe {path}")


def _written(files: Mapping[Path, str]) -> None:
    """Write all of them or none."""
    for path in files:
        if path.exists():
            raise FileError(f"{path}: is there already; nothing was written")
    for path, text in files.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        typer.echo(path)


def _added(kind: str, name: str, home: Home) -> tuple[dict[Path, str], str]:
    """The files of a new entry, and what to do next."""
    test = home.tests / f"test_{kind}_{name}.py"
    group = _GROUPS[kind]
    if kind == "bench":
        bench = home.folder(group) / "benches" / f"{name}.toml"
        return {
            bench: _filled("bench.txt", name, FILE=name),
            test: _filled("bench_test.txt", name),
        }, f"hil check {name}"
    if kind == "device" and not (home.folder("hil.drivers") / f"{name}.py").exists():
        return _added("driver", name, home)  # a twin without its driver is nothing that could be tried
    modules = {"DRIVERS": home.modules.get("hil.drivers", "")}
    files = {home.folder(group) / f"{name}.py": _filled(f"{kind}.txt", name, **modules)}
    if kind == "driver":
        files[home.folder("hil.sim_devices") / f"{name}.py"] = _filled("device.txt", name, **modules)
    files[test] = _filled(f"{kind}_test.txt", name, **modules)
    todo = {
        "driver": "put the manual's register table into both",
        "device": "put the manual's register table into it",
        "procedure": "say what it drives and what it measures", "plant": "write its equations",
        "effect": "write its law",
    }[kind]  # fmt: skip
    return files, f"{todo}, then pytest {test}"


def _package(name: str, folder: Path) -> tuple[dict[Path, str], str]:
    """A package with a driver, its twin, a bench and a test."""
    if importlib.util.find_spec(name) is not None:
        raise SettingError(f"'{name}': a package of that name is installed already; take another name")
    root = folder / name.replace("_", "-")
    modules = {"DRIVERS": f"{name}.drivers"}
    about = {"": "For valve-hil", "drivers": "Drivers", "devices": "Simulated devices", "procedures": "Procedures",
             "plants": "Plants", "effects": "Effects", "devices/benches": "Benches"}  # fmt: skip
    return {
        root / "pyproject.toml": _filled("package/pyproject.txt", name),
        root / "README.md": _filled("package/README.txt", name),
        **{root / name / part / "__init__.py": f'"""{text}."""\n' for part, text in about.items()},
        root / name / "drivers" / f"{name}.py": _filled("driver.txt", name, **modules),
        root / name / "devices" / f"{name}.py": _filled("device.txt", name, **modules),
        root / name / "devices" / "benches" / f"{name}.toml": _filled("package/bench.txt", name),
        root / "tests" / f"test_driver_{name}.py": _filled("driver_test.txt", name, **modules),
    }, f"pip install -e {root} && pytest {root}"


def _filled(template: str, name: str, **more: str) -> str:
    dashed = name.replace("_", "-")
    text = (_TEMPLATES / template).read_text(encoding="utf-8")
    for key, value in {"NAME": name, "DASHED": dashed, "TITLE": dashed.replace("-", " "), **more}.items():
        text = text.replace(f"@{key}@", value)
    return text


def _home(kind: str, name: str, folder: Path | None) -> Home:
    if folder is None:
        if (found := _package_around(Path.cwd())) is None:
            raise SettingError(
                f"there is no package here (no pyproject.toml with entry points of valve-hil in {Path.cwd()} or above "
                f"it): begin one with `hil new package NAME`, then `hil new {kind} {name}` in it; or say --in FOLDER"
            )
        return found
    if not folder.is_dir():
        raise FileError(f"{folder}: no such folder")
    return _package_in(folder) or Home(folder, _FOLDERS)


def _package_around(folder: Path) -> Home | None:
    return next((home for place in (folder, *folder.parents) if (home := _package_in(place))), None)


def _package_in(folder: Path) -> Home | None:
    """The package whose pyproject.toml lies in a folder, if it has entry points of ours."""
    path = folder / "pyproject.toml"
    if not path.is_file():
        return None
    with reading(path, "not a pyproject file"):
        points = parse_toml(read_text(path), f"{path}: not a pyproject file").get("project", {}).get("entry-points", {})
    modules = {group: next(iter(named.values())) for group, named in points.items() if group in _FOLDERS and named}
    return Home(folder, modules) if modules else None
