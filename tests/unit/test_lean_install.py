"""Without an extra, each command that needs it names it in one line and exits 2; nothing was driven."""

from __future__ import annotations

import re
import sys
import tomllib
from importlib.machinery import ModuleSpec
from importlib.metadata import packages_distributions
from pathlib import Path
from typing import Any

import pytest

from hil.extras import EXTRAS, is_installed, remedy


class Hiding:
    """A finder of modules that does not find those of some packages, as if they were not installed."""

    def __init__(self, finder: Any, names: tuple[str, ...]) -> None:
        self._finder, self._names = finder, names

    def find_spec(self, fullname: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        if fullname.partition(".")[0] in self._names:
            return None
        found: ModuleSpec | None = self._finder.find_spec(fullname, path, target)
        return found

    def __getattr__(self, name: str) -> Any:
        return getattr(self._finder, name)


@pytest.fixture
def hide(monkeypatch, tmp_path):
    """Takes packages away; others stay, as what a test before has imported may still ask for them."""
    monkeypatch.chdir(tmp_path)

    def hidden(*names):
        for name in [name for name in sys.modules if name.partition(".")[0] in names]:
            monkeypatch.delitem(sys.modules, name)
        monkeypatch.setattr(sys, "meta_path", [Hiding(finder, names) for finder in sys.meta_path])

    return hidden


def write_recording() -> None:
    rows = "".join(f"{0.01 * i:g},{i % 7},{i % 5}\n" for i in range(50))
    Path("a.csv").write_text(f"time [s],command [%],flow [l/min]\n{rows}", encoding="utf-8")
    for name in ("a.mf4", "a.tdms", "a.h5", "a.parquet"):
        Path(name).write_bytes(b"anything")


COMMANDS = [
    *((("run", "step_response", "--bench", bench, "--out", "run"), package) for bench, package in (
        ("hpv41-canopen", "canopen"), ("four-way-lab-can", "canopen"), ("hpv41-mixed", "canopen"),
        ("hpv41-usb-6211", "nidaqmx"),
    )),
    (("runs", "--archive", "postgresql://localhost/archive"), "psycopg"),
    (("check-driver", "canopen_valve"), "canopen"),
    *((("convert", source, "b.csv"), package) for source, package in (
        ("a.mf4", "asammdf"), ("a.tdms", "nptdms"), ("a.h5", "h5py"), ("a.parquet", "pyarrow"),
    )),
    *((("convert", "a.csv", target), package) for target, package in (
        ("b.mf4", "asammdf"), ("b.tdms", "nptdms"), ("b.h5", "h5py"), ("b.parquet", "pyarrow"),
    )),
]  # fmt: skip


@pytest.mark.parametrize(
    ("arguments", "package"), COMMANDS, ids=lambda value: " ".join(value[:4]) if isinstance(value, tuple) else value
)
def test_command_names_the_extra_in_one_line(arguments, package, hide, refused):
    write_recording()
    hide(package)
    err = refused(*arguments)
    assert f"needs the package '{package}'" in err.replace("files need ", "files needs ")
    assert remedy(package) in err and ".part" not in err and len(err.splitlines()) == 1
    assert sorted(path.name for path in Path().iterdir()) == ["a.csv", "a.h5", "a.mf4", "a.parquet", "a.tdms"]


def test_what_needs_no_extra_works(hide, command_line, prints, refused):
    hide(*EXTRAS)
    assert not any(is_installed(package) for package in EXTRAS)
    for arguments in (["list"], ["check", "brevini-hpv41", "--strict"]):
        prints(*arguments)
    status, out, _ = command_line("check", "hpv41-mixed")
    assert status == 0 and out.count("which is not installed: pip install 'valve-hil[links]'") == 1
    refused("check", "hpv41-mixed", "--strict")


def test_every_library_of_every_extra_is_known():
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text("utf-8"))["project"]
    of_package: dict[str, set[str]] = {}
    for imported, packages in packages_distributions().items():
        for package in packages:
            of_package.setdefault(package.lower(), set()).add(imported)
    for extra in set(project["optional-dependencies"]) - {"all", "dev", "bench"}:
        for wanted in project["optional-dependencies"][extra]:
            package = re.split(r"[<>=\[;]", wanted)[0].lower()
            if package == "valve-hil":  # another extra of this package
                continue
            imported = of_package.get(package, {package.replace("-", "_")})  # it need not be installed here
            known = {name for name, of in EXTRAS.items() if extra.startswith(of)}
            assert imported & known, f"{package} of the extra {extra}"


def test_a_run_without_the_libraries_of_pages_says_so(hide, command_line):
    hide(*EXTRAS)
    status, out, err = command_line("run", "leakage_check", "--bench", "cummins-efc-acceptance", "--out", "runs/one")
    assert status == 0 and "verdict: " in out and "report: " not in out
    assert err.count("no page is made, which needs the package") == err.count(remedy("jinja2")) == 1
    assert Path("runs/one/results.json").is_file() and not Path("runs/one/report.html").exists()
