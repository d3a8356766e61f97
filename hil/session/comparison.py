"""A model beside recordings, and two runs side by side."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from hil.errors import SettingError
from hil.findings.difference import Difference, differences
from hil.findings.results import Results
from hil.identification.frequency.table_fit import TableComparison, compare_table
from hil.identification.grey_box.compare import Comparison, compare_all
from hil.identification.preparation.experiment import for_model
from hil.physics.model import Model
from hil.physics.other_plant import other_plants
from hil.record.header import Header, read_header
from hil.record.instruments import instruments_mark
from hil.record.reading import AS_IT_IS, Reading
from hil.record.recording import Recording
from hil.record.response_table import ResponseTable
from hil.record.simulated import is_simulated
from hil.session.responses import holds_responses, responses_of_run, speaks_of
from hil.session.results import results_of_run
from hil.session.sources import Source, notes_on, read_source

_READING = 0.5  # share of the work that is reading


@dataclass(frozen=True, slots=True)
class RunComparison:
    """Two runs, `first` the earlier one, and what differs: the change is second less first.

    Both results have `started_utc`. `one_bench`: whether the same instruments measured both.
    """

    first: Results
    second: Results
    one_bench: bool
    differences: tuple[Difference, ...]


def compared_with(
    model: Model,
    sources: Iterable[Source],
    inputs: Sequence[str] = (),
    output: str = "",
    reading: Reading | None = None,
    notes: Callable[[str], None] = lambda _note: None,
    page: Path | None = None,
    progress: Callable[[float, str], None] = lambda _done, _text: None,
) -> list[Comparison | TableComparison]:
    """How well a model fits each of what is read; `notes` is told what was assumed when it was.

    `page`: where the model is drawn beside the measurements; `progress`: told how far it is.
    """
    sources = list(sources)
    read: list[Recording | ResponseTable] = []
    for i, one in enumerate(sources):
        progress(_READING * i / len(sources), f"reading {_name_of(one)}")
        read += _read_for(model, one, inputs, output, reading or AS_IT_IS)
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
    model: Model, source: Source, inputs: Sequence[str], output: str, reading: Reading
) -> list[Recording | ResponseTable]:
    """What a model is held against: one of lines, against the lines of a run that measured some; else samples."""
    if isinstance(source, str | Path) and "band_hz" in model.origin:
        path = Path(source)
        if holds_responses(path) and speaks_of(path, inputs, output):
            return list(responses_of_run(path).values())
    return [read_source(source, reading)]


def compare_runs(first: Path, second: Path) -> RunComparison:
    """Compare two runs of one procedure, the earlier with the later, in whichever order they are given.

    Raises:
        SettingError: runs of different procedures.
        FileError: not a run folder.
    """
    (earlier, before), (later, after) = sorted(
        ((folder, read_header(folder)) for folder in (first, second)), key=lambda run: run[1].started_utc
    )
    one, other = (_dated(*run) for run in ((earlier, before), (later, after)))
    if one.procedure != other.procedure:
        raise SettingError(
            f"{earlier} is a run of {one.procedure or 'nothing'}, {later} of {other.procedure or 'nothing'}; runs of "
            "one procedure can be compared"
        )
    one_bench = instruments_mark(before) == instruments_mark(after)
    return RunComparison(one, other, one_bench, tuple(differences(one, other, one_bench=one_bench)))


def _dated(folder: Path, header: Header) -> Results:
    """The results of a run with its date, which earlier versions did not write into them."""
    return results_of_run(folder).model_copy(update={"started_utc": header.started_utc})
