"""What is kept between programs: made once, made again where it cannot be kept or was damaged."""

from __future__ import annotations

import os

import numba
import numpy as np
import pytest

from hil.cache import Arrays, cache_folder, cached_arrays, stamp
from hil.errors import FileError
from hil.kernel import kernel
from hil.physics.compose import _load


class _Made:
    def __init__(self) -> None:
        self.count = 0

    def __call__(self) -> Arrays:
        self.count += 1
        return {"features": np.arange(6.0).reshape(2, 3), "labels": np.array([0.0, 1.0])}


def test_it_is_made_once_and_the_same_comes_back(tmp_path, monkeypatch):
    monkeypatch.setenv("HIL_CACHE_DIR", str(tmp_path))
    make = _Made()
    first, again = cached_arrays("kind", "one", make), cached_arrays("kind", "one", make)
    assert make.count == 1
    assert {name: values.tolist() for name, values in again.items()} == {n: v.tolist() for n, v in first.items()}
    cached_arrays("kind", "other", make)
    assert make.count == 2


@pytest.mark.parametrize("content", [b"", b"PK", b"not a file of arrays", b"PK\x03\x04" + bytes(40)])
def test_a_damaged_file_is_made_anew(tmp_path, monkeypatch, content):
    monkeypatch.setenv("HIL_CACHE_DIR", str(tmp_path))
    make = _Made()
    cached_arrays("kind", "one", make)
    (tmp_path / "kind" / "one.npz").write_bytes(content)
    assert cached_arrays("kind", "one", make)["labels"].tolist() == [0.0, 1.0]
    cached_arrays("kind", "one", make)
    assert make.count == 2


def test_where_nothing_can_be_kept_it_is_made_each_time(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("HIL_CACHE_DIR", str(tmp_path / "file"))
    make = _Made()
    assert cached_arrays("kind", "one", make)["features"].shape == (2, 3)
    cached_arrays("kind", "one", make)
    assert make.count == 2


def test_the_stamp_differs_with_every_source_and_tool(tmp_path):
    one, two = tmp_path / "one.py", tmp_path / "two.py"
    one.write_text("a = 1")
    two.write_text("b = 1")
    stamps = {stamp([one], ()), stamp([one, two], ()), stamp([one], ("numpy",))}
    two.write_text("b = 2")
    stamps.add(stamp([one, two], ()))
    assert len(stamps) == 4
    assert stamp([two, one], ()) == stamp([one, two], ())


def test_what_nobody_asked_for_in_a_quarter_goes_when_something_new_comes(tmp_path, monkeypatch):
    monkeypatch.setenv("HIL_CACHE_DIR", str(tmp_path))
    make, kind = _Made(), tmp_path / "kind"
    for name in ("old", "asked_for", "young"):
        cached_arrays("kind", name, make)
    for name in ("old", "asked_for"):
        for path in kind.glob(f"{name}.*"):
            os.utime(path, (0.0, 0.0))
    cached_arrays("kind", "asked_for", make)
    cached_arrays("kind", "new", make)
    assert sorted(path.name for path in kind.glob("*.npz")) == ["asked_for.npz", "new.npz", "young.npz"]
    assert not list(kind.glob("old.*"))
    assert make.count == 4


def test_kept_folder_is_closed_to_others(tmp_path, monkeypatch):
    monkeypatch.setenv("HIL_CACHE_DIR", str(tmp_path / "cache"))
    folder = cache_folder("kernels")
    assert folder.stat().st_mode & 0o077 == 0
    folder.chmod(0o777)
    (folder / "planted.py").write_text("")
    (folder / "planted.py").chmod(0o666)
    (folder / "own.py").write_text("")
    (folder / "own.py").chmod(0o600)
    assert {path.name for path in cache_folder("kernels").iterdir()} == {"own.py"}
    assert folder.stat().st_mode & 0o077 == 0


def test_kept_folder_leaves_files_of_the_group_in_a_closed_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("HIL_CACHE_DIR", str(tmp_path))
    cache_folder("kernels").joinpath("own.nbi").touch()
    (tmp_path / "kernels/own.nbi").chmod(0o664)  # what numba writes where the umask is 002
    assert (cache_folder("kernels") / "own.nbi").exists()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a file to another user")
def test_kept_folder_takes_nothing_of_another_owner(tmp_path, monkeypatch):
    monkeypatch.setenv("HIL_CACHE_DIR", str(tmp_path / "cache"))
    folder = cache_folder("kernels")
    for name in ("planted.py", "__pycache__/planted.nbi"):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text("raise SystemExit('executed')")
        os.chown(folder / name, 65534, 65534)
        cache_folder("kernels")
        assert not (folder / name).exists()
    os.chown(folder, 65534, 65534)
    with pytest.raises(FileError, match=r"kernels: belongs to user 65534 .* HIL_CACHE_DIR"):
        cache_folder("kernels")


def test_kept_folder_is_no_link(tmp_path, monkeypatch):
    monkeypatch.setenv("HIL_CACHE_DIR", str(tmp_path / "cache"))
    (tmp_path / "cache").mkdir()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "cache/kernels").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(FileError, match="kernels: belongs"):
        cache_folder("kernels")


def test_kernels_are_made_where_nothing_can_be_kept(monkeypatch):
    njit = numba.njit

    def without_a_home(*functions, cache=False, **options):
        if cache:
            raise RuntimeError("cannot cache function: no locator available")
        return njit(*functions, **options)

    monkeypatch.setenv("HIL_CACHE_DIR", "/dev/null/none")
    monkeypatch.setattr(numba, "njit", without_a_home)
    monkeypatch.setattr("hil.kernel._kernels", [])
    assert _load("value = 4\n", "made_where_nothing_is_kept").value == 4
    assert kernel()(lambda value: 2.0 * value)(2.0) == 4.0
