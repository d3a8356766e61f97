"""The cause of a missed certificate: a comparison or a diagnosis in a process of its own, within a time.

It begins when the outputs are safe and the verdict is on disk. A process of its own can be ended at any moment: by the
time that it is given, or by the operator. Whatever becomes of it, the verdict stays what it is.
"""

from __future__ import annotations

import shlex
import subprocess
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from hil.catalog import models
from hil.child import child
from hil.errors import ArchiveError, InputError
from hil.record.cause import ANSWER, Cause
from hil.record.folder import read
from hil.record.measurement import is_accepted
from hil.record.recording import Recording
from hil.record.run_folder.header import stated
from hil.record.run_folder.progress import Progress
from hil.safety.interrupt import terminable
from hil.session.outcome import Outcome
from hil.session.previous_run import earlier_run
from hil.session.procedure import Procedure
from hil.session.results import write_outcome

_SEARCHING = 0.6  # of that time; the rest is for starting, reading, and telling what was found
_POLL_S = 0.25


def cause_of(recording: Recording, folder: Path, earlier: Path | None, budget_s: float, progress: Progress) -> Cause:
    """Ask for the cause; never longer than the budget, and never an error: what hinders it is the answer.

    Args:
        recording: of the run.
        folder: of the run.
        earlier: folder of the run that it is compared with; the model of the type when None.
        budget_s: wall-clock time that it may take.
        progress: called with how far it is.
    """
    begun_s = time.monotonic()
    model = stated(recording.meta, "valve", "plant")
    if not model:
        return Cause("", reason="the bench file names no plant for this valve", budget_s=budget_s)
    arguments = (model, str(folder), str(earlier or ""), f"{_SEARCHING * budget_s:g}")
    try:
        with terminable():
            found = _answered(arguments, begun_s, budget_s, progress)
    except KeyboardInterrupt:
        found = Cause("", reason="stopped by the operator")
    except TimeoutError:
        found = Cause("", reason="out of time")
    except OSError as error:
        found = Cause("", reason=str(error))
    return replace(
        found, command=_typed(model, folder, earlier), since=earlier.name if earlier else "",
        seconds=time.monotonic() - begun_s, budget_s=budget_s,
    )  # fmt: skip


def _typed(model: str, folder: Path, earlier: Path | None) -> str:
    """The command that looks again."""
    known = model if model in models() or model.endswith(".json") else "MODEL.json"
    if earlier is not None:
        return shlex.join(("hil", "diff", str(earlier), str(folder), "--model", known))
    return shlex.join(("hil", "diagnose", "--model", known, str(folder), "--out", "DIR"))


def _answered(arguments: tuple[str, ...], begun_s: float, budget_s: float, progress: Progress) -> Cause:
    """What the process answers; `TimeoutError` where the time was over first."""
    process = child(
        "hil.api.cause", arguments, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        start_new_session=True,
    )  # fmt: skip
    with process:
        try:
            while (gone_s := time.monotonic() - begun_s) < budget_s:
                text = f"verdict written; looking for the cause, {gone_s:.0f} of {budget_s:.0f} s; Ctrl-C leaves it out"
                progress(gone_s / budget_s, text)
                with suppress(subprocess.TimeoutExpired):
                    answer, _ = process.communicate(timeout=_POLL_S)
                    return Cause("", reason="no answer") if process.returncode else ANSWER.validate_json(answer)
            raise TimeoutError
        finally:
            process.kill()


def with_cause(procedure: Procedure, outcome: Outcome, archive: str, budget_s: float, progress: Progress) -> Outcome:
    """The outcome of a run, with the cause where it is a certificate that was missed or cannot be told.

    Args:
        procedure: of the run.
        outcome: with everything written.
        archive: where an earlier run of the unit is looked for.
        budget_s: time that it may take; 0: nothing is asked.
        progress: called with how far it is.
    """
    if not procedure.certificate or is_accepted(outcome.findings.verdict) or not budget_s > 0.0:
        return outcome
    folder, recording, earlier = outcome.folder, read(outcome.folder), None
    serial = stated(recording.meta, "valve", "serial")
    with suppress(ArchiveError, InputError, OSError):
        earlier = earlier_run(archive, serial, procedure.name, recording, folder) if serial else None
    found = cause_of(recording, folder, None if earlier is None else earlier.folder, budget_s, progress)
    return write_outcome(recording, replace(outcome.findings, cause=found), folder)
