"""Runs: made on a bench, and found again."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hil.api.bench import bench_of
from hil.api.callbacks import NOTHING, Notes, unsaid
from hil.errors import options_of
from hil.record.run_folder.progress import Progress, quiet
from hil.session.several import several

if TYPE_CHECKING:
    from hil.archive.entry import Entry
    from hil.bench.read import BenchFile
    from hil.bench.rig import BenchRig
    from hil.findings.results import Results
    from hil.safety.outputs import Outputs
    from hil.session.outcome import Outcome
    from hil.session.procedure import Procedure


@options_of("python")
def run(
    procedure: str | Procedure,
    bench: str | Path | BenchFile,
    out: str | Path,
    *,
    limits: str | Iterable[str] = (),
    serial: str = "",
    operator: str = "",
    notes: Mapping[str, str] = NOTHING,
    resets: str | Iterable[str] = (),
    resume: str | Path | None = None,
    archive: str | Path = "",
    cause_s: float = 120.0,
    progress: Progress = quiet,
    outputs: Outputs | None = None,
    settings: Mapping[str, Any] = NOTHING,
    **named: Any,
) -> Outcome:
    """Run a procedure on a bench and evaluate it (`hil run`); outputs are safe before this returns.

    Args:
        procedure: its name, or the procedure itself.
        bench: bench file, or the name of an installed one, or what was read from it.
        out: run folder to make.
        limits: `NAME=LOW..HIGH`, as on the command line.
        serial: serial number of the unit.
        operator: who runs it.
        notes: what else is to be known.
        resets: interlocks whose trips are forgotten first.
        resume: go on where this run was broken off, with its settings.
        progress: called with how far it is.
        archive: where an earlier run of a unit that did not pass is looked for; else `HIL_ARCHIVE`, else `./runs`.
        cause_s: time that the cause of a missed certificate is looked for, once its verdict is on disk; 0: it is not.
        outputs: kept up to what is known of the outputs, for somebody who asks for it when this failed.
        settings: by name, as values or as text as on the command line.
        named: settings by their own names.

    Returns:
        The `findings`, the `folder`, the path of the `report`.
    """
    from hil.session.labels import labels_of
    from hil.session.limit import split_limits
    from hil.session.procedure import load_procedure
    from hil.session.run import run_procedure

    chosen = load_procedure(procedure) if isinstance(procedure, str) else procedure
    labels = labels_of(serial, operator, [f"{key}={value}" for key, value in notes.items()])
    return run_procedure(
        chosen, bench_of(bench), {**settings, **named}, Path(out), progress, several(resets),
        split_limits(several(limits)),
        None if resume is None else Path(resume), outputs, labels, archive=str(archive), cause_s=cause_s,
    )  # fmt: skip


@contextmanager
def open_bench(bench: str | Path, out: str | Path, *, progress: Progress = quiet) -> Iterator[BenchRig]:
    """A bench to drive by hand, through its guard and into a run folder; outputs are safe before and after.

    Args:
        bench: bench file, or the name of an installed one.
        out: run folder to make.
        progress: called with how far it is, where the code inside says so.
    """
    from hil.bench.audit import on_the_trail
    from hil.bench.open import open_rig

    file = bench_of(bench)
    with options_of("python"), open_rig(file, Path(out), {}, progress, within=on_the_trail(file, Path(out), {})) as rig:
        yield rig


@options_of("python")
def results(run: str | Path) -> Results:
    """Every value, curve and transfer function of a run (`hil results`)."""
    from hil.session.kept_results import results_of_run

    return results_of_run(Path(run))


@options_of("python")
def find_runs(
    *,
    serial: str = "",
    procedure: str = "",
    since: datetime | None = None,
    verdict: str = "",
    archive: str | Path = "",
    values: bool = True,
    notes: Notes = unsaid,
) -> list[Entry]:
    """Runs of the archive, the oldest first (`hil runs`).

    Args:
        serial: of one unit.
        procedure: of one procedure.
        since: from this time on.
        verdict: with this verdict.
        archive: folder or URL; else `HIL_ARCHIVE`, else `./runs`.
        values: whether their measured values are wanted.
        notes: called with why runs that wait to be entered could not be entered.
    """
    from hil.archive.archive import Search
    from hil.archive.archive import find_runs as found
    from hil.archive.pending import searched

    wanted = Search(serial, procedure.replace("-", "_"), since, verdict)
    return searched(str(archive), lambda place: found(place, wanted, values=values), notes)
