"""Every fault on every link: outputs safe at the device in time, the run readable, one line that says why."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.faults import Case
from tests.faults_on_links import CASES, measure

AT_THE_DESK = {"Modbus TCP, cable pulled within an answer", "serial, one answer late by 0.4 s"}


def marked(case: Case):
    desk = str(case).rpartition(", ")[0] in AT_THE_DESK
    return pytest.param(case, id=str(case), marks=() if desk else pytest.mark.slow)


@pytest.mark.parametrize("case", [marked(case) for case in CASES])
def test_outputs_are_safe_in_time(case: Case, tmp_path: Path) -> None:
    seen = measure(case, tmp_path)
    print(seen)
    assert seen.message and case.says in seen.message
    assert seen.samples > 10
    if case.within_s is None:
        assert seen.safe_after_s is None
    else:
        assert seen.safe_after_s is not None and seen.safe_after_s <= case.within_s
    if "outputs are safe (read back)" in seen.message and case.fault != "device freezes its output":
        assert seen.safe_after_s is not None
