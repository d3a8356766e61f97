"""Two runs side by side."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from hil.errors import SettingError
from hil.findings.difference import Difference, differences
from hil.findings.results import Results
from hil.record.run_folder.header import Header, read_header
from hil.record.run_folder.instruments import instruments_mark
from hil.session.kept_results import results_of_run


@dataclass(frozen=True, slots=True)
class RunComparison:
    """Two runs, `first` the earlier one, and what differs: the change is second less first.

    Both results have `started_utc`. `one_bench`: whether the same instruments measured both.
    """

    first: Results
    second: Results
    one_bench: bool
    differences: tuple[Difference, ...]


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
