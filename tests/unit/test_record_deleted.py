"""A run folder that is deleted while it is written: the run hears of it, and everything is kept."""

from __future__ import annotations

import shutil
from pathlib import Path
from resource import RLIMIT_NOFILE

import numpy as np
import pytest

from hil.bench.ending import recorded
from hil.errors import StorageError
from hil.record.folder import RunWriter, read
from hil.safety.outputs import Outputs
from tests.limited import limited


def begun(path: Path) -> RunWriter:
    run = RunWriter.create(path, {"procedure": "test"}, [("flow", "l/min")])
    run.append(np.arange(50) / 100.0, {"flow": np.arange(50) * 1.0})
    run.event("driven")
    return run


def go_on(run: RunWriter) -> None:
    run.append(np.arange(50, 60) / 100.0, {"flow": np.arange(10) * 1.0})


def moved(folder: Path) -> None:
    """To another name, with an empty folder in its place."""
    folder.rename(folder.with_name("other"))
    folder.mkdir()


@pytest.mark.parametrize(
    ("gone", "where", "event"),
    [
        (shutil.rmtree, "run", "the run folder was deleted, and made again"),
        (moved, "other", "the run folder was moved"),
    ],
)
def test_a_folder_that_is_gone_is_noticed_at_the_next_block_and_sealed_where_it_is(tmp_path, gone, where, event):
    run, said = begun(tmp_path / "run"), event.partition(",")[0]
    gone(tmp_path / "run")
    with pytest.raises(StorageError, match=rf"run: {said}; 60 samples"):
        go_on(run)
    run.append(np.arange(60, 70) / 100.0, {"flow": np.arange(10) * 1.0})  # the way down
    run.close(f"StorageError: {said}")
    assert run.path == tmp_path / where and (where == "run" or not any((tmp_path / "run").iterdir()))
    found = read(tmp_path / where)
    assert found.values("flow").tolist() == [*range(50), *range(10), *range(10)] and "incomplete" not in found.meta
    assert [told["event"] for told in found.meta["events"]] == ["driven", event]


def test_what_lies_in_its_place_is_left_alone(tmp_path):
    run = begun(tmp_path / "run")
    shutil.rmtree(tmp_path / "run")
    (tmp_path / "run").write_text("mine")
    run.close()
    assert (tmp_path / "run").read_text() == "mine"
    assert len(read(tmp_path / "run-restored")) == 50 and run.path == tmp_path / "run-restored"


def test_folder_that_was_moved_where_nobody_tells_is_read_up_to_its_last_row(tmp_path, monkeypatch):
    run = begun(tmp_path / "run")
    (tmp_path / "run").rename(tmp_path / "other")
    monkeypatch.setattr("hil.record.run_folder.samples.place_of", lambda _file: None)
    with pytest.raises(StorageError, match="50 samples"):
        run.close()
    assert len(read(tmp_path / "other")) == 50


@pytest.mark.parametrize("is_moved", [True, False])
def test_end_of_a_run_says_where_its_folder_is(is_moved, tmp_path):
    run = begun(tmp_path / "run")
    if is_moved:
        (tmp_path / "run").rename(tmp_path / "other")
    else:
        (tmp_path / "run" / "samples.f8").unlink()
    with pytest.raises(KeyboardInterrupt) as ended, recorded(run, Outputs()):
        raise KeyboardInterrupt
    where = tmp_path / ("other" if is_moved else "run-restored")
    assert f"what was recorded is kept in {where}" in ended.value.__notes__
    assert len(read(where)) == 50


def test_run_is_sealed_where_no_file_can_be_opened_any_more(tmp_path):
    run = begun(tmp_path / "run")
    with limited(RLIMIT_NOFILE, 3):
        go_on(run)
        run.close()
    assert len(read(tmp_path / "run")) == 60 and read(tmp_path / "run").meta["outcome"] == "completed"
