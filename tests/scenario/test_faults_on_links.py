"""Every fault on every link: outputs safe at the device in time, the run readable, one line that says why."""

from __future__ import annotations

import pytest

from tests.faults import Case
from tests.faults_on_links import CASES, measure
from tests.links import ANSWERS
from tests.waits import PATIENCE_S

AT_THE_DESK = {"Modbus TCP, cable pulled within an answer", "serial, cable pulled within an answer"}


def is_at_the_desk(case: Case) -> bool:
    return str(case).rpartition(", ")[0] in AT_THE_DESK


def marked(case: Case):
    return pytest.param(case, id=str(case), marks=() if is_at_the_desk(case) else (pytest.mark.slow, pytest.mark.alone))


@pytest.mark.parametrize("case", [marked(case) for case in CASES])
def test_outputs_are_safe_in_time(case, tmp_path):
    seen = measure(case, tmp_path, ANSWERS if is_at_the_desk(case) else ())
    print(seen)
    assert seen.message and case.says in seen.message
    assert seen.samples > (0 if is_at_the_desk(case) else 10)  # of a busy computer some were recorded all the same
    if case.within_s is None:
        assert seen.safe_after_s is None
    else:
        limit_s = PATIENCE_S if is_at_the_desk(case) else case.within_s  # seconds are judged on a machine of their own
        assert seen.safe_after_s is not None and seen.safe_after_s <= limit_s
    if "outputs are safe (read back)" in seen.message and case.fault != "device freezes its output":
        assert seen.safe_after_s is not None
