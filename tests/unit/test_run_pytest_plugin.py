"""The pytest plugin as a stranger's project meets it: the fixture, the seed, JUnit XML, and the page that shows it."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

pytest_plugins = ["pytester"]
PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "run-in-ci.md").read_text(encoding="utf-8")
FAILS = """
def test_fails(bench):
    assert bench.file.open().promises.timing == "virtual"
    assert bench.seed == 5
"""


def test_the_tests_of_the_how_to_pass_and_junit_has_what_was_measured(pytester: pytest.Pytester) -> None:
    (code,) = re.findall(r"^```python\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
    pytester.makepyfile(code)
    found = pytester.runpytest_subprocess("--junitxml=report.xml", "--hil-seed", "12")
    found.assert_outcomes(passed=2)
    found.stdout.fnmatch_lines(["hil: --hil-bench brevini-hpv41 --hil-seed 12"])
    (case, _) = ET.parse(pytester.path / "report.xml").iter("testcase")
    properties = {one.attrib["name"]: one.attrib["value"] for one in case.iter("property")}
    assert (properties["hil_bench"], properties["hil_seed"]) == ("brevini-hpv41", "12")
    assert 0.0 < float(next(value for name, value in properties.items() if name.startswith("rise"))) < 500.0


def test_a_failure_tells_its_seed(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(FAILS)
    pytester.runpytest_subprocess("--hil-seed", "5", "--hil-bench", "hpv41-modbus-tcp").assert_outcomes(passed=1)
    found = pytester.runpytest_subprocess("--hil-seed", "random")
    found.assert_outcomes(failed=1)
    drawn = re.findall(r"--hil-seed (\d+)$", found.stdout.str(), re.MULTILINE)
    assert len(drawn) >= 2 and len(set(drawn)) == 1  # in the head of the session and beside the failure


def test_a_seed_that_is_none(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(FAILS)
    found = pytester.runpytest_subprocess("--hil-seed", "five")
    assert found.ret == pytest.ExitCode.USAGE_ERROR
    found.stderr.fnmatch_lines(["*--hil-seed five: a whole number below * or random*"])


def test_pytest_without_a_bench_imports_nothing_heavy(pytester: pytest.Pytester) -> None:
    pytester.makepyfile("import sys\n\ndef test():\n    assert 'numpy' not in sys.modules\n")
    pytester.runpytest_subprocess("-p", "no:hypothesispytest").assert_outcomes(passed=1)
