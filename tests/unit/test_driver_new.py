"""`hil new driver` and `hil check-driver`: what is written passes as written, what is wrong is told."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

import drivers
import sim_devices
from hil.catalog import entries
from hil.cli.app import _assembled
from hil.errors import FileError, SettingError, UnknownNameError

RUN = CliRunner()


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    """A folder whose packages are searched like the project's own, for one test."""
    for package in (drivers, sim_devices):
        (tmp_path / package.__name__).mkdir()
        package.__path__.append(str(tmp_path / package.__name__))
    (tmp_path / "tests").mkdir()
    entries.cache_clear()
    yield tmp_path
    for package in (drivers, sim_devices):
        package.__path__.pop()
        sys.modules.pop(f"{package.__name__}.acme_7", None)
    entries.cache_clear()


def hil(*words: str) -> str:
    result = RUN.invoke(_assembled(), list(words))
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.output


def test_what_is_written_passes_as_written(folder: Path) -> None:
    told = hil("new", "driver", "acme_7", "--in", str(folder))
    test = folder / "tests" / "test_driver_acme_7.py"
    assert str(test) in told
    spec = importlib.util.spec_from_file_location("test_driver_acme_7", test)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.test_counts_of_the_manual()
    module.test_driver_passes_every_check(folder)
    assert "acme_7" in hil("list", "drivers")


def test_nothing_is_written_over(folder: Path) -> None:
    hil("new", "driver", "acme_7", "--in", str(folder))
    with pytest.raises(FileError, match=r"acme_7\.py: is there already; nothing was written"):
        hil("new", "driver", "acme_7", "--in", str(folder))


@pytest.mark.parametrize("name", ["Acme", "7acme", "_acme", "ac me", "acme-7"])
def test_name_that_is_none_is_told(name: str, folder: Path) -> None:
    with pytest.raises(SettingError, match="is no name of a driver"):
        hil("new", "driver", name, "--in", str(folder))


def test_other_kinds_and_folders_are_told(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(SettingError, match="there is: driver"):
        hil("new", "valve", "acme_7", "--in", str(folder))
    with pytest.raises(FileError, match="no such folder"):
        hil("new", "driver", "acme_7", "--in", str(tmp_path / "nowhere"))


def test_driver_that_is_not_installed_is_told() -> None:
    with pytest.raises(UnknownNameError, match="no driver named 'modbuss', did you mean 'modbus'"):
        hil("check-driver", "modbuss")


def test_bench_without_the_driver_is_told() -> None:
    with pytest.raises(SettingError, match='no device with driver = "scpi"'):
        hil("check-driver", "scpi", "--bench", "hpv41-canopen")


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("devices", "brevini-hpv41"), "only devices with driver"),
        (("devices", "hpv41-mixed", "--quirk", "nobody.late_s=1"), "devices here: valve, meter, module"),
        (("devices", "hpv41-mixed", "--quirk", "meter.lazy=1"), "there are: late_s"),
    ],
)
def test_devices_that_cannot_be_served_are_told(words: tuple[str, ...], text: str) -> None:
    with pytest.raises(SettingError, match=text):
        hil(*words)
