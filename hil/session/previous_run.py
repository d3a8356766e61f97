"""What changed since an earlier run of the same unit: looked up in the archive when a certificate is not a pass."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from hil.errors import ArchiveError, InputError
from hil.findings.collect import results_of
from hil.findings.difference import Difference, differences
from hil.findings.results import Results, read_results
from hil.record.measurement import RESULTS_FILE, Findings, is_accepted
from hil.record.previous_run import Missed, Moved, PreviousRunComparison
from hil.record.recording import Recording
from hil.record.run_folder.header import read_header, stated
from hil.record.run_folder.instruments import instruments_mark
from hil.session.procedure import Procedure

if TYPE_CHECKING:
    from hil.archive.entry import Entry


def with_earlier(
    procedure: Procedure, recording: Recording, findings: Findings, folder: Path, archive: str
) -> Findings:
    """The findings of a unit that did not pass, with what changed since an earlier run of its serial number.

    The latest that passed is taken, else the latest. No archive, or none of this unit in it, changes nothing.

    Args:
        procedure: of the run; only one that certifies a unit asks.
        recording: of the run.
        findings: judged.
        folder: of the run.
        archive: folder or URL; else `HIL_ARCHIVE`, else `./runs`.
    """
    serial = stated(recording.meta, "valve", "serial")
    if not procedure.certificate or not serial or is_accepted(findings.verdict):
        return findings
    with suppress(ArchiveError, InputError, OSError):
        if (entry := earlier_run(archive, serial, procedure.name, recording, folder)) is not None:
            return replace(findings, since=_compared(entry, results_of(recording, findings), folder))
    return findings


def earlier_run(archive: str, serial: str, procedure: str, recording: Recording, folder: Path) -> Entry | None:
    """The latest run of the unit that passed, else the latest; None where the archive has none."""
    from hil.archive.archive import Search, find_runs
    from hil.archive.place import archive_place

    begun = datetime.fromisoformat(str(recording.meta["started_utc"]))
    found = [
        run
        for run in find_runs(archive_place(archive), Search(serial, procedure))
        if run.folder != folder.resolve() and run.started_utc < begun and is_here(run)
    ]
    passed = [run for run in found if run.verdict == "pass"]
    return next(reversed(passed or found), None)


def is_here(run: Entry) -> bool:
    """Whether its folder is here with its results; on another computer the same path may be another run."""
    if not (run.folder / RESULTS_FILE).is_file():
        return False
    return not run.is_of_another_host or read_header(run.folder).started_utc == run.started_utc


def _compared(entry: Entry, now: Results, folder: Path) -> PreviousRunComparison:
    then = read_results(entry.folder / RESULTS_FILE)
    one_bench = instruments_mark(read_header(entry.folder)) == instruments_mark(read_header(folder))
    found = differences(_with_figures(then), _with_figures(now), one_bench=one_bench)
    moved = sorted((one for one in found if one.meaning == "differs"), key=lambda one: _weight(one, now), reverse=True)
    return PreviousRunComparison(
        entry.folder.name, entry.started_utc, entry.verdict,
        tuple(Moved(one.first, one.second) for one in moved if one.first and one.second),
        _count(found, "within uncertainty"), _count(found, "cannot tell"), one_bench,
        tuple(_missed(differences(then, now, one_bench=one_bench))),  # as judged, not the figures of the condition
    )  # fmt: skip


def _missed(found: Sequence[Difference]) -> Iterator[Missed]:
    """A change has the scatter that a repeat of the unit of then would have about its value of then."""
    for one in found:
        if one.first is None or one.second is None or one.second.verdict != "fail":
            continue
        if one.first.value is None or one.std is None:
            continue
        if (probability := one.second.fail_probability(one.first.value, one.std)) is not None:
            yield Missed(one.first, probability)


def _with_figures(results: Results) -> Results:
    """The results with the figures of the valve's condition before the values that they rest on."""
    named = {figure.name for figure in results.figures}
    return results.model_copy(
        update={"values": (*results.figures, *(v for v in results.values if v.name not in named))}
    )


def _weight(one: Difference, now: Results) -> tuple[bool, bool, float]:
    """Figures of the condition first, then what keeps the unit from passing, then the rest; the surest first."""
    missed = one.second is not None and one.second.verdict in ("fail", "cannot tell")
    return one.name in {figure.name for figure in now.figures}, missed, abs(one.change or 0.0) / (one.std or math.inf)


def _count(found: Sequence[Difference], meaning: str) -> int:
    return sum(one.meaning == meaning for one in found)
