"""After a power cut each file may hold any part of what was written since it was last brought to the disk.

The cut is played on the files of a run that was never closed: every file keeps what had been synced, then some
of the rest, then zeros, which is what file systems leave behind.
"""

from __future__ import annotations

import shutil
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hil.errors import FileError
from hil.record.folder import RunWriter, read

BLOCKS, SYNCED = 12, 5
FILES = ("samples.f8", "samples.log", "events.jsonl")


def block(number: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    time_s = (100.0 * number + np.arange(40 + number)) / 1000.0
    return time_s, {"flow": np.cos(time_s)}


TRUTH_S = np.concatenate([block(number)[0] for number in range(BLOCKS)])
SYNCED_ROWS = sum(len(block(number)[0]) for number in range(SYNCED))


@pytest.fixture(scope="module")
def unclosed(tmp_path_factory):
    """A run folder as a killed process leaves it, and the size that each file had at the last sync."""
    folder = tmp_path_factory.mktemp("unclosed")
    run = RunWriter.create(folder / "open", {}, [("flow", "l/min")])
    synced = {}
    for number in range(BLOCKS):
        if number == SYNCED:
            synced = {name: (run.path / name).stat().st_size for name in FILES}
        with run.part({"number": number}):
            run.append(*block(number))
    shutil.copytree(run.path, folder / "run")
    run.close()
    return folder / "run", synced


@settings(
    max_examples=150, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_everything_synced_is_there_and_nothing_else_is_made_up(unclosed, tmp_path, data):
    original, synced = unclosed
    copy = tmp_path / "run"
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(original, copy)
    for name in FILES:
        content = bytearray((original / name).read_bytes())
        length = data.draw(st.integers(synced[name], len(content)), label=f"{name} length")
        zeros = sorted(data.draw(st.tuples(*[st.integers(synced[name], length)] * 2), label=f"{name} zeros"))
        content[zeros[0] : zeros[1]] = bytes(zeros[1] - zeros[0])
        (copy / name).write_bytes(content[:length])
    found = read(copy)
    assert len(found) >= SYNCED_ROWS
    assert np.array_equal(found.time_s, TRUTH_S[: len(found)])
    assert np.array_equal(found.channels["flow"].values, np.cos(found.time_s))
    assert found.meta["incomplete"]
    assert len(found.meta["parts"]) >= SYNCED
    for part in found.meta["parts"]:
        assert found.time_s[part["first"]] == block(part["number"])[0][0]


@pytest.fixture(scope="module")
def closed(tmp_path_factory):
    path = tmp_path_factory.mktemp("closed") / "run"
    with RunWriter.create(path, {"procedure": "x"}, [("flow", "l/min")]) as run, run.part({"kind": "step"}):
        run.append(*block(0))
    return path


@settings(
    max_examples=150, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_no_changed_bit_of_a_closed_run_goes_unnoticed(closed, tmp_path, data):
    copy = tmp_path / "run"
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(closed, copy)
    before = read(closed)
    name = data.draw(st.sampled_from(["samples.f8", "events.jsonl", "run.json", "end.json"]))
    content = bytearray((copy / name).read_bytes())
    place = data.draw(st.integers(0, len(content) - 1))
    content[place] ^= 1 << data.draw(st.integers(0, 7))
    (copy / name).write_bytes(content)
    if name == "end.json":  # the seal itself: its words or its date may have changed, never a sample
        with suppress(FileError):
            found = read(copy)
            assert np.array_equal(found.time_s, before.time_s)
            assert found.meta["parts"] == before.meta["parts"]
    else:
        with pytest.raises(FileError, match=str(copy)):
            read(copy)
