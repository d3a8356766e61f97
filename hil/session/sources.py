"""What a calculation is given, as values or as the paths of files, and what was assumed when it was read."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Union

from hil.errors import FileError
from hil.language.note import OF, Note
from hil.record.invalid_samples import notes_of_reading
from hil.record.read import read_file, recorded
from hil.record.reading import AS_IT_IS, Reading
from hil.record.recording import Recording
from hil.record.table.frame import from_memory
from hil.record.table.named import as_stated
from hil.record.table.response_table import ResponseTable
from hil.session.several import several

if TYPE_CHECKING:
    import pandas as pd

    from hil.identification.preparation.experiment import Experiment

Source = Union[Recording, ResponseTable, str, Path, Mapping[str, Any], "pd.DataFrame"]


def read_source(
    source: Source, reading: Reading | None, *, responses: bool = False, part: str = "",
    inputs: Sequence[str] = (), output: str = "",
) -> Recording | ResponseTable:  # fmt: skip
    """A recording or a table of a frequency response.

    Args:
        source: a value that was read already, the path of one, or columns in memory (see `from_memory`).
        reading: options for a path.
        responses: of a run that measured frequency responses, those and not its samples.
        part: of a run that measured several, the one of this name; asks for it as `responses` does.
        inputs: names of the channels that are wanted: responses of another command are not taken.
        output: likewise of the response.

    Raises:
        FileError: it cannot be read, or the run has no such part.
    """
    if isinstance(source, Recording | ResponseTable):
        return source
    if not isinstance(source, str | Path):
        return from_memory(source, reading)
    if not Path(source).is_dir():
        return read_file(source, reading or AS_IT_IS)
    run = recorded(source)
    if responses or part:
        from hil.session.responses import measured_responses, response_of_run

        if measured_responses(run, inputs, output):
            return response_of_run(run, part)
    return as_stated(run, reading or AS_IT_IS)


def samples_of(source: Source, reading: Reading | None) -> Recording:
    """Samples in time.

    Raises:
        FileError: a table of a frequency response.
    """
    found = read_source(source, reading)
    if isinstance(found, ResponseTable):
        raise FileError(f"{found.name}: a table of a frequency response, where samples in time are needed")
    return found


def all_samples(given: Source | Iterable[Source], reading: Reading | None) -> list[Recording]:
    """Samples in time of one source or of several. Raises `FileError` as `samples_of`."""
    sources: list[Source] = several(given)
    return [samples_of(one, reading) for one in sources]


def tables_of(sources: Iterable[Source], reading: Reading | None = None, part: str = "") -> list[ResponseTable]:
    """Frequency responses from tables and from runs that measured them.

    Raises:
        FileError: samples in time.
    """
    found = []
    for source in sources:
        one = read_source(source, reading, responses=True, part=part)
        if isinstance(one, Recording):
            raise FileError(f"{one.name}: samples in time, not a frequency response; `hil run` measures one")
        found.append(one)
    return found


def notes_on(read: Sequence[Recording | ResponseTable], experiments: Iterable[Experiment] = ()) -> list[Note]:
    """What was assumed or changed when these were read and used, a sentence each, none twice."""
    notes = [Note(OF, recording=one.name, note=note) for one in read for note in notes_of_reading(one.meta)]
    return list(dict.fromkeys([*notes, *(note for e in experiments for note in e.notes)]))
