"""Thinned parts: which rows stay, what an end leaves behind, and that a run of days stays small."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from hil.record.folder import RunWriter, read

KEPT = {"after": 3, "first": 2, "of": 5, "last": 4}


def written(folder: Path, blocks: list[int], error: Exception | None = None) -> list[float]:
    """The stamps that a run has after rows 0, 1, 2 … were appended in blocks of a thinned part."""
    with RunWriter.create(folder, {}, [("flow", "l/min")]) as run:
        try:
            with run.part({"kind": "endless", "rows_kept": KEPT}):
                for first, count in zip(itertools.accumulate([0, *blocks]), blocks, strict=False):
                    time_s = np.arange(first, first + count, dtype=np.float64)
                    run.append(time_s, {"flow": 2.0 * time_s})
                if error is not None:
                    raise error
        except ZeroDivisionError:
            pass
        end = float(sum(blocks))
        run.append(np.array([end]), {"flow": np.array([2.0 * end])})
    found = read(folder)
    assert np.array_equal(found.values("flow"), 2.0 * found.time_s)
    return list(found.time_s)


@pytest.mark.parametrize("blocks", [[21], [1] * 21, [4, 4, 4, 4, 5], [7, 7, 7]])
def test_the_first_rows_of_each_stretch_stay_however_they_come(tmp_path, blocks):
    assert written(tmp_path / "run", blocks) == [3, 4, 8, 9, 13, 14, 18, 19, 21]


def test_what_cuts_a_part_short_leaves_its_last_rows(tmp_path):
    assert written(tmp_path / "run", [10, 8], ZeroDivisionError()) == [3, 4, 8, 9, 13, 14, 15, 16, 17, 18]
    (part,) = read(tmp_path / "run").meta["parts"]
    assert part["unfinished"]


def test_no_more_is_held_than_is_wanted(tmp_path):
    assert written(tmp_path / "run", [1] * 13, ZeroDivisionError()) == [3, 4, 8, 9, 10, 11, 12, 13]
    assert written(tmp_path / "few", [2], ZeroDivisionError()) == [0, 1, 2]


@pytest.mark.parametrize("kept", [{"first": 1, "of": 2}, {**KEPT, "first": 6}, {**KEPT, "last": 0}])
def test_a_description_that_is_none_is_refused(tmp_path, kept):
    with (
        RunWriter.create(tmp_path / "run", {}, [("flow", "l/min")]) as run,
        pytest.raises(ValueError, match="rows_kept"),
        run.part({"rows_kept": kept}),
    ):
        pass
