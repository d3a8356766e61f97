"""A full disk: one clear error that names the folder, and everything before it stays readable."""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path
from resource import RLIMIT_FSIZE

import numpy as np
import pytest

from hil.errors import StorageError
from hil.physics.model import save_model, typical_model
from hil.record.folder import RunWriter, read
from hil.record.read import write_recording
from hil.record.recording import recording
from tests.limited import limited


@pytest.fixture
def small_disk():
    with tempfile.TemporaryDirectory() as folder:
        mount = ["mount", "-t", "tmpfs", "-o", "size=96k", "tmpfs", folder]
        if subprocess.run(mount, capture_output=True, check=False).returncode:
            pytest.skip("mounting a file system is not permitted here")
        try:
            yield Path(folder)
        finally:
            subprocess.run(["umount", folder], check=True)


def check_kept(path: Path) -> None:
    found = read(path)
    assert found.meta["outcome"] == "disk full"
    assert "incomplete" not in found.meta
    assert len(found) > 1000
    assert np.array_equal(found.time_s, np.arange(len(found)) / 1000.0)
    assert np.array_equal(found.channels["flow"].values, found.time_s * 2.0)


def append_for_ever(run: RunWriter) -> None:
    while True:
        time_s = np.arange(run.rows, run.rows + 100) / 1000.0
        run.append(time_s, {"flow": time_s * 2.0})


def run_until_full(path: Path) -> None:
    run = RunWriter.create(path, {}, [("flow", "l/min")])
    with pytest.raises(StorageError, match=rf"{path}: cannot be written: .*; \d+ samples up to .* s are kept"):
        append_for_ever(run)
    with pytest.raises(StorageError):
        run.event("x" * 100_000)
    run.close("disk full")


def test_a_file_that_may_not_grow_keeps_what_it_has(tmp_path):
    with limited(RLIMIT_FSIZE, 40_000):
        run_until_full(tmp_path / "run")
    check_kept(tmp_path / "run")


def test_a_full_disk_can_still_be_closed(small_disk):
    run_until_full(small_disk / "run")
    check_kept(small_disk / "run")


def test_an_export_that_does_not_fit_leaves_nothing_behind(tmp_path):
    time_s = np.arange(10_000) / 1000.0
    made = recording("made", time_s, {"flow [l/min]": time_s})
    (tmp_path / "old.csv").write_text("old")
    with (
        limited(RLIMIT_FSIZE, 20_000),
        pytest.raises(StorageError, match=r"old.csv: cannot be written: File too large"),
    ):
        write_recording(made, tmp_path / "old.csv")
    assert [path.name for path in tmp_path.iterdir()] == ["old.csv"]
    assert (tmp_path / "old.csv").read_text() == "old"


def test_a_model_that_does_not_fit_is_named(tmp_path):
    with (
        limited(RLIMIT_FSIZE, 100),
        pytest.raises(StorageError, match=r"unit\.json: the model cannot be written: File too large"),
    ):
        save_model(typical_model("brevini-hpv41"), tmp_path / "unit.json")
