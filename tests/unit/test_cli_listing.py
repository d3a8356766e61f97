"""`hil --help` and `hil list` answer at once: everything that is installed, and nothing heavy imported for it."""

from __future__ import annotations

import subprocess
import sys

import pytest

from hil.bench.find import benches
from hil.catalog import KINDS, entries, models, tables
from hil.description.find import descriptions

# typer brings pydantic and its own needs; none of these is its.
HEAVY = (
    "asammdf", "can", "canopen", "control", "dask", "distributed", "h5py", "jinja2", "matplotlib", "nidaqmx", "nptdms",
    "numba", "numpy", "pandas", "pint", "pyarrow", "pymodbus", "rich.progress", "scipy", "serial",
)  # fmt: skip
COMMANDS = ["--help", "--version", "list", "run --help", "identify --help", "diagnose --help"]


def run_hil(arguments: str) -> subprocess.CompletedProcess[str]:
    """`hil ARGUMENTS` in a process of its own; the last line on stderr names the modules that it imported."""
    program = (
        "import sys\n"
        f"sys.argv = ['hil', *{arguments.split()!r}]\n"
        "from hil.__main__ import main\n"
        "try:\n    main()\n"
        "finally:\n    print(' '.join(sys.modules), file=sys.stderr)\n"
    )
    return subprocess.run(
        [sys.executable, "-c", program], capture_output=True, encoding="utf-8", check=False, timeout=1800
    )


@pytest.mark.parametrize("arguments", COMMANDS)
def test_nothing_heavy_is_imported(arguments: str) -> None:
    done = run_hil(arguments)
    imported = set(done.stderr.splitlines()[-1].split())
    assert done.returncode == 0
    assert imported.isdisjoint(HEAVY), f"imported: {sorted(imported & set(HEAVY))}"


def test_a_check_needs_no_compiler() -> None:
    done = run_hil("check brevini-hpv41")
    assert done.returncode == 0, done.stderr
    assert set(done.stderr.splitlines()[-1].split()).isdisjoint({*HEAVY, "hil.identification"} - {"numpy"})


def test_kept_results_need_no_bench_and_no_page() -> None:
    program = "import sys, hil.session.run_comparison, hil.session.kept_results; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, encoding="utf-8", check=True)
    others = {"hil.bench", "hil.daq", "hil.identification", "hil.report", "hil.safety"}
    assert set(done.stdout.split()).isdisjoint({*HEAVY, *others} - {"numpy"})


def test_a_model_beside_recordings_needs_no_page_and_no_bench() -> None:
    program = "import sys, hil.session.comparison; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, encoding="utf-8", check=True)
    compiler = {"numba", "numpy", "scipy"}
    assert set(done.stdout.split()).isdisjoint(
        {*HEAVY, "hil.bench", "hil.daq", "hil.findings", "hil.report"} - compiler
    )


def test_listing_shows_everything_with_a_summary() -> None:
    done = run_hil("list")
    lines = done.stdout.splitlines()
    for kind in KINDS:
        start = lines.index(f"{kind}:") + 1
        here = lines[start : start + len(entries(kind))]
        for entry, line in zip(entries(kind), here, strict=True):
            assert line.split(maxsplit=1) == [entry.name, entry.summary]
    files = {"benches": benches(), "descriptions": descriptions(), "models": models(), "tables": tables()}
    for kind, found in files.items():
        start = lines.index(f"{kind}:") + 1
        here = lines[start : start + len(found)]
        assert [line.split()[0] for line in here] == list(found)
        assert all(len(line.split()) > 1 for line in here), "an entry without a summary"
    counted = sum(len(entries(kind)) for kind in KINDS) + sum(map(len, files.values()))
    assert len(lines) == len(KINDS) + len(files) + counted


@pytest.mark.parametrize("kind", KINDS)
def test_one_kind(kind: str) -> None:
    done = run_hil(f"list {kind}")
    assert [line.split()[0] for line in done.stdout.splitlines()] == [entry.name for entry in entries(kind)]


@pytest.mark.parametrize("arguments", COMMANDS)
def test_it_imports_little(arguments: str) -> None:
    """What takes its time are imports, so they are counted; `make bench` has the seconds (0.3 on an idle machine)."""
    imported = set(run_hil(arguments).stderr.splitlines()[-1].split())
    ours = {name for name in imported if name.partition(".")[0] in ("hil", "drivers", "sim_devices", "procedures")}
    assert len(ours) <= 84, sorted(ours)
    assert len(imported) <= 400, sorted(imported)
