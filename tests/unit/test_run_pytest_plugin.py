"""The pytest plugin as a stranger's project meets it: the fixture, the seed, JUnit XML, and the page that shows it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

import pytest

pytest_plugins = ["pytester"]
PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "run-in-ci.md").read_text(encoding="utf-8")
MISSED = """
def test_misses(bench):
    assert bench.run("step_response", limits=["rise=..1"]).exit_status == 0
"""
VERDICTS = """
def test_fails(bench):
    assert bench.run("step_response", limits=["rise=..1"], levels=(0, 80)).findings.verdict == "pass"

def test_other_words(bench):
    found = bench.run("step_response", limits=["rise=..1"], levels=(0, 80))
    said = []
    for other in ("!=", "in", "not in", "status"):
        try:
            if other == "!=":
                assert found.findings.verdict != "fail"
            if other == "in":
                assert found.findings.verdict in ["pass", None]
            if other == "not in":
                assert found.findings.verdict not in ("fail",)
            assert found.exit_status != 1
        except AssertionError as error:
            said.append(str(error))
    assert len(said) == 4 and all("it is missed by" in one for one in said), said

def test_cannot_tell(bench):
    outcome = bench.run("step_response", limits=["overshoot=0.1.."], levels=(0, 80))
    assert "pass" == outcome.findings.verdict

def test_other_assertions_are_failures(bench):
    bench.run("step_response", limits=["overshoot=0.1.."], levels=(0, 80))
    assert 1 + 1 == 3
"""
SEEN = """
import pytest

@pytest.mark.parametrize("n", range(4))
def test_sees(bench, worker_id, n):
    print("worker", worker_id, "seed", bench.seed)

def test_fails(bench):
    assert bench.file.open().promises.timing == "virtual"
    assert bench.seed < 0
"""


def test_the_how_to_passes_a_limit_is_missed_and_junit_has_what_was_measured(pytester):
    (code,) = re.findall(r"^```python\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
    pytester.makepyfile(test_how_to=code, test_missed=MISSED, test_verdicts=VERDICTS)
    found = pytester.runpytest_subprocess("--junitxml=report.xml", "--hil-seed", "12")
    found.assert_outcomes(passed=3, failed=3, errors=1)
    found.stdout.fnmatch_lines(["hil: --hil-bench brevini-hpv41 --hil-seed 12"])
    cases = {case.attrib["name"]: case for case in ET.parse(pytester.path / "report.xml").iter("testcase")}
    properties = [{one.attrib["name"]: one.attrib["value"] for one in case.iter("property")} for case in cases.values()]
    measured, _, missed, *_ = properties
    assert (measured["hil_bench"], measured["hil_seed"]) == ("brevini-hpv41", "12")
    rise = next(name for name in measured if name.startswith("rise") and name.endswith("[ms]"))
    place = rise.removesuffix(" [ms]")
    assert 0.0 < float(measured[rise]) < 500.0
    assert (measured[f"{place} limits [ms]"], measured[f"{place} verdict"]) == ("≤ 500", "pass")
    assert measured["step_response verdict"] == "pass"
    found.stdout.fnmatch_lines(
        ["rise*ms*≤ 1*fail", "Fail: rise*limit ≤ 1 ms: it is missed by*", "verdict: fail (SIMULATED)"]
    )
    assert missed["step_response verdict"] == "fail"
    limits_are_said_and_what_cannot_be_told_is_an_error(found, cases)


def limits_are_said_and_what_cannot_be_told_is_an_error(found: pytest.RunResult, cases: Mapping[str, Element]) -> None:
    found.stdout.fnmatch_lines([
        "E*AssertionError: assert Cannot tell: overshoot at 0 → 80 % is < * %, limit ≥ 0.1 %: a bound, *",
        "E*AssertionError: assert Fail: rise at 0 → 80 % is * ms, limit ≤ 1 ms: it is missed by *",
        "FAILED *test_fails*",
        "CANNOT TELL *test_cannot_tell*",
    ])  # fmt: skip
    kinds = {name: [one.tag for one in case if one.tag in ("failure", "error")] for name, case in cases.items()}
    assert kinds.items() >= {"test_fails": ["failure"], "test_cannot_tell": ["error"]}.items()
    assert kinds["test_other_assertions_are_failures"] == ["failure"]
    assert "Cannot tell: overshoot at 0 → 80 %" in str(cases["test_cannot_tell"].find("error").attrib["message"])
    told = {one.attrib["name"]: one.attrib["value"] for one in cases["test_cannot_tell"].iter("property")}
    assert told["hil_simulated"] == "true"
    assert re.fullmatch(r"< 0\.\d+", told["overshoot, 0 → 80 % [%]"]), "a bound is none where it stands as a value"
    assert "overshoot, 0 → 80 % U (k = 2) [%]" not in told
    assert 0.0 < float(told["rise, 0 → 80 % U (k = 2) [ms]"]) < 0.1 * float(told["rise, 0 → 80 % [ms]"])


def test_workers_share_the_seed_that_is_printed_and_a_failure_tells_it(pytester):
    pytester.makepyfile(SEEN)
    asked = ("-n", "2", "--hil-seed", "random", "--hil-bench", "hpv41-modbus-tcp", "-rP")
    found = pytester.runpytest_subprocess(*asked)
    found.assert_outcomes(passed=4, failed=1)
    drawn = re.findall(r"--hil-seed (\d+)$", found.stdout.str(), re.MULTILINE)
    assert len(drawn) >= 2  # in the head of the session and beside the failure
    (printed,) = set(drawn)
    seen = re.findall(r"worker (\w+) seed (\d+)", found.stdout.str())
    assert {seed for _, seed in seen} == {printed}
    assert {worker for worker, _ in seen} == {"gw0", "gw1"}
    assert "bench.seed < 0" in found.stdout.str()  # what failed: the bench was a twin in virtual time


def test_a_seed_that_is_none(pytester):
    pytester.makepyfile(SEEN)
    found = pytester.runpytest_subprocess("--hil-seed", "five")
    assert found.ret == pytest.ExitCode.USAGE_ERROR
    found.stderr.fnmatch_lines(["*--hil-seed five: a whole number below * or random*"])


def test_pytest_without_a_bench_imports_nothing_heavy(pytester):
    pytester.makepyfile("import sys\n\ndef test():\n    assert 'numpy' not in sys.modules\n")
    pytester.runpytest_subprocess("-p", "no:hypothesispytest").assert_outcomes(passed=1)
