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


def imported_by(program: str) -> set[str]:
    """The modules that a process of its own has imported at the end of a program."""
    done = subprocess.run(
        [sys.executable, "-c", f"import sys\ntry:\n    {program}\nfinally:\n    print(*sys.modules, file=sys.stderr)"],
        capture_output=True, encoding="utf-8", check=True, timeout=1800,
    )  # fmt: skip
    return set(done.stderr.splitlines()[-1].split())


def command(arguments: str) -> str:
    return f"sys.argv = ['hil', *{arguments.split()!r}]; from hil.__main__ import main; main()"


@pytest.mark.parametrize("arguments", COMMANDS)
def test_little_and_nothing_heavy_is_imported(arguments):
    """What takes its time are imports, so they are counted; `make bench` has the seconds (0.3 on an idle machine)."""
    imported = imported_by(command(arguments))
    assert imported.isdisjoint(HEAVY), f"imported: {sorted(imported & set(HEAVY))}"
    ours = {name for name in imported if name.partition(".")[0] in ("hil", "drivers", "sim_devices", "procedures")}
    assert len(ours) <= 84, sorted(ours)
    assert len(imported) <= 400, sorted(imported)


BENCH = {"hil.bench", "hil.daq", "hil.report"}


@pytest.mark.parametrize(
    ("program", "unneeded", "needed"),
    [
        (command("check brevini-hpv41"), {"hil.identification"}, {"numpy"}),  # no compiler
        ("import hil.session.run_comparison, hil.session.kept_results", BENCH | {"hil.identification", "hil.safety"},
         {"numpy"}),
        ("import hil.session.comparison", BENCH | {"hil.findings"}, {"numba", "numpy", "scipy"}),
    ],
)  # fmt: skip
def test_what_is_not_needed_is_not_imported(program, unneeded, needed):
    assert imported_by(program).isdisjoint({*HEAVY, *unneeded} - needed)


def test_a_command_that_is_asked_for_imports_no_other():
    imported = imported_by(command("--debug list"))
    assert {name for name in imported if name.startswith("hil.cli.commands.")} == {"hil.cli.commands.list_"}


def test_listing_shows_everything_with_a_summary(prints):
    lines = prints("list").splitlines()
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
def test_one_kind(kind, prints):
    listed = prints("list", kind)
    assert [line.split()[0] for line in listed.splitlines()] == [entry.name for entry in entries(kind)]
