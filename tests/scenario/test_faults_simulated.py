"""Every fault at every moment on the simulated DAQ: outputs safe in time, records kept, one line says why."""

import pytest

from tests import faults_on_links
from tests.fault_page import PAGE, cells
from tests.faults import Case
from tests.faults_simulated import CASES, MOMENTS, measure

LONGEST_BLOCK = 100  # samples: the first look at the bench


@pytest.mark.parametrize("case", CASES, ids=str)
def test_outputs_are_safe_and_nothing_recorded_is_lost(case, tmp_path):
    seen = measure(case, tmp_path)
    print(seen)
    assert case.says in seen.message
    if case.within_s is None:
        moved = case.moment != "before anything moves"
        assert (seen.safe_after_s is None) == moved
    else:
        assert seen.safe_after_s is not None and seen.safe_after_s <= case.within_s
        if case.fault not in ("Ctrl-C", "SIGTERM", "SIGHUP", "SIGQUIT"):
            assert seen.status == (3 if seen.message and not seen.message.startswith("event") else 0)
    if case.within_s is None:
        assert seen.status == 3 and "NOT SAFE" in seen.message
    assert seen.lost is not None
    if case.fault != "disk full":  # cannot be recorded
        assert 0 <= seen.lost <= LONGEST_BLOCK
    assert seen.samples > 0 or case.moment == "before anything moves"


def test_without_a_fault_the_course_is_as_the_moments_say(tmp_path):
    seen = measure(Case("", "none", "while it stands", None, ""), tmp_path)
    assert (seen.message, seen.lost) == ("", 0)
    assert max(MOMENTS.values()) < seen.samples / 1000.0


def test_the_page_has_just_these_cases_and_what_it_says_was_measured_keeps_what_is_promised():
    measured = cells(PAGE.read_text(encoding="utf-8"))
    cases = {str(case): case for case in (*CASES, *faults_on_links.CASES)}
    assert set(measured) == set(cases)
    for name, case in cases.items():
        after = measured[name].removesuffix(" NOT SAFE")
        if case.within_s is None:
            assert after == "–" or case.moment == "before anything moves", name
        else:
            assert float(after) <= case.within_s, name
