"""Run a procedure on a bench, then evaluate what it recorded."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from hil.bench.audit import on_the_trail
from hil.bench.ending import accounted, word_of_this_process
from hil.bench.open import open_rig
from hil.bench.read import BenchFile
from hil.errors import InputError, SettingError, StoppedError
from hil.record.folder import read
from hil.record.measurement import Limit
from hil.record.recording import Recording
from hil.record.run_folder.events import EVENTS_FILE
from hil.record.run_folder.progress import Progress, kept_progress, quiet
from hil.record.run_folder.samples import ROWS_FILE
from hil.rig import Rig
from hil.safety.interrupt import terminable
from hil.safety.outputs import Outputs
from hil.session.cause import with_cause
from hil.session.labels import NO_LABELS, Labels, labelled
from hil.session.limit import TypedLimit, bench_limits, checked_limits, limits_of
from hil.session.outcome import Outcome
from hil.session.preload import preload
from hil.session.previous_run import with_earlier
from hil.session.procedure import Procedure
from hil.session.rehearsal import Rehearsal, rehearse
from hil.session.results import evaluated, write_outcome
from hil.session.resume import broken_off, settings_of
from hil.session.setting import parse_settings
from hil.session.terminal import operator_here


def run_procedure(
    procedure: Procedure,
    bench: BenchFile,
    settings: Mapping[str, Any],
    out: Path,
    progress: Progress = quiet,
    resets: Iterable[str] = (),
    limits: Mapping[str, Limit | TypedLimit] = MappingProxyType({}),
    resume: Path | None = None,
    output_states: Outputs | None = None,
    labels: Labels = NO_LABELS,
    commanding: str = "",
    archive: str = "",
    cause_s: float = 0.0,
) -> Outcome:
    """Drive a procedure and evaluate it: outputs are safe, read back, before anything is evaluated.

    An error says in its notes what is known of the outputs, and has the exit status that follows from it.

    Args:
        procedure: what to run.
        bench: on which bench.
        settings: by name, as text or as values; what is not given has its default.
        out: the run folder to make.
        progress: called with how far the procedure is.
        resets: names of interlocks whose trips are forgotten first.
        limits: of measured quantities, by name; they go before those of the bench file, and those before what
            the procedure declares.
        resume: the folder of a run that was broken off; its settings are taken, its finished parts not driven again.
        output_states: what is known of the outputs, for somebody who asks for it afterwards.
        labels: serial number, operator and notes.
        commanding: the output that is driven, where it is not the command of the bench.
        archive: where an earlier run of a unit that did not pass is looked for.
        cause_s: time that the cause of a missed certificate is looked for, once the verdict is on disk; 0: it is not.

    Raises:
        SettingError: a setting or limit is unknown or not allowed; nothing was driven.
        FileError: the run folder exists.
        HardwareError: the bench failed; what was recorded is kept.
        KeyboardInterrupt: Ctrl-C, or `Terminated` after SIGTERM, SIGHUP and SIGQUIT; what was recorded is kept.
    """
    bench, labels = labelled(bench, procedure, labels)
    earlier, values = planned(procedure, bench, settings, resume)
    judged_by = checked_limits(procedure.measurements, {**bench_limits(bench.bench, procedure.name), **limits})
    about = {"procedure": procedure.name, "settings": values, "limits": judged_by, **labels.about,
             "bench_path": str(bench.path.resolve())}  # fmt: skip
    if commanding:
        about["commanding"] = commanding
    if earlier is not None:
        about["resumes"] = earlier.name
        bench = _with_other_noise(bench, len(earlier))
    new = not out.exists()
    if not bench.is_simulated:  # whose time stands still meanwhile
        preload(procedure.run)
    labels_and_limits = {**about, "limits given": {name: asdict(judged_by[name]) for name in limits}}
    with kept_progress(out, progress) as report:
        try:
            output_states = output_states or Outputs()
            with (
                accounted(output_states),  # also of a signal that came so late that only `terminable` raises it
                terminable(),
                open_rig(
                    bench, out, about, report, resets, earlier, output_states, commanding,
                    operator_here(bench.is_simulated), on_the_trail(bench, out, labels_and_limits, resets),
                    word_of_this_process(),
                ) as rig,
            ):  # fmt: skip
                _run_by(procedure, rig, values)
        except InputError:
            if new:
                _take_back(out)
            raise
        report(1.0, "outputs safe; evaluating")
        return with_cause(procedure, evaluate_run(procedure, out, archive), archive, cause_s, report)


def _with_other_noise(bench: BenchFile, samples: int) -> BenchFile:
    """The bench with noise drawn anew where it is simulated: samples of before would come twice, and count twice."""
    devices = {}
    for name, device in bench.devices.items():
        if (simulation := getattr(device.settings, "simulation", None)) is not None:
            other = simulation.model_copy(update={"seed": simulation.seed + samples})
            device = replace(device, settings=device.settings.model_copy(update={"simulation": other}))
        devices[name] = device
    return replace(bench, devices=devices)


def rehearse_procedure(
    procedure: Procedure,
    bench: BenchFile,
    settings: Mapping[str, Any],
    progress: Progress = quiet,
    resume: Path | None = None,
    keep: Path | None = None,
) -> Rehearsal:
    """Play on the simulated valve what `run_procedure` would drive with the same arguments; `keep` takes its recording.

    Raises:
        RehearsalError: a sample would leave the envelope, or an interlock would stop or trip the run.
        SettingError: the bench has no twin, or a setting is not allowed.
    """
    earlier, values = planned(procedure, bench, settings, resume)
    with terminable():
        return rehearse(procedure, bench, values, progress, earlier, keep)


def planned(
    procedure: Procedure, bench: BenchFile, settings: Mapping[str, Any], resume: Path | None
) -> tuple[Recording | None, dict[str, Any]]:
    """The run that is to be resumed, if there is one, and the settings.

    Raises:
        SettingError: a setting is unknown or not allowed, or the run is not one that can be resumed here.
    """
    if resume is None:
        return None, parse_settings(procedure.settings, settings)
    if settings:
        raise SettingError(f"setting {next(iter(settings))}: a resumed run has the settings with which it began")
    earlier = broken_off(resume, procedure, bench)
    return earlier, parse_settings(procedure.settings, settings_of(earlier))


def evaluate_run(procedure: Procedure, folder: Path, archive: str = "") -> Outcome:
    """Evaluate a recorded run; writes its findings and its report into the folder.

    Raises:
        InputError: the recording does not hold what the evaluation needs.
        StorageError: the findings cannot be written.
    """
    recording = read(folder)
    found = evaluated(procedure, recording, limits_of(recording.meta))
    return write_outcome(recording, with_earlier(procedure, recording, found, folder, archive), folder)


def _run_by(procedure: Procedure, rig: Rig, settings: Mapping[str, Any]) -> None:
    """Run it; one that ends the program is a procedure that failed, whatever status it asked for."""
    try:
        procedure.run(rig, **settings)
    except SystemExit as error:
        text = f"procedure '{procedure.name}' called sys.exit({error.code!r}); the run was stopped"
        raise StoppedError(text) from error


def _take_back(folder: Path) -> None:
    """Remove the folder of a run that was refused before its first sample: its name is wanted for the next try."""
    records = [path for path in (folder / ROWS_FILE, folder / EVENTS_FILE) if path.exists()]
    if records and not any(path.stat().st_size for path in records):
        shutil.rmtree(folder)
