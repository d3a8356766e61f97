"""Pytest plugin: the fixture `bench`, a simulated bench in virtual time, for tests of procedures and of valves.

    def test_bandwidth(bench):
        outcome = bench.run("frequency_response", amplitudes=(10,), limits=["bandwidth_3db=1.."])
        assert outcome.findings.verdict == "pass"

`--hil-bench` names the bench file (of a real bench its twin is taken), `--hil-seed` the seed of the noise; both are
printed, and stand as properties in JUnit XML with everything that was measured, its uncertainty, limits and verdicts.
What a run found is printed as `hil run` prints it, and so shown when the test fails.

An assertion on a verdict or an exit status says which limit was missed, and by how much. A test whose run *cannot tell*
is an error, one whose run *fails* a failure: CI systems show and count the two apart, and both make the job red.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from hil.record.run_folder.progress import quiet

if TYPE_CHECKING:
    from hil.bench.read import BenchFile
    from hil.bench.rig import BenchRig
    from hil.session.outcome import Outcome

DEFAULT_BENCH = "brevini-hpv41"
_MOST, _SEED = 1 << 31, "hil_seed"
_BENCH = pytest.StashKey["SimulatedBench"]()  # of the test that is running
_CANNOT_TELL = "cannot tell"
_NOT_PASSED = ("fail", _CANNOT_TELL)
_WHEN = "verdict"  # instead of `call`: what fails in another phase than the call is an error, also in JUnit XML


class SimulatedBench:
    """A simulated bench for one test. Every run on it begins with a new one.

    Attributes:
        file: the bench file, its devices simulated in virtual time.
        seed: of the noise.
        outcomes: of its runs, in their order.
        unproven: whether an assertion failed on a verdict that cannot be told.
    """

    def __init__(self, file: BenchFile, seed: int, folder: Path, note: Callable[[str, object], None]) -> None:
        self.file = file
        self.seed = seed
        self._folder = folder
        self._note = note
        self._runs = 0
        self.outcomes: list[Outcome] = []
        self.unproven = False

    def run(self, procedure: str, limits: Iterable[str] = (), **settings: Any) -> Outcome:
        """Run a procedure and evaluate it.

        Args:
            procedure: its name.
            limits: `NAME=LOW..HIGH` as on the command line; they go before those of the bench file.
            settings: as values, or as text as on the command line.

        Raises:
            HilError: what `hil run` would have said.
        """
        from hil.session.limit import split_limits
        from hil.session.procedure import load_procedure
        from hil.session.run import run_procedure

        outcome = run_procedure(
            load_procedure(procedure), self.file, settings, self._next_folder(procedure), limits=split_limits(limits)
        )
        self.outcomes.append(outcome)
        self._tell(procedure, outcome)
        return outcome

    def reasons(self, verdict: str) -> list[str]:
        """What kept its runs from passing, a sentence for each limit; empty when none ended with that verdict."""
        from hil.report.results import reasons

        judged = [one.findings for one in self.outcomes if one.findings.verdict == verdict]
        return [reason for findings in judged for reason in reasons(findings)]

    def rig(self) -> AbstractContextManager[BenchRig]:
        """The rig itself, to be driven by the test: `with bench.rig() as rig: rig.play(…)`."""
        from hil.bench.open import open_rig

        return open_rig(self.file, self._next_folder("rig"), {}, quiet)

    def _tell(self, procedure: str, outcome: Outcome) -> None:
        from hil.record.measurement import COVERAGE_FACTOR
        from hil.report.number import limits_text
        from hil.report.terminal import findings_text

        findings = outcome.findings
        print(f"{procedure}:\n{findings_text(findings, simulated=outcome.simulated)}")
        for found in findings.measured:
            bound = "" if found.relation == "=" else f"{found.relation} "
            if found.value is not None:
                self._note(f"{found.name} [{found.unit}]", f"{bound}{found.value}")
            if found.std is not None and not bound:
                self._note(f"{found.name} U (k = 2) [{found.unit}]", COVERAGE_FACTOR * found.std)
            if found.verdict is not None:
                self._note(f"{found.name} limits [{found.unit}]", limits_text(found.low, found.high))
                self._note(f"{found.name} verdict", found.verdict)
        self._note(f"{procedure} verdict", findings.verdict or "none")

    def _next_folder(self, name: str) -> Path:
        self._runs += 1
        return self._folder / f"{self._runs}-{name}"


def pytest_addoption(parser: pytest.Parser) -> None:
    """The options of the plugin."""
    group = parser.getgroup("hil", "simulated bench (valve-hil)")
    which = "bench file or name of an installed bench for the fixture `bench`; default %(default)s"
    group.addoption("--hil-bench", metavar="BENCH.toml", default=DEFAULT_BENCH, help=which)
    noise = "seed of its noise: a number, or `random` for another one each time; default: that of the bench file"
    group.addoption("--hil-seed", metavar="N", default="", help=noise)


def pytest_configure(config: pytest.Config) -> None:
    """Draw the seed, once for the whole session; a worker of pytest-xdist takes the one that was drawn for all."""
    shared = getattr(config, "workerinput", {}).get(_SEED)
    asked = config.getoption("--hil-seed") if shared is None else shared
    if shared is not None:
        config.option.hil_seed = shared
    elif asked == "random":
        config.option.hil_seed = str(secrets.randbelow(_MOST))
    elif asked and not (asked.isdecimal() and int(asked) < _MOST):
        raise pytest.UsageError(f"--hil-seed {asked}: a whole number below {_MOST}, or random")


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: Any) -> None:
    """Give a worker of pytest-xdist the seed of the session."""
    node.workerinput[_SEED] = node.config.getoption("--hil-seed")


def pytest_report_header(config: pytest.Config) -> list[str]:
    """Say how the noise can be had again, where it was chosen."""
    seed = config.getoption("--hil-seed")
    return [f"hil: --hil-bench {config.getoption('--hil-bench')} --hil-seed {seed}"] if seed else []


def pytest_assertrepr_compare(config: pytest.Config, op: str, left: object, right: object) -> list[str] | None:
    """Say which limit was missed where a verdict or an exit status of a run is not what was asserted."""
    bench = config.stash.get(_BENCH, None)
    if bench is None or not bench.outcomes:
        return None
    last = bench.outcomes[-1]
    verdict = _verdict_in(op, left, right) or (_is_about(last.exit_status, op, left, right) and last.findings.verdict)
    if verdict and (reasons := bench.reasons(verdict)):
        bench.unproven = verdict == _CANNOT_TELL
        return [*reasons, f"{left!r} {op} {right!r}"]
    return None


def _verdict_in(op: str, left: object, right: object) -> str:
    """The verdict that kept a comparison of words from holding; empty where it is about something else."""
    words = [one for one in (left, right) if isinstance(one, str)]
    of_words = "pass" in words if op == "==" else op in ("!=", "in", "not in")
    return next((word for word in words if of_words and word in _NOT_PASSED), "")


def _is_about(status: int, op: str, left: object, right: object) -> bool:
    """Whether a comparison that does not hold asked for another exit status than that of the run."""
    numbers = [one for one in (left, right) if isinstance(one, int)]
    return op in ("==", "!=") and len(numbers) == 2 and status in numbers


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Generator[None, Any, Any]:
    """Make a test that asserted a verdict which cannot be told an error."""
    report = yield
    bench = item.config.stash.get(_BENCH, None)
    if bench is not None and bench.unproven and call.when == "call" and report.failed:
        report.when = _WHEN
    return report


def pytest_report_teststatus(report: Any) -> tuple[str, str, str] | None:
    """Call it by its name."""
    return ("error", "E", "CANNOT TELL") if report.when == _WHEN else None


@pytest.fixture
def bench(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[SimulatedBench]:
    """A simulated bench in virtual time; prints its seed, which is shown when the test fails."""
    from hil.bench.find import find_bench
    from hil.bench.read import read_bench
    from hil.bench.rehearsal import twin_of

    name = request.config.getoption("--hil-bench")
    asked = request.config.getoption("--hil-seed")
    file = read_bench(find_bench(name))
    seed = int(asked) if asked else int(file.bench.simulation.get("seed", 0))
    print(f"hil: bench {name}, seed {seed}; again with --hil-bench {name} --hil-seed {seed}")
    properties = request.node.user_properties
    properties += [("hil_bench", name), ("hil_seed", seed), ("hil_simulated", "true")]
    made = SimulatedBench(
        twin_of(file, seed), seed, tmp_path / "runs", lambda what, value: properties.append((what, value))
    )
    request.config.stash[_BENCH] = made
    yield made
    del request.config.stash[_BENCH]
