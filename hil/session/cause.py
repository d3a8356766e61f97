"""The cause of a missed certificate: `hil diff` or `hil diagnose`, run as a process of its own within a time.

It begins when the outputs are safe and the verdict is on disk. A process of its own can be ended at any moment: by the
time that it is given, or by the operator. Whatever becomes of it, the verdict stays what it is.
"""

from __future__ import annotations

import json
import queue
import shlex
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any

from hil.catalog import models
from hil.child import child
from hil.errors import ArchiveError, InputError
from hil.record.cause import Cause, Found
from hil.record.folder import read
from hil.record.measurement import is_accepted
from hil.record.recording import Recording
from hil.safety.interrupt import terminable
from hil.session.outcome import Outcome
from hil.session.procedure import Procedure
from hil.session.results import write_outcome
from hil.session.since import earlier_run

_SEARCHING = 0.6  # of that time; the rest is for starting, reading, and telling what was found
_POLL_S = 0.25

Progress = Callable[[float, str], None]


@dataclass(frozen=True, slots=True)
class _Question:
    """`command` is what an operator types for it, `arguments` its process's own, `since` the earlier run's name."""

    arguments: tuple[str, ...]
    command: str
    since: str


def cause_of(recording: Recording, folder: Path, earlier: Path | None, budget_s: float, progress: Progress) -> Cause:
    """Ask for the cause; never longer than the budget, and never an error: what hinders it is the answer.

    Args:
        recording: of the run.
        folder: of the run.
        earlier: folder of the run that it is compared with; the model of the type when None.
        budget_s: wall-clock time that it may take.
        progress: told how far it is.
    """
    begun_s = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="hil-cause-") as place:
        try:
            asked = _question(recording, folder, earlier, Path(place), budget_s)
        except InputError as error:
            return Cause("", reason=str(error), budget_s=budget_s)
        found = Cause(asked.command, asked.since, budget_s=budget_s)
        try:
            with terminable():
                answer, line = _answered(asked.arguments, begun_s + budget_s, budget_s, progress)
            found = _read(found, answer, line)
        except KeyboardInterrupt:
            found = replace(found, reason="stopped by the operator")
        except TimeoutError:
            found = replace(found, reason="out of time")
        except OSError as error:
            found = replace(found, reason=str(error))
    return replace(found, seconds=time.monotonic() - begun_s)


def _question(recording: Recording, folder: Path, earlier: Path | None, place: Path, budget_s: float) -> _Question:
    model = _type_model(recording, place)
    budget = ("--budget", f"{_SEARCHING * budget_s:g}", "--json")
    if earlier is not None:
        arguments = ("diff", str(earlier), str(folder), "--model", model)
        return _Question((*arguments, *budget), _typed(arguments, place), earlier.name)
    arguments = ("diagnose", "--model", model, str(folder), "--out")
    return _Question((*arguments, str(place / "diagnosis"), *budget), _typed((*arguments, "DIR"), place), "")


def _typed(arguments: Sequence[str], place: Path) -> str:
    shown = ["MODEL.json" if one.startswith(str(place)) else one for one in arguments]
    return shlex.join(("hil", *shown))


def _type_model(recording: Recording, place: Path) -> str:
    """The model of the type as `--model` takes it: an installed one by its name, a plant at its typical values."""
    plant = str((recording.meta.get("valve") or {}).get("plant") or "")
    if not plant:
        raise InputError("the bench file names no plant for this valve")
    if plant in models() or plant.endswith(".json"):
        return plant
    from hil.physics.model import save_model, typical_model

    save_model(typical_model(plant), place / "model.json")
    return str(place / "model.json")


def _answered(
    arguments: Sequence[str], until_s: float, budget_s: float, progress: Progress
) -> tuple[Mapping[str, Any] | None, str]:
    """What the command answered, and the last line that it said; `TimeoutError` where the time was over first."""
    process = child(
        "hil", arguments, {"HIL_PROGRESS_S": "1", "PYTHONIOENCODING": "utf-8"},
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    lines: queue.SimpleQueue[str] = queue.SimpleQueue()
    printed: list[str] = []
    readers = [_reader(process.stderr, lines.put), _reader(process.stdout, printed.append)]
    line, begun_s = "", until_s - budget_s
    try:
        while process.poll() is None:
            if (now_s := time.monotonic()) >= until_s:
                raise TimeoutError
            with suppress(queue.Empty):
                line = lines.get(timeout=_POLL_S)
            gone_s = now_s - begun_s
            text = f"verdict written; looking for the cause, {gone_s:.0f} of {budget_s:.0f} s; Ctrl-C leaves it out"
            progress(min(gone_s / budget_s, 1.0), text)
    finally:
        process.kill()
        process.wait()
        for reader in readers:
            reader.join()
    while not lines.empty():
        line = lines.get()
    try:
        return json.loads("".join(printed)), line.strip()
    except ValueError:
        return None, line.strip()


def _reader(stream: IO[str] | None, take: Callable[[str], None]) -> threading.Thread:
    def read() -> None:
        if stream is not None:
            with stream:
                for line in stream:
                    take(line)

    thread = threading.Thread(target=read, daemon=True)
    thread.start()
    return thread


def _read(asked: Cause, answer: Mapping[str, Any] | None, last_line: str) -> Cause:
    if answer is None:
        return replace(asked, reason=last_line.removeprefix("hil: ") or "no answer")
    is_difference = "changes" in answer
    not_searched = ", ".join((answer if is_difference else answer["work"])["not_searched"])
    found = _changes(answer["changes"]) if is_difference else _findings(answer)
    ordered = sorted(found, key=lambda one: -(one.share or 0.0))
    verdict = "partly_explained" if answer.get("is_part") else str(answer["verdict"])
    return replace(asked, verdict=verdict, found=tuple(ordered), untold=not_searched)


def _changes(changes: Iterable[Mapping[str, Any]]) -> list[Found]:
    """Of `hil.diff/1`."""
    return [
        Found(
            c["name"], c["of"], c["from"]["value"], c["from"]["std"], c["to"]["value"], c["to"]["std"], c["unit"],
            share=c["share"],
        ) for c in changes
    ]  # fmt: skip


def _findings(answer: Mapping[str, Any]) -> list[Found]:
    """Of `hil.diagnosis/1`."""
    pairs = answer.get("not_separable", ())
    was_of = {c["name"]: c["from"] for c in answer["changed_parameters"]}
    found = []
    for effect in answer["effects"]:
        name, (parameter, size) = effect["name"], next(iter(effect["parameters"].items()))
        alike = tuple(other for pair in pairs if name in pair for other in pair if other != name)
        was = size.get("from", was_of.get(parameter))
        found.append(Found(name, "", was, None, size["value"], size["std"], size["unit"], alike=alike))
    named = {name for effect in answer["effects"] for name in effect["parameters"]}
    for c in answer["changed_parameters"]:
        if c["name"] not in named:
            found.append(
                Found(c["name"], "", c["from"], None, c["to"], c["std"], c["unit"], meaning=c.get("meaning", ""))
            )
    return found


def with_cause(procedure: Procedure, outcome: Outcome, archive: str, budget_s: float, progress: Progress) -> Outcome:
    """The outcome of a run, with the cause where it is a certificate that was missed or cannot be told.

    Args:
        procedure: of the run.
        outcome: with everything written.
        archive: where an earlier run of the unit is looked for.
        budget_s: time that it may take; 0: nothing is asked.
        progress: told how far it is.
    """
    if not procedure.certificate or is_accepted(outcome.findings.verdict) or not budget_s > 0.0:
        return outcome
    folder, recording, earlier = outcome.folder, read(outcome.folder), None
    serial = str((recording.meta.get("valve") or {}).get("serial") or "")
    with suppress(ArchiveError, InputError, OSError):
        earlier = earlier_run(archive, serial, procedure.name, recording, folder) if serial else None
    found = cause_of(recording, folder, None if earlier is None else earlier.folder, budget_s, progress)
    return write_outcome(recording, replace(outcome.findings, cause=found), folder)
