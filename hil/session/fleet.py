"""Many units in one call: each diagnosed by itself, spread over the cores of this machine or over a Dask cluster.

Workers are handed models and recordings, never paths, so that they need no common file system; results do not depend
on where a unit was diagnosed.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from hil.child import over_processes
from hil.cores import cores
from hil.diagnosis.diagnose import Diagnosed, diagnose
from hil.errors import FileError, HilError, InputError, option
from hil.physics.model import Model, load_model
from hil.record.progress import Progress, quiet
from hil.record.read import read_recording
from hil.record.reading import Reading
from hil.record.recording import Recording
from hil.record.simulated import is_simulated, marked
from hil.session.diagnosis import bound_to, write_diagnosis
from hil.session.sources import notes_on

NOMINAL_FILE = "nominal.json"
_PATIENCE_S = 5

Notes = Callable[[str], None]
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
    """What came out for a unit: what was `diagnosed`, or in `error` why its recordings are no good."""

    unit: str
    diagnosed: Diagnosed | None
    error: str = ""
    notes: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """As JSON values."""
        if self.diagnosed is None:
            return {"unit": self.unit, "diagnosis": None, "error": self.error}
        return {"unit": self.unit, "diagnosis": self.diagnosed.diagnosis.as_dict(), "error": None}

    def as_text(self) -> str:
        """In a line."""
        if self.diagnosed is None:
            return f"{self.unit}: not diagnosed: {self.error}"
        found = self.diagnosed.diagnosis
        names = ", ".join(effect.name for effect in found.effects)
        return f"{self.unit}: {marked(found.verdict, simulated=found.simulated)}{': ' if names else ''}{names}"


_Diagnose = Callable[[Unit], UnitAnswer]


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
) -> list[UnitAnswer]:
    """Diagnose the units of these folders; each answer is written into a folder of its own in `out`, once it is there.

    Raises:
        FileError: a folder without recordings or model, or two of one name.
    """
    names = Counter(folder.resolve().name for folder in folders)
    if twice := [name for name, count in names.items() if count > 1]:
        raise FileError(f"two folders of a fleet are called '{twice[0]}'; each unit needs a name of its own")
    units = [read_unit(folder, model, reading=reading, inputs=inputs, output=output) for folder in folders]
    for note in notes_on([one for unit in units for one in unit.recordings]):
        notes(note)
    answers = []
    for answer in diagnose_units(units, scheduler, progress, budget_s):
        for text in answer.notes:
            notes(f"{answer.unit}: {text}")
        if out is not None and answer.diagnosed is not None:
            write_diagnosis(answer.diagnosed, out / answer.unit)
        answers.append(answer)
    return answers


def read_unit(
    folder: Path,
    model: Model | None,
    pattern: str = "*.csv*",
    reading: Reading | None = None,
    inputs: Sequence[str] = (),
    output: str = "",
) -> Unit:
    """The unit of a folder: its recordings, and its own `nominal.json` or else the model given.

    Raises:
        FileError: no recordings there, or no model.
    """
    paths = sorted(folder.glob(pattern))
    if not paths:
        raise FileError(f"{folder}: no recordings ({pattern}) of a unit")
    own = folder / NOMINAL_FILE
    if not own.is_file() and model is None:
        raise FileError(f"{folder}: no {NOMINAL_FILE}, and no {option('model')} given")
    known = load_model(own) if own.is_file() or model is None else model
    read = tuple(read_recording(path, reading) for path in paths)
    return Unit(folder.resolve().name, known, read, tuple(inputs), output)


def diagnose_units(
    units: Sequence[Unit],
    scheduler: str = "",
    progress: Progress = quiet,
    budget_s: float = math.inf,
) -> Iterator[UnitAnswer]:
    """Diagnose every unit; yields the answers in order.

    Args:
        units: what to diagnose.
        scheduler: address of a Dask scheduler, `tcp://host:port`; this machine's cores when empty.
        progress: told how many are done.
        budget_s: of each unit: after so many times 10 million simulated samples no further search is begun.

    Raises:
        InputError: no scheduler answers there.
    """
    diagnosed = partial(diagnose_unit, budget_s=budget_s)
    answers = _on_cluster(units, scheduler, diagnosed) if scheduler else _on_cores(units, diagnosed)
    for done, answer in enumerate(answers, 1):
        progress(done / len(units), answer.unit)
        yield answer


def diagnose_unit(unit: Unit, budget_s: float = math.inf) -> UnitAnswer:
    """Diagnose one unit; what is wrong with its recordings is an answer too, so that the others go on."""
    try:
        experiments, left_out = bound_to(unit.model, unit.recordings, unit.inputs, unit.output, budget_s)
        notes = (*left_out, *notes_on([], experiments))
        found = diagnose(unit.model, experiments, budget_s=budget_s)
        simulated = any(is_simulated(one.meta) for one in unit.recordings)
        found = replace(found, diagnosis=replace(found.diagnosis, simulated=simulated))
        return UnitAnswer(unit.name, found, notes=notes)
    except HilError as error:
        return UnitAnswer(unit.name, None, str(error))


def _on_cores(units: Sequence[Unit], diagnosed: _Diagnose) -> Iterator[UnitAnswer]:
    yield from over_processes(diagnosed, units, min(cores(), len(units)))


def _on_cluster(units: Sequence[Unit], scheduler: str, diagnosed: _Diagnose) -> Iterator[UnitAnswer]:
    try:
        import distributed
    except ModuleNotFoundError:
        raise InputError("a scheduler needs Dask, which is not installed: pip install 'valve-hil[cluster]'") from None
    try:
        client = distributed.Client(scheduler, timeout=_PATIENCE_S)  # type: ignore[no-untyped-call]
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(f"scheduler {scheduler}: no Dask scheduler answers there: {error}") from None
    with client:
        for future in client.map(diagnosed, units, pure=False):
            yield future.result()
