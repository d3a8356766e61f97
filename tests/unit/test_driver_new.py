"""`hil new driver` and `hil check-driver`: what is written passes as written, what is wrong is told."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import drivers
import sim_devices
from hil.catalog import entries
from hil.errors import FileError, SettingError, UnknownNameError
from tests.commands import hil


@pytest.fixture
def folder(tmp_path):
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


def test_what_is_written_passes_as_written(folder):
    told = hil("new", "driver", "acme_7", "--in", str(folder))
    test = folder / "tests" / "test_driver_acme_7.py"
    assert str(test) in told
    spec = importlib.util.spec_from_file_location("test_driver_acme_7", test)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.test_counts_of_the_manual()
    module.test_driver_passes_every_check(folder)
    assert "acme_7" in hil("list", "drivers")


def test_nothing_is_written_over(folder):
    hil("new", "driver", "acme_7", "--in", str(folder))
    with pytest.raises(FileError, match=r"acme_7\.py: is there already; nothing was written"):
        hil("new", "driver", "acme_7", "--in", str(folder))


@pytest.mark.parametrize("name", ["Acme", "7acme", "_acme", "ac me", "acme-7", "gerät", "class"])
def test_name_that_is_none_is_told(name, folder):
    with pytest.raises(SettingError, match="names no driver"):
        hil("new", "driver", name, "--in", str(folder))


def test_other_kinds_and_folders_are_told(folder, tmp_path):
    with pytest.raises(SettingError, match="there are: driver, device, "):
        hil("new", "valve", "acme_7", "--in", str(folder))
    with pytest.raises(FileError, match="no such folder"):
        hil("new", "driver", "acme_7", "--in", str(tmp_path / "nowhere"))
    (tmp_path / "empty").mkdir()
    with pytest.raises(FileError, match=r"empty/plants: no such folder; --in takes a package \(`hil new package NAME`"):
        hil("new", "plant", "acme_7", "--in", str(tmp_path / "empty"))
    with pytest.raises(SettingError, match="installed already; take another name"):
        hil("new", "package", "hil", "--in", str(folder))


def test_folder_without_a_package_offers_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SettingError, match=r"no package here .* `hil new package NAME`, then `hil new driver acme_7`"):
        hil("new", "driver", "acme_7")
    assert list(tmp_path.iterdir()) == []
    hil("new", "bench", "acme_7")  # a file by itself
    assert "no faults" in hil("check", "acme_7.toml")


def test_package_without_a_group_says_what_is_missing(tmp_path):
    (tmp_path / "pyproject.toml").write_text('[project.entry-points."hil.drivers"]\nx = "x"\n', encoding="utf-8")
    (tmp_path / "x").mkdir()
    with pytest.raises(SettingError, match=r'has no \[project\.entry-points\."hil\.procedures"\]; add it'):
        hil("new", "procedure", "quick", "--in", str(tmp_path))


def run_tests(root: Path, *tests: str) -> str:
    """The tests of a package that is installed beside the program, in a program of their own."""
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    about = root / f"{project['name']}-{project['version']}.dist-info"
    about.mkdir(exist_ok=True)
    told = f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    (about / "METADATA").write_text(told, encoding="utf-8")
    points = "".join(
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in named.items())
        for group, named in project["entry-points"].items()
    )
    (about / "entry_points.txt").write_text(points, encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", *tests]
    done = subprocess.run(
        command, cwd=root, env=os.environ | {"PYTHONPATH": str(root)}, capture_output=True, text=True, check=False
    )
    return done.stdout + done.stderr


def test_package_passes_its_tests_at_once(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    hil("new", "package", "acme")
    monkeypatch.chdir(tmp_path / "acme" / "acme")  # anywhere in it
    for kind in ("device", "procedure", "bench"):
        hil("new", kind, f"my_{kind}")
    (tmp_path / "acme" / "tests" / "test_driver_my_device.py").unlink()  # the same as that of the package's own driver
    assert "4 passed" in run_tests(tmp_path / "acme")


@pytest.mark.slow
def test_plant_and_effect_of_a_package_pass_their_tests(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    hil("new", "package", "acme")
    hil("new", "plant", "relief-valve", "--in", "acme")
    hil("new", "effect", "edge_wear", "--in", "acme")
    names = [f"tests/test_{kind}.py" for kind in ("plant_relief_valve", "effect_edge_wear")]
    assert "2 passed" in run_tests(tmp_path / "acme", *names)


def test_folder_that_hides_a_package_of_ours_is_one_sentence(tmp_path):
    for name in ("drivers", "procedures"):
        (tmp_path / name).mkdir()
        command = [sys.executable, "-m", "hil", "list", name]
        environment = os.environ | {"PYTHONPATH": str(tmp_path)}  # the working folder alone is not looked into
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 2
        assert done.stderr.startswith(f"hil: {tmp_path / name}: this folder hides the package '{name}' of valve-hil")
        assert len(done.stderr.splitlines()) == 1


def test_driver_that_is_not_installed_is_told():
    with pytest.raises(UnknownNameError, match="no driver named 'modbuss', did you mean 'modbus'"):
        hil("check-driver", "modbuss")


def test_a_device_or_driver_that_the_bench_has_not_is_told():
    with pytest.raises(SettingError, match=r"no device 'nobody' with driver = \"modbus\"; there are: io"):
        hil("check-driver", "modbus", "--bench", "hpv41-modbus-tcp", "--device", "nobody")
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
def test_devices_that_cannot_be_served_are_told(words, text):
    with pytest.raises(SettingError, match=text):
        hil(*words)
