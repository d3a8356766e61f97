"""The runs of one unit, read and checked before anything is issued about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, datetime
from pathlib import Path

from hil.errors import FileError, SettingError
from hil.findings.collect import findings_of
from hil.findings.results import Results
from hil.record.folder import read
from hil.record.measurement import Findings, Verdict, ended_as_planned, judge, unproven
from hil.record.recording import Recording
from hil.record.simulated import is_simulated
from hil.session.results import results_of_run


@dataclass(frozen=True, slots=True)
class UnitRun:
    """A run of the unit: its folder, its samples, and what was found."""

    folder: Path
    recording: Recording
    results: Results

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
        return str((self.runs[0].recording.meta.get("valve") or {}).get("name") or self.runs[0].results.procedure)

    @property
    def plant(self) -> str:
        """The plant or model that the bench file names for it; empty where it names none."""
        return str((self.runs[0].recording.meta.get("valve") or {}).get("plant") or "")

    @property
    def simulated(self) -> bool:
        """Whether any of its runs was made on a simulated valve."""
        return any(is_simulated(run.recording.meta) for run in self.runs)

    @property
    def dates(self) -> tuple[date, date]:
        """First and last day, UTC."""
        return self.runs[0].started.date(), self.runs[-1].started.date()


def read_unit_runs(folders: Sequence[Path]) -> Unit:
    """The runs of one unit.

    Raises:
        FileError: not a run folder, one that was changed, or one whose results are not of it.
        SettingError: a run without a serial number, or runs of different units.
    """
    runs = sorted((_run(folder) for folder in folders), key=lambda run: run.started)
    serials = {_serial(run) for run in runs}
    if len(serials) > 1:
        raise SettingError(f"a passport is of one unit; these runs are of {', '.join(sorted(serials))}")
    return Unit(serials.pop(), tuple(runs))


def _run(folder: Path) -> UnitRun:
    recording = read(folder)
    results = results_of_run(folder)
    _check_own(folder, recording, results)
    _check_judged(folder, results, ended_as_planned(recording.meta))
    return UnitRun(folder, recording, results)


def _serial(run: UnitRun) -> str:
    serial = str((run.recording.meta.get("valve") or {}).get("serial") or "")
    if not serial:
        raise SettingError(f"{run.folder}: says not which unit it is of; a passport needs a run made with --serial SN")
    return serial


def _check_own(folder: Path, recording: Recording, results: Results) -> None:
    """The header of a run is sealed, its results are not: both must speak of the same run."""
    meta = recording.meta
    of_header = (str((meta.get("valve") or {}).get("serial") or ""), str(meta.get("procedure") or ""))
    of_results = (results.serial or "", results.procedure)
    if of_header != of_results:
        raise FileError(
            f"{folder}: results.json is of {' '.join(of_results)}, the run of {' '.join(of_header)}; "
            f"`hil report {folder}` evaluates it again"
        )


def _check_judged(folder: Path, results: Results, planned: bool) -> None:
    """Verdicts that were kept must be those that the values, limits and the end of the run give."""
    for value in results.values:
        given = judge(value.value, value.std, value.low, value.high, value.relation)
        if (given if planned else unproven(given)) != value.verdict:
            raise FileError(
                f"{folder}: results.json calls {value.name} '{value.verdict}', which its value and limits do not say; "
                f"`hil report {folder}` evaluates it again"
            )
    if findings_of(results).verdict != results.verdict:
        raise FileError(f"{folder}: results.json calls the run '{results.verdict}', which its values do not say")
