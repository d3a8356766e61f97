"""Runs beside the other units that the archive holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from hil.archive.archive import Search, find_runs
from hil.archive.entry import Entry
from hil.archive.place import Place
from hil.errors import SettingError
from hil.findings.batch import Batch, batch_of
from hil.findings.population import Standing, standings
from hil.findings.results import Results
from hil.record.measurement import Verdict
from hil.record.run_folder.header import read_header
from hil.record.run_folder.instruments import instruments_mark
from hil.session.kept_results import results_of_run


@dataclass(frozen=True, slots=True)
class InPopulation:
    """Runs in their population.

    Attributes:
        runs: what was asked about, a run for each unit.
        units: serial numbers of the others, each with the last of its runs.
        nameless: runs that nobody gave a serial number; they belong to no unit and are left out.
        one_bench: whether the same instruments measured all.
        standings: every value.
        batch: what several units come to against their limits; None for one unit, or where none was judged.
    """

    runs: tuple[Results, ...]
    units: tuple[str, ...]
    nameless: int
    one_bench: bool
    standings: tuple[Standing, ...]
    batch: Batch | None = None


def in_population(folders: Sequence[Path], place: Place) -> InPopulation:
    """Runs of one procedure beside the last completed run of every other unit with that procedure.

    A real unit is compared with real ones, a simulated one with simulated ones. The units that are named are a batch:
    none of them is among the others.

    Raises:
        SettingError: runs of different procedures, a run without a serial number, a unit named twice.
        FileError: not a run folder.
        ArchiveError: the index cannot be read.
    """
    runs = tuple(results_of_run(folder) for folder in folders)
    _check(runs, folders)
    known = find_runs(place, Search(procedure=runs[0].procedure), values=True)
    found = [run for run in known if _is_whole(run) and bool(run.simulated) == bool(runs[0].simulated)]
    others = {run.serial: run for run in found if run.serial and run.serial not in {one.serial for one in runs}}
    headers = [read_header(folder) for folder in folders]
    marks = {instruments_mark(header) for header in headers} | {run.instruments for run in others.values()}
    one_bench = len(marks) == 1
    placed = standings(runs, [run.values for run in others.values()], one_bench=one_bench)
    latest = {run.serial or "": header.started_utc for run, header in zip(runs, headers, strict=True)}
    batch = batch_of(runs, _first_verdicts(found, latest)) if len(runs) > 1 else None
    return InPopulation(runs, tuple(others), sum(not run.serial for run in found), one_bench, tuple(placed), batch)


def _first_verdicts(found: Sequence[Entry], latest: Mapping[str, datetime]) -> dict[str, Verdict | None]:
    """Of the first judged run of each unit, up to the run that was named."""
    first: dict[str, Verdict | None] = {}
    for run in sorted(found, key=lambda run: run.started_utc):
        if run.verdict and run.serial in latest and run.started_utc <= latest[run.serial]:
            first.setdefault(run.serial, run.verdict)
    return first


def _is_whole(run: Entry) -> bool:
    return run.outcome == "completed" and bool(run.values)


def _check(runs: Sequence[Results], folders: Sequence[Path]) -> None:
    first, seen = runs[0], set[str]()
    for run, folder in zip(runs, folders, strict=True):
        if run.procedure != first.procedure:
            raise SettingError(
                f"{folders[0]} is a run of {first.procedure or 'nothing'}, {folder} of {run.procedure or 'nothing'}; "
                "runs of one procedure can be compared"
            )
        if not run.serial:
            raise SettingError(f"{folder}: the run has no serial number; which unit is left out cannot be told")
        if run.serial in seen:
            raise SettingError(f"{folder}: unit {run.serial} is named twice; a unit counts once")
        seen.add(run.serial)
