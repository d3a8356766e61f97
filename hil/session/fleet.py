"""Many units in one call: each diagnosed by itself, spread over the cores of this machine or over a Dask cluster.

Workers read a unit's folder themselves where they see it, with what is in it; else they are handed its recordings.
Results do not depend on where a unit was diagnosed. Of any number of units a few are under way at a time; what is
written down of one is not kept in memory, and not done again by a call that goes on where another was broken off.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hil.child import over_processes, processes
from hil.cores import cores, keep_to
from hil.diagnosis.diagnose import Diagnosed, diagnose
from hil.diagnosis.screening import Screening, screen
from hil.errors import FileError, HilError, InputError, option, storing
from hil.language.choice import choose, page_language
from hil.language.note import Note
from hil.physics.model import Model, load_model
from hil.record.csv_text import write_table
from hil.record.plain import plain
from hil.record.read import read_recording
from hil.record.reading import Reading
from hil.record.recording import Recording
from hil.record.run_folder.progress import Progress, quiet
from hil.record.simulated import is_simulated, marked
from hil.session.diagnosis import DIAGNOSIS_FILE, bound_to, write_diagnosis
from hil.session.sources import notes_on
from hil.version import PROGRAM

NOMINAL_FILE, DONE_FILE, SCREENING_FILE = "nominal.json", "fleet.jsonl", "screening.csv"
_PATIENCE_S = 5
_PATTERN = "*.csv*"

Notes = Callable[[str | Note], None]
SCHEMA = "hil.fleet/1"


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit: its name, nominal model and recordings; names of channels where they are not the model's own."""

    name: str
    model: Model
    recordings: tuple[Recording, ...]
    inputs: tuple[str, ...] = ()
    output: str = ""


@dataclass(frozen=True, slots=True)
class UnitAnswer:
    """What came out for a unit.

    Attributes:
        unit: its name.
        diagnosed: the diagnosis; None where there is none, or where it was written.
        screened: what the screening says, where no diagnosis is asked for.
        error: why there is none.
        notes: on its recordings.
        folder: where the diagnosis was written. `line`: that diagnosis in a line.
    """

    unit: str
    diagnosed: Diagnosed | None
    error: str = ""
    notes: tuple[str | Note, ...] = ()
    folder: Path | None = None
    line: str = ""
    screened: Screening | None = None

    def as_dict(self) -> dict[str, Any]:
        """As JSON values; a diagnosis that was written is read again."""
        found = None if self.diagnosed is None else self.diagnosed.diagnosis.as_dict()
        if self.folder is not None:
            found = json.loads((self.folder / DIAGNOSIS_FILE).read_text(encoding="utf-8"))
        screened = None if self.screened is None else self.screened.as_dict()
        return {"unit": self.unit, "diagnosis": found, "screening": screened, "error": self.error or None}

    def as_text(self) -> str:
        """In a line."""
        found = self.screened if self.diagnosed is None else self.diagnosed.diagnosis
        if found is None:
            return self.line or f"{self.unit}: not diagnosed: {self.error}"
        names = "" if self.diagnosed is None else ", ".join(e.name for e in self.diagnosed.diagnosis.effects)
        return f"{self.unit}: {marked(found.verdict, simulated=found.simulated)}{': ' if names else ''}{names}"


@dataclass(frozen=True, slots=True)
class _Task:
    """A unit as a worker gets it.

    Attributes:
        folder: its recordings; `files` is a hash of them. `unit`: the recordings themselves, for who sees no folder.
        model: of the type. `how`: the other arguments of `read_unit`. `budget_s`: see `diagnose_unit`.
        language: of the pages that are made; none are where it is empty. `screens`: see `diagnosed_fleet`.
    """

    name: str
    folder: Path
    model: Model | None = None
    how: dict[str, Any] = field(default_factory=dict)
    budget_s: float = math.inf
    language: str = ""
    files: str = ""
    unit: Unit | None = None
    screens: bool = False

    @property
    def stamp(self) -> str:
        """A hash of all that the answer depends on."""
        asked = {**self.how, "reading": asdict(self.how["reading"] or Reading()), "budget_s": self.budget_s}
        model = None if self.model is None else self.model.as_dict()
        kind = "screening" if self.screens else self.language
        return _hash(json.dumps(plain([PROGRAM, self.name, self.files, model, asked, kind])).encode())

    def read(self) -> Unit:
        """The unit.

        Raises:
            FileError: a file cannot be read.
        """
        return self.unit or read_unit(self.folder, self.model, **self.how)


@dataclass(frozen=True, slots=True)
class _Made:
    """What a worker gives back: an answer, and the files to be written, by name.

    `is_repeatable`: whether the same task would have it again: not where the worker was lost.
    """

    task: _Task
    answer: UnitAnswer
    files: dict[str, bytes] = field(default_factory=dict)
    is_repeatable: bool = True


def diagnosed_fleet(
    folders: Sequence[Path],
    model: Model | None = None,
    inputs: Sequence[str] = (),
    output: str = "",
    out: Path | None = None,
    scheduler: str = "",
    budget_s: float = math.inf,
    reading: Reading | None = None,
    notes: Notes = lambda _note: None,
    progress: Progress = quiet,
    *,
    screens: bool = False,
) -> list[UnitAnswer]:
    """Diagnose the units of these folders; each answer is written into a folder of its own in `out`, once it is there.

    A unit that was answered there before, from the same files in the same way, is not diagnosed again. Where `screens`,
    only whether each has changed is asked; the answers are rows of one table in `out`.

    Raises:
        FileError: a folder without recordings or model, or two of one name.
        StorageError: `out` cannot be written.
    """
    names = Counter(folder.resolve().name for folder in folders)
    if twice := [name for name, count in names.items() if count > 1]:
        raise FileError(f"two folders of a fleet are called '{twice[0]}'; each unit needs a name of its own")
    for folder in folders:
        _check(folder, model)
    answered: dict[str, UnitAnswer] = {}
    done = {} if out is None else _done_before(out)
    how = {"reading": reading, "inputs": inputs, "output": output}
    language = page_language() if out and not screens else ""

    def todo() -> Iterator[_Task]:
        for folder in folders:
            name, files = folder.resolve().name, _files(folder)
            task = _Task(name, folder, model, how, budget_s, language, files, screens=screens)
            if before := done and done.get(task.stamp):
                answered[task.name] = before
            else:
                yield task

    for made in _over_workers(todo(), scheduler, min(cores(), len(folders)), notes):
        name = made.task.name
        for text in made.answer.notes:
            notes(f"{name}: {text}")
        answered[name] = made.answer if out is None else _written(made, out)
        progress(len(answered) / len(names), name)
    answers = [answered[name] for name in names]
    if out is not None and screens:
        _write_screening(answers, out)
    return answers


def _write_screening(answers: Sequence[UnitAnswer], out: Path) -> None:
    """Every unit a row."""
    heads = list(dict.fromkeys(name for one in answers if one.screened is not None for name in one.screened.as_dict()))
    screenings = [(one, {} if one.screened is None else one.screened.as_dict()) for one in answers]
    out.mkdir(parents=True, exist_ok=True)
    rows = [[one.unit, *(known.get(head, "") for head in heads), one.error] for one, known in screenings]
    write_table(["unit", *heads, "error"], rows, out / SCREENING_FILE)


def _check(folder: Path, model: Model | None) -> list[Path]:
    """The recordings of a unit.

    Raises:
        FileError: there are none, or no model, or no such folder.
    """
    if not folder.is_dir():
        raise FileError(f"{folder}: no such folder")
    if not (paths := sorted(folder.glob(_PATTERN))):
        raise FileError(f"{folder}: no recordings ({_PATTERN}) of a unit")
    if model is None and not (folder / NOMINAL_FILE).is_file():
        raise FileError(f"{folder}: no {NOMINAL_FILE}, and no {option('model')} given")
    return paths


def read_unit(
    folder: Path,
    model: Model | None,
    reading: Reading | None = None,
    inputs: Sequence[str] = (),
    output: str = "",
) -> Unit:
    """The unit of a folder: its recordings, and its own `nominal.json` or else the model given.

    Raises:
        FileError: no recordings there, or no model.
    """
    paths, own = _check(folder, model), folder / NOMINAL_FILE
    known = load_model(own) if own.is_file() or model is None else model
    read = tuple(read_recording(path, reading) for path in paths)
    return Unit(folder.resolve().name, known, read, tuple(inputs), output)


def diagnose_unit(unit: Unit, budget_s: float = math.inf, *, screens: bool = False) -> UnitAnswer:
    """Diagnose one unit; what is wrong with its recordings is an answer too, so that the others go on.

    Args:
        unit: what to diagnose.
        budget_s: after so many times 10 million simulated samples no further search is begun.
        screens: ask no more than whether it has changed.
    """
    notes: tuple[str | Note, ...] = tuple(notes_on(unit.recordings))
    simulated = any(is_simulated(one.meta) for one in unit.recordings)
    try:
        experiments, left_out = bound_to(unit.model, unit.recordings, unit.inputs, unit.output, budget_s)
        notes = (*notes, *left_out, *notes_on([], experiments))
        if screens:
            screened, warnings = screen(unit.model, experiments)
            screened = replace(screened, simulated=simulated)
            return UnitAnswer(unit.name, None, notes=(*notes, *warnings), screened=screened)
        found = diagnose(unit.model, experiments, budget_s=budget_s)
        found = replace(found, diagnosis=replace(found.diagnosis, simulated=simulated))
        return UnitAnswer(unit.name, found, notes=notes)
    except HilError as error:
        return UnitAnswer(unit.name, None, str(error), notes)


def _worked(task: _Task) -> _Made:
    """What a worker does with a task."""
    try:
        answer = diagnose_unit(task.read(), task.budget_s, screens=task.screens)
    except HilError as error:
        answer = UnitAnswer(task.name, None, str(error))
    if answer.diagnosed is None or not task.language:
        return _Made(replace(task, unit=None), answer)
    choose(task.language)
    with TemporaryDirectory(prefix="hil-fleet-") as place:
        write_diagnosis(answer.diagnosed, Path(place))
        files = {path.name: path.read_bytes() for path in Path(place).iterdir()}
    return _Made(replace(task, unit=None), replace(answer, diagnosed=None, line=answer.as_text()), files)


def _over_workers(
    tasks: Iterable[_Task], scheduler: str, most: int, tell: Notes = lambda _note: None
) -> Iterator[_Made]:
    """Every task worked on, as they are finished."""
    if scheduler:
        yield from _on_cluster(tasks, scheduler, tell)
    elif most:
        pools = partial(processes, prepare=partial(keep_to, cores() // most))
        yield from over_processes(_worked, tasks, lambda: most, _answer_lost, tell, pools)


def _answer_lost(task: _Task) -> _Made:
    text = "the process that diagnosed it was lost, and the next one too: killed, or out of memory"
    return _Made(task, UnitAnswer(task.name, None, text), is_repeatable=False)


def _on_cluster(tasks: Iterable[_Task], scheduler: str, tell: Notes) -> Iterator[_Made]:
    """As on cores; Dask itself gives the task of a lost worker to others."""
    try:
        import distributed
    except ModuleNotFoundError:
        raise InputError("a scheduler needs Dask, which is not installed: pip install 'valve-hil[cluster]'") from None
    try:
        client = distributed.Client(scheduler, timeout=_PATIENCE_S)  # type: ignore[no-untyped-call]
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(f"scheduler {scheduler}: no Dask scheduler answers there: {error}") from None
    unseen: list[_Task] = []
    unread: list[_Made] = []

    def handed() -> Iterator[_Task]:
        for task in unseen:
            try:
                yield replace(task, unit=task.read())
            except HilError as error:
                unread.append(_Made(task, UnitAnswer(task.name, None, str(error))))

    def threads() -> int:
        return max(1, sum(client.nthreads().values()))  # type: ignore[no-untyped-call]

    def pools(_workers: int) -> Any:
        return client.get_executor(pure=False)  # type: ignore[no-untyped-call]

    with client:
        for todo in (tasks, handed()):
            for made in over_processes(
                _on_a_thread, todo, threads, _answer_lost, tell, pools, distributed.KilledWorker
            ):
                if isinstance(made, _Task):
                    unseen.append(made)
                else:
                    yield made
    yield from unread


def _on_a_thread(task: _Task) -> _Made | _Task:
    """What a thread of a cluster does, which spreads nothing over further cores; its task where it sees no folder."""
    keep_to(1)
    return _worked(task) if task.unit is not None or _files(task.folder) == task.files else task


def _files(folder: Path) -> str:
    """A hash of the recordings of a unit and its model; of what is not there too."""
    paths = [*sorted(folder.glob(_PATTERN)), folder / NOMINAL_FILE]
    return _hash(b"".join(_hash(path.name.encode() + path.read_bytes()).encode() for path in paths if path.is_file()))


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _written(made: _Made, out: Path) -> UnitAnswer:
    """The answer with its files written, and then a line that it is done; what was lost is tried another time.

    Raises:
        StorageError: they cannot be written.
    """
    answer, place = made.answer, out / made.answer.unit
    with storing(place, "the diagnosis cannot be written"):
        out.mkdir(parents=True, exist_ok=True)
        for name, content in made.files.items():
            place.mkdir(exist_ok=True)
            (place / name).write_bytes(content)
        if made.is_repeatable:
            line: dict[str, Any] = {
                "stamp": made.task.stamp,
                "unit": answer.unit,
                "error": answer.error,
                "line": answer.line,
            }
            line |= {} if answer.screened is None else {"screening": answer.screened.as_dict()}
            with (out / DONE_FILE).open("a+b") as file:
                file.seek(max(file.tell() - 1, 0))
                broken_off = b"" if file.read() in (b"", b"\n") else b"\n"
                file.write(broken_off + json.dumps(line).encode() + b"\n")
    return replace(answer, folder=place if made.files else None)


def _done_before(out: Path) -> dict[str, UnitAnswer]:
    """What units were answered in this folder before, by their stamps."""
    if not (out / DONE_FILE).is_file():
        return {}
    found = {}
    for text in (out / DONE_FILE).read_text(encoding="utf-8").splitlines():
        with suppress(ValueError, TypeError, KeyError):  # broken off while it was written
            line = json.loads(text)
            screened = Screening(**line["screening"]) if "screening" in line else None
            folder = None if line["error"] or screened is not None else out / line["unit"]
            if folder is None or (folder / DIAGNOSIS_FILE).is_file():
                found[line["stamp"]] = UnitAnswer(line["unit"], None, line["error"], (), folder, line["line"], screened)
    return found
