"""Every fault at every moment on the simulated DAQ: outputs safe in time, records kept, one line says why."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.faults import Case
from tests.faults_simulated import CASES, MOMENTS, measure

LONGEST_BLOCK = 100  # samples: the first look at the bench


@pytest.mark.parametrize("case", CASES, ids=str)
def test_outputs_are_safe_and_nothing_recorded_is_lost(case: Case, tmp_path: Path) -> None:
    seen = measure(case, tmp_path)
    print(seen)
    assert case.says in seen.message
    if case.within_s is None:
        moved = case.moment != "before anything moves"
        assert (seen.safe_after_s is None) == moved
    else:
        assert seen.safe_after_s is not None and seen.safe_after_s <= case.within_s
    assert seen.lost is not None
    if case.fault != "disk full" and "no number" not in case.fault:  # neither can be recorded
        assert 0 <= seen.lost <= LONGEST_BLOCK
    assert seen.samples > 0 or case.moment == "before anything moves"


def test_without_a_fault_the_course_is_as_the_moments_say(tmp_path: Path) -> None:
    seen = measure(Case("", "none", "while it stands", None, ""), tmp_path)
    assert (seen.message, seen.lost) == ("", 0)
    assert max(MOMENTS.values()) < seen.samples / 1000.0
