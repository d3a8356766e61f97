"""Two runs side by side, without a model."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hil.errors import SettingError
from hil.findings.difference import Difference, differences
from hil.findings.results import Results
from hil.record.header import read_header
from hil.session.results import results_of_run


@dataclass(frozen=True, slots=True)
class RunComparison:
    """Two runs and what differs between them. `one_bench`: whether the same instruments measured both."""

    first: Results
    second: Results
    one_bench: bool
    differences: tuple[Difference, ...]


def compare_runs(first: Path, second: Path) -> RunComparison:
    """Compare two runs of one procedure.

    Raises:
        SettingError: runs of different procedures.
        FileError: not a run folder.
    """
    one, other = results_of_run(first), results_of_run(second)
    if one.procedure != other.procedure:
        raise SettingError(
            f"{first} is a run of {one.procedure or 'nothing'}, {second} of {other.procedure or 'nothing'}; runs of "
            "one procedure can be compared"
        )
    one_bench = _instruments(first) == _instruments(second)
    return RunComparison(one, other, one_bench, tuple(differences(one, other, one_bench=one_bench)))


def _instruments(folder: Path) -> tuple[Any, ...]:
    """The bench and the calibrations in force: what two runs of one bench share."""
    header = read_header(folder)
    columns = header.samples.columns
    calibrations = tuple((column.name, tuple(sorted(map(str, column.calibration.items())))) for column in columns)
    return header.meta.get("bench"), calibrations
