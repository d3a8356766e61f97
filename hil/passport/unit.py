"""The runs of one unit, read and checked before anything is issued about it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date, datetime
from pathlib import Path

from hil.errors import FileError, SettingError, option
from hil.findings.agreement import disagreements
from hil.findings.collect import findings_of, results_of
from hil.findings.results import Results
from hil.record.folder import read
from hil.record.measurement import RESULTS_FILE, Findings, Limit, Verdict, ended_as_planned, present_name
from hil.record.recording import Recording
from hil.record.run_folder.header import stated
from hil.record.run_folder.seal import Seal, check_seal
from hil.record.simulated import is_simulated
from hil.session.kept_results import results_of_run
from hil.session.limit import limits_of
from hil.session.procedure import Procedure
from hil.session.results import evaluated, judged_by, procedure_of
from hil.version import PROGRAM

_SHOWN = 5  # of what was found otherwise: a message, not a report


@dataclass(frozen=True, slots=True)
class UnitRun:
    """A run of the unit: its folder, its samples, and what was found.

    Attributes:
        folder, recording, results: of the run.
        procedure: that made it.
        limits: by which it was last judged.
        evaluated_by: the program that sealed the results; empty where an earlier version did not seal them.
        late_limits: names of limits that were given or changed after the run.
        moved: what an evaluation now finds otherwise than the results, a sentence each.
        findings_anew: everything that it finds.
    """

    folder: Path
    recording: Recording
    results: Results
    procedure: Procedure
    limits: Mapping[str, Limit]
    evaluated_by: str = ""
    late_limits: tuple[str, ...] = ()
    moved: tuple[str, ...] = ()
    findings_anew: Findings = field(default_factory=Findings)

    @property
    def findings(self) -> Findings:
        """The measured values, notes and deviations."""
        return findings_of(self.results)

    @property
    def started(self) -> datetime:
        """When it began."""
        return datetime.fromisoformat(str(self.recording.meta["started_utc"]))


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit under its serial number, with its runs in the order of time."""

    serial: str
    runs: tuple[UnitRun, ...]

    @property
    def findings(self) -> Findings:
        """Of all runs together."""
        parts = [run.findings for run in self.runs]
        return Findings(
            tuple(m for part in parts for m in part.measured),
            {},
            tuple(note for part in parts for note in part.notes),
            tuple(dict.fromkeys(deviation for part in parts for deviation in part.deviations)),
        )

    @property
    def finished(self) -> bool:
        """Whether every run ended as planned."""
        return all(ended_as_planned(run.recording.meta) for run in self.runs)

    @property
    def verdict(self) -> Verdict | None:
        """The worst of all runs; where one did not end as planned, nothing but a miss is proven."""
        worst = self.findings.verdict
        return worst if self.finished or worst == "fail" else "cannot tell"

    @property
    def valve(self) -> str:
        """Its type, as the bench file names it."""
        return stated(self.runs[0].recording.meta, "valve", "name") or self.runs[0].results.procedure

    @property
    def plant(self) -> str:
        """The plant or model that the bench file names for it; empty where it names none."""
        return stated(self.runs[0].recording.meta, "valve", "plant")

    @property
    def simulated(self) -> bool:
        """Whether any of its runs was made on a simulated valve."""
        return any(is_simulated(run.recording.meta) for run in self.runs)

    @property
    def dates(self) -> tuple[date, date]:
        """First and last day, UTC."""
        return self.runs[0].started.date(), self.runs[-1].started.date()


def read_unit_runs(folders: Sequence[Path], *, also_moved: bool = False) -> Unit:
    """The runs of one unit, each held together with its seal and evaluated anew.

    Args:
        folders: of the runs.
        also_moved: take runs too of which an evaluation now finds something else; they say what.

    Raises:
        FileError: not a run folder, one that was changed, or one whose results are not what its samples say.
        UnknownNameError: a procedure that is not installed here, so that nobody can tell.
        SettingError: a run without a serial number, or runs of different units.
    """
    runs = sorted((_run(folder, also_moved) for folder in folders), key=lambda run: run.started)
    serials = {_serial(run) for run in runs}
    if len(serials) > 1:
        raise SettingError(f"a passport is of one unit; these runs are of {', '.join(sorted(serials))}")
    return Unit(serials.pop(), tuple(runs))


def _run(folder: Path, also_moved: bool) -> UnitRun:
    recording = read(folder)
    seal = check_seal(folder)
    limits = judged_by(recording, folder)
    procedure = procedure_of(recording)
    found = evaluated(procedure, recording, limits)
    results = results_of(recording, found)
    kept = results_of_run(folder) if (folder / RESULTS_FILE).is_file() else results
    same_program = kept is results or (seal is not None and seal.program == PROGRAM)
    moved = tuple(disagreements(kept, results, words=same_program))
    late = () if seal is None else _late(recording, seal)
    run = UnitRun(folder, recording, kept, procedure, limits, _evaluator(seal, kept is results), late, moved, found)
    if moved and not also_moved:
        raise FileError(_refusal(run, same_program))
    return run


def _evaluator(seal: Seal | None, now: bool) -> str:
    return PROGRAM if now else "" if seal is None else seal.program


def _late(recording: Recording, seal: Seal) -> tuple[str, ...]:
    first = {present_name(name): limit for name, limit in limits_of(recording.meta).items()}
    return tuple(name for name, limit in seal.limits.items() if first.get(present_name(name)) != limit)


def _refusal(run: UnitRun, same_program: bool) -> str:
    folder, moved = run.folder, run.moved
    shown = "; ".join(moved[:_SHOWN]) + (f"; and {len(moved) - _SHOWN} more" if len(moved) > _SHOWN else "")
    if same_program:
        remedy = f"`hil report {folder}` evaluates it again"
        return f"{folder}: results.json is not what the samples of the run say: {shown}; {remedy}"
    maker = run.evaluated_by or "an earlier version, which did not seal its results"
    return (
        f"{folder}: evaluated by {maker}, and now by {PROGRAM}, with another result: {shown}; "
        f"{option('evaluated-anew')} takes what is found now, and page one names both versions"
    )


def _serial(run: UnitRun) -> str:
    serial = stated(run.recording.meta, "valve", "serial")
    if not serial:
        raise SettingError(
            f"{run.folder}: says not which unit it is of; a passport needs a run made with {option('serial', 'SN')}"
        )
    return serial
