"""`hil runs`: find runs again."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from hil.cli.options import Archive, Json, option
from hil.cli.printed import printed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.archive.entry import Entry

_STOPPED = ("StoppedError", "KeyboardInterrupt", "Terminated", "Halted")
_ENDINGS = {"TrippedError": "tripped", **dict.fromkeys(_STOPPED, "stopped")}
_LONGEST_ENDING = 24


def command(
    serial: str = option("", "--serial", "SN", "Runs of this unit."),
    procedure: str = option("", "--procedure", "NAME", "Runs of this procedure."),
    since: str = option("", "--since", "DATE", "From this local date on, as 2026-11-25 or with a time."),
    verdict: str = option("", "--verdict", "pass|fail|'cannot tell'", "Runs with this verdict."),
    archive: Archive = "",
    as_json: Json = False,
) -> None:
    """List the runs of the archive, the oldest first."""
    from hil import api
    from hil.cli.searches import date_of, not_entered, verdict_of

    found = api.find_runs(
        serial=serial, procedure=procedure, since=date_of(since), verdict=verdict_of(verdict), archive=archive,
        values=False, notes=not_entered,
    )  # fmt: skip
    printed(_rows(found), _table(found) if found else _no_runs_text(archive), as_json, indent=1)
    gone = sum(not run.is_of_another_host and not run.folder.is_dir() for run in found)
    if gone:
        several = "of these folders are" if gone > 1 else "of these folders is"
        typer.echo(f"hil: {gone} {several} not there any more; `hil archive rebuild` finds what was moved", err=True)


def _rows(found: Sequence[Entry]) -> list[dict[str, object]]:
    return [
        {
            "run": run.folder, "serial": run.serial or None, "operator": run.operator or None,
            "procedure": run.procedure, "started_utc": run.started_utc, "verdict": run.verdict,
            "simulated": run.simulated,
        }
        for run in found
    ]  # fmt: skip


def _ending(run: Entry) -> str:
    """`(tripped)`: how a run ended otherwise than planned, in a word; its report has the sentence."""
    from hil.archive.entry import UNFINISHED
    from hil.record.run_folder.process_liveness import is_alive
    from hil.record.run_folder.progress import progress_of

    outcome = run.outcome
    if outcome in ("completed", "written"):
        return ""
    if outcome == UNFINISHED and (progress := progress_of(run.folder)) is not None:
        return "(running)" if is_alive(progress.pid) else "(lost)"
    kind, colon, _ = outcome.partition(":")
    word = _ENDINGS.get(kind, "failed") if colon else outcome[:_LONGEST_ENDING]
    return f"({word})"


def _no_runs_text(archive: str) -> str:
    from hil.archive.place import archive_place

    place = archive_place(archive)
    return f"no runs: there is no folder {place}" if place.is_away else f"no such runs in {place}"


def _table(found: Sequence[Entry]) -> str:
    from hil.record.simulated import marked
    from hil.report.local_time import local_text
    from hil.report.terminal import aligned

    rows = [("started", "serial", "procedure", "verdict", "operator", "run")]
    for run in found:
        started = local_text(run.started_utc)
        verdict = marked(" ".join(filter(None, (run.verdict, _ending(run)))), simulated=run.simulated).lstrip()
        where = f"{run.host}:{run.folder}" if run.is_of_another_host else str(run.folder)
        rows.append((started, run.serial, run.procedure, verdict, run.operator, where))
    return "\n".join(aligned(rows))
