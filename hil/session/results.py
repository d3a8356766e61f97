"""The results and the report of a run that is on disk already."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

from hil.bench.audit import evaluated_on_the_trail
from hil.errors import FileError, HilError, InputError
from hil.findings.collect import findings_of, results_of
from hil.findings.results import read_results, write_results
from hil.language.choice import in_page_language
from hil.language.note import Note, revived
from hil.record.cause import Cause
from hil.record.conditions import condition_departures
from hil.record.folder import read
from hil.record.measurement import FINDINGS_FILE, RESULTS_FILE, Findings, Limit, ended_as_planned, ending_of
from hil.record.recording import Recording
from hil.record.run_folder.seal import read_seal, seal_folder
from hil.record.simulated import is_simulated
from hil.report.run_page import write_run_report
from hil.safety.outputs import ending_words
from hil.session.limit import TypedLimit, by_present_names, checked_limits, limits_of
from hil.session.outcome import REPORT_FILE, Outcome
from hil.session.previous_run import with_earlier
from hil.session.procedure import Procedure, load_procedure
from hil.session.responses import write_responses
from hil.session.sample_sensitivity import measured_findings
from hil.session.setting import Setting, value_text


def evaluated_anew(recording: Recording, folder: Path) -> Findings:
    """What the samples of a run say now, judged by its sealed limits; what was looked up elsewhere is left out.

    Raises:
        FileError: it names no procedure.
        UnknownNameError: its procedure is not installed.
        InputError: it does not hold what its evaluation needs.
    """
    return evaluated(procedure_of(recording), recording, judged_by(recording, folder))


def judged_by(recording: Recording, folder: Path) -> dict[str, Limit]:
    """The limits of a run: those with which it was run, then those by which it was last judged.

    Names are those of today; as they are where its procedure is not installed here.
    """
    seal = read_seal(folder)
    given = {**limits_of(recording.meta), **({} if seal is None else seal.limits)}
    with suppress(HilError):
        return by_present_names([one.name for one in procedure_of(recording).measurements], given)
    return given


def report_again(folder: Path, limits: Mapping[str, Limit | TypedLimit] = MappingProxyType({})) -> Outcome:
    """Evaluate a run once more and write its results and report.

    A run that was broken off before anything could be evaluated gets a report that says so.

    Args:
        folder: the run.
        limits: of measured quantities, by name; they go before those with which it was judged before, and are sealed
            with the run.

    Raises:
        FileError: not a run folder.
        SettingError: a limit of something that its procedure does not measure.
        StorageError: a file cannot be written.
    """
    recording = read(folder)
    procedure = procedure_of(recording)
    given = checked_limits(procedure.measurements, limits)
    every = {**judged_by(recording, folder), **given}
    found = with_earlier(procedure, recording, evaluated(procedure, recording, every), folder, "")
    return write_outcome(recording, replace(found, cause=cause_found_before(folder)), folder, every)


def cause_found_before(folder: Path) -> Cause | None:
    """What the run itself found: it took its time, and is as true as it was."""
    with suppress(FileError):
        return findings_of(read_results(folder / RESULTS_FILE)).cause
    return None


def evaluated(procedure: Procedure, recording: Recording, limits: Mapping[str, Limit]) -> Findings:
    """The findings of a run, judged; of one that was not completed, what can be found in it.

    Raises:
        InputError: a run that was completed does not hold what its evaluation needs.
    """
    try:
        found = measured_findings(procedure.evaluate, _completed(procedure, recording))
        found = _with_assumed(found, procedure, recording)
    except InputError as error:
        if recording.meta.get("outcome") == "completed":
            raise
        found = Findings(notes=(Note("Nothing could be evaluated of this run: {why}.", why=str(error)),))
    begun = revived(recording.meta.get("deviations", ()), recording.meta.get("codes"))
    found = replace(found, deviations=(*found.deviations, *begun, *condition_departures(recording)))
    judged = found.with_missing(procedure.measurements).judged(limits)
    return judged if ended_as_planned(recording.meta) else judged.of_unfinished()


def _unstated(procedure: Procedure, recording: Recording) -> dict[str, Setting]:
    """Settings that the header does not hold: those of an earlier version had other names, or fewer."""
    stated = recording.meta.get("settings") or {}
    return {name: setting for name, setting in procedure.settings.items() if name not in stated}


def _completed(procedure: Procedure, recording: Recording) -> Recording:
    """The recording with the defaults of settings that its header does not hold."""
    defaults = {name: setting.default for name, setting in _unstated(procedure, recording).items()}
    if not defaults:
        return recording
    settings = {**defaults, **(recording.meta.get("settings") or {})}
    return replace(recording, meta={**recording.meta, "settings": settings})


def _with_assumed(found: Findings, procedure: Procedure, recording: Recording) -> Findings:
    """The findings with a note on the settings that had to be assumed."""
    if not (unstated := _unstated(procedure, recording)):
        return found
    listed = tuple(f"{name} = {_typed(setting)}" for name, setting in unstated.items())
    note = Note(
        "The header of this run does not state these settings, so the defaults of today were taken: {listed}.",
        listed=listed,
    )
    return replace(found, notes=(*found.notes, note))


def _typed(setting: Setting) -> str:
    return f"{value_text(setting.default)} {'' if setting.default is None else setting.unit}".rstrip()


def write_outcome(
    recording: Recording, findings: Findings, folder: Path, limits: Mapping[str, Limit] | None = None
) -> Outcome:
    """Write what was found into the run folder, and its seal into the audit trail.

    Args:
        recording: of the run.
        findings: of it.
        folder: of it.
        limits: by which it was judged, if others than before.

    Raises:
        StorageError: a file cannot be written.
    """
    outcome = write_evaluation(recording, findings, folder, limits)
    evaluated_on_the_trail(folder)
    return outcome


@in_page_language
def _in_words(recording: Recording) -> Recording:
    """The recording for its page, how it ended in the language of that."""
    if "outcome" not in recording.meta:
        return recording
    outcome = ending_words(str(recording.meta["outcome"]), recording.meta.get("outputs") or {})
    return replace(recording, meta={**recording.meta, "outcome": outcome})


def write_evaluation(
    recording: Recording, findings: Findings, folder: Path, limits: Mapping[str, Limit] | None = None
) -> Outcome:
    """Write results and report into a run folder and seal it; no word of it in the audit trail."""
    write_results(results_of(recording, findings), folder)
    (folder / FINDINGS_FILE).unlink(missing_ok=True)  # what an earlier version found
    write_responses(findings, folder)
    write_run_report(_in_words(recording), findings, folder / REPORT_FILE, _units_of_settings(recording))
    seal_folder(folder, judged_by(recording, folder) if limits is None else limits)
    return Outcome(folder, findings, folder / REPORT_FILE, is_simulated(recording.meta), ending_of(recording.meta))


def _units_of_settings(recording: Recording) -> dict[str, str]:
    with suppress(HilError):  # a procedure that is not installed here
        return {name: setting.unit for name, setting in procedure_of(recording).settings.items()}
    return {}


def procedure_of(recording: Recording) -> Procedure:
    """The procedure that made a run.

    Raises:
        FileError: the recording does not name one.
        UnknownNameError: it is not installed.
    """
    name = recording.meta.get("procedure")
    if not name:
        raise FileError(f"{recording.name}: names no procedure; a run folder of `hil run` was expected")
    return load_procedure(str(name))
