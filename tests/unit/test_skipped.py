"""In CI a skipped test fails."""

from pathlib import Path

pytest_plugins = ["pytester"]
ROOT = Path(__file__).parents[2]
HOOKS = (ROOT / "tests" / "conftest.py").read_text(encoding="utf-8")
TESTS = """
import pytest

def test_runs():
    pass

def test_gives_up():
    pytest.skip("no server is installed")

@pytest.mark.skip(reason="not today")
def test_never():
    pass

@pytest.mark.xfail
def test_is_known_to_fail():
    assert False
"""


def test_skipped_tests_fail_where_all_are_asked_for(pytester, monkeypatch):
    pytester.makeconftest(HOOKS)
    pytester.makepyfile(TESTS, test_module="import pytest\n\npytest.importorskip('no_such_module')\n")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))  # the hooks import from the tests
    monkeypatch.delenv("HIL_TEST_ALL", raising=False)
    pytester.runpytest_subprocess().assert_outcomes(passed=1, skipped=3, xfailed=1)
    monkeypatch.setenv("HIL_TEST_ALL", "1")
    found = pytester.runpytest_subprocess("--continue-on-collection-errors")
    found.assert_outcomes(passed=1, failed=1, errors=2, xfailed=1)
    found.stdout.fnmatch_lines(["*test_gives_up was skipped: Skipped: no server is installed*"])
