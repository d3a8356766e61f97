"""Many units in one call: each diagnosed by itself, spread over the cores of this machine or over a Dask cluster.

Workers are handed models and recordings, never paths, so that they need no common file system; results do not depend
on where a unit was diagnosed.
"""

from __future__ import annotations

import math
import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from hil.diagnosis.diagnose import Diagnosed, diagnose
from hil.errors import FileError, HilError, InputError
from hil.identification.experiment import for_model
from hil.physics.model import Model, load_model
from hil.record.read import read_recording
from hil.record.reading import AS_IT_IS, Reading
from hil.record.recording import Recording

NOMINAL_FILE = "nominal.json"
_PATIENCE_S = 5

Progress = Callable[[float, str], None]
_Diagnosed = Callable[..., Diagnosed | str]


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit: its name, nominal model and recordings."""

    name: str
    model: Model
    recordings: tuple[Recording, ...]


def read_unit(folder: Path, model: Model | None, pattern: str = "*.csv*", reading: Reading = AS_IT_IS) -> Unit:
    """The unit of a folder: its recordings, and its own `nominal.json` or else the model given.

    Raises:
        FileError: no recordings there, or no model.
    """
    paths = sorted(folder.glob(pattern))
    if not paths:
        raise FileError(f"{folder}: no recordings ({pattern}) of a unit")
    own = folder / NOMINAL_FILE
    if not own.is_file() and model is None:
        raise FileError(f"{folder}: no {NOMINAL_FILE}, and no --model given")
    return Unit(folder.name, load_model(own) if own.is_file() or model is None else model,
                tuple(read_recording(path, reading) for path in paths))  # fmt: skip


def diagnose_units(
    units: Sequence[Unit],
    scheduler: str = "",
    progress: Progress = lambda _done, _text: None,
    budget_s: float = math.inf,
) -> Iterator[tuple[Unit, Diagnosed | str]]:
    """Diagnose every unit; yields them in order, with what is wrong where its recordings are no good.

    Args:
        units: what to diagnose.
        scheduler: address of a Dask scheduler, `tcp://host:port`; this machine's cores when empty.
        progress: told how many are done.
        budget_s: computing time of each unit after which no further search is begun.

    Raises:
        InputError: no scheduler answers there.
    """
    diagnosed = partial(diagnose_unit, budget_s=budget_s)
    answers = _on_cluster(units, scheduler, diagnosed) if scheduler else _on_cores(units, diagnosed)
    for done, (unit, answer) in enumerate(zip(units, answers, strict=True), 1):
        progress(done / len(units), unit.name)
        yield unit, answer


def diagnose_unit(unit: Unit, budget_s: float = math.inf) -> Diagnosed | str:
    """Diagnose one unit; what is wrong with its recordings is an answer too, so that the others go on."""
    try:
        return diagnose(unit.model, [for_model(unit.model, each) for each in unit.recordings], budget_s=budget_s)
    except HilError as error:
        return str(error)


def _on_cores(units: Sequence[Unit], diagnosed: _Diagnosed) -> Iterator[Diagnosed | str]:
    workers = min(os.cpu_count() or 1, len(units))
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
        yield from pool.map(diagnosed, units)


def _on_cluster(units: Sequence[Unit], scheduler: str, diagnosed: _Diagnosed) -> Iterator[Diagnosed | str]:
    try:
        import distributed
    except ModuleNotFoundError:
        raise InputError("--scheduler needs Dask, which is not installed: pip install 'valve-hil[cluster]'") from None
    try:
        client = distributed.Client(scheduler, timeout=_PATIENCE_S)  # type: ignore[no-untyped-call]
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(f"--scheduler {scheduler}: no Dask scheduler answers there: {error}") from None
    with client:
        for future in client.map(diagnosed, units, pure=False):
            yield future.result()
