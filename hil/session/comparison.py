"""A model beside recordings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from hil.identification.frequency.table_fit import TableComparison, compare_table
from hil.identification.grey_box.compare import Comparison, compare_all
from hil.identification.preparation.experiment import for_model
from hil.physics.model import Model
from hil.physics.other_plant import other_plants
from hil.record.read import recorded
from hil.record.reading import Reading
from hil.record.recording import Recording
from hil.record.run_folder.progress import Progress
from hil.record.simulated import is_simulated
from hil.record.table.response_table import ResponseTable
from hil.session.responses import measured_responses, responses_of_run
from hil.session.sources import Source, notes_on, read_source

_READING = 0.5  # share of the work that is reading


def compared_with(
    model: Model,
    sources: Iterable[Source],
    inputs: Sequence[str],
    output: str,
    reading: Reading | None,
    notes: Callable[[str], None],
    page: Path | None,
    progress: Progress,
) -> list[Comparison | TableComparison]:
    """How well a model fits each of what is read; `notes` is called with what was assumed when it was.

    `page`: where the model is drawn beside the measurements; `progress`: called with how far it is.
    """
    sources = list(sources)
    read: list[Recording | ResponseTable] = []
    for i, one in enumerate(sources):
        progress(_READING * i / len(sources), f"reading {_name_of(one)}")
        read += _read_for(model, one, inputs, output, reading)
    remarks = [*other_plants(model.plant, ((one.name, one.meta) for one in read)), *notes_on(read)]
    for note in remarks:
        notes(note)
    measured = [one if isinstance(one, ResponseTable) else for_model(model, one, inputs, output) for one in read]
    samples = [one for one in measured if not isinstance(one, ResponseTable)]
    in_time = iter(compare_all(model, samples, lambda done, text: progress(_READING + (1.0 - _READING) * done, text)))
    fits = (compare_table(model, one) if isinstance(one, ResponseTable) else next(in_time) for one in measured)
    found = [replace(fit, simulated=is_simulated(one.meta)) for fit, one in zip(fits, read, strict=True)]
    if page is not None:
        from hil.report.fit_page import write_fit_page

        write_fit_page(model, measured, {one.name: one.headline for one in found}, remarks, page,
                       simulated=any(one.simulated for one in found))  # fmt: skip
    return found


def _name_of(source: Source) -> str:
    return str(source) if isinstance(source, str | Path) else getattr(source, "name", "columns in memory")


def _read_for(
    model: Model, source: Source, inputs: Sequence[str], output: str, reading: Reading | None
) -> list[Recording | ResponseTable]:
    """What a model is held against: one of lines, against the lines of a run that measured some; else samples."""
    if "band_hz" in model.origin and isinstance(source, str | Path) and Path(source).is_dir():
        run = recorded(source)
        if measured_responses(run, inputs, output):
            return list(responses_of_run(run).values())
    return [read_source(source, reading)]
