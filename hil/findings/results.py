"""What a run found, in the form in which it is handed on: `results.json`, schema `hil.results/1`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import ConfigDict, Field, ValidationError

from hil.arrays import Array
from hil.errors import FileError, first_fault, reading, storing
from hil.record.cause import Cause
from hil.record.durable import write_whole
from hil.record.measurement import RESULTS_FILE, Measured, Verdict, present_name
from hil.record.moment import Moment
from hil.record.population_comparison import PopulationComparison
from hil.record.previous_run import PreviousRunComparison
from hil.record.show import dataset, figure_by_unit, table_html
from hil.strict import Strict
from hil.units import behind_a_number
from hil.untrusted import read_untrusted_json

SCHEMA: Literal["hil.results/1"] = "hil.results/1"


class ColumnOf(Strict):
    """A column of a curve. The unit of a pure number is `1`."""

    name: str
    unit: str


class Curve(Strict):
    """A curve as a table: one row for each point. A cell is null where nothing was measured."""

    name: str
    columns: tuple[ColumnOf, ...]
    rows: tuple[tuple[float | None, ...], ...]

    def column(self, name: str) -> tuple[float | None, ...]:
        """The values of one column.

        Raises:
            KeyError: there is no column of that name.
        """
        names = [column.name for column in self.columns]
        if name not in names:
            raise KeyError(f"curve '{self.name}' has no column '{name}'; it has: {', '.join(names)}")
        return tuple(row[names.index(name)] for row in self.rows)

    def array(self, name: str) -> Array:
        """The same with NaN where nothing was measured, shape (n,)."""
        return np.array([np.nan if value is None else value for value in self.column(name)], dtype=np.float64)

    @property
    def shown(self) -> tuple[ColumnOf, ...]:
        """What is drawn over the first column: all others but standard uncertainties."""
        return tuple(column for column in self.columns[1:] if not column.name.endswith("std"))

    def to_pandas(self) -> Any:
        """A pandas DataFrame with columns `name [unit]`."""
        import pandas as pd

        heads = [f"{column.name} [{column.unit}]" for column in self.columns]
        return pd.DataFrame(list(self.rows), columns=heads)

    def to_xarray(self) -> Any:
        """An xarray Dataset over the first column, units as attributes. Raises `InputError` without xarray."""
        first, *others = self.columns
        variables = {c.name: (list(self.column(c.name)), c.unit) for c in others}
        return dataset(variables, (first.name, list(self.column(first.name)), first.unit), self.name)

    def plot(self) -> Any:
        """A matplotlib figure: every column over the first, an axis for each unit; a frequency is logarithmic."""
        first = self.columns[0]
        lines = [(c.name, c.unit, self.column(c.name)) for c in self.shown]
        figure = figure_by_unit(lines, f"{first.name} [{first.unit}]", self.column(first.name))
        if first.unit == "Hz":
            figure.axes[-1].set_xscale("log")
        figure.axes[0].set_title(self.name)
        return figure


class FittedFunction(Strict):
    """A fitted transfer function B(s)/A(s)·e^(−s·dead time), coefficients from the highest power down.

    `covariance` is of `coefficients`: the numerator, the denominator without its leading 1, the dead time where it was
    estimated. `unit` is that of the gain.
    """

    name: str
    numerator: tuple[float, ...]
    denominator: tuple[float, ...]
    dead_time_s: float
    unit: str
    coefficients: tuple[str, ...]
    covariance: tuple[tuple[float | None, ...], ...]
    fit_percent: float | None = None

    @property
    def coefficient_values(self) -> tuple[float, ...]:
        """In the order of `coefficients`."""
        every = (*self.numerator, *self.denominator[1:], self.dead_time_s)
        return every[: len(self.coefficients)]

    @property
    def formula(self) -> str:
        """On one line, as a paper prints it, with the unit of the gain; a pure number has none."""
        from hil.physics.formula import formula
        from hil.physics.transfer_function import transfer_function

        found = transfer_function(self.numerator, self.denominator, self.dead_time_s)
        return formula(found) + behind_a_number(self.unit)

    @property
    def line(self) -> str:
        """What everybody reads of it with 95 % intervals, then the formula."""
        import numpy as np

        from hil.physics.readings import Reading, readings
        from hil.signals.interval import COVERED, is_arithmetic, rounded, width

        def text(one: Reading) -> str:
            std = None if one.std is None or is_arithmetic(COVERED * one.std, one.value) else one.std
            return " ".join(filter(None, (one.name, rounded(one.value, std), width(std) if std else "", one.unit)))

        found = readings(
            np.array(self.numerator), np.array(self.denominator), self.dead_time_s,
            np.array(self.covariance, dtype=np.float64), "" if self.unit == "1" else self.unit,
        )  # fmt: skip
        return f"transfer function: {self.name}: {'; '.join(filter(None, (', '.join(map(text, found)), self.formula)))}"


class Results(Strict):
    """Everything that a run found. `run` is the name of its folder.

    `codes`: what notes and deviations are made of, a template and its values, by their text.
    `simulated`: whether a simulated device had a part in it; null in files of versions that did not say so.
    `ended`: what kept the run from ending as planned; null for one that did.
    """

    model_config = ConfigDict(populate_by_name=True)

    schema_: Literal["hil.results/1"] = Field(default=SCHEMA, alias="schema")
    run: str
    procedure: str
    serial: str | None
    operator: str | None = None
    started_utc: Moment | None = None
    verdict: Verdict | None
    values: tuple[Measured, ...]
    curves: tuple[Curve, ...] = ()
    transfer_functions: tuple[FittedFunction, ...] = ()
    notes: tuple[str, ...] = ()
    deviations: tuple[str, ...] = ()
    codes: Mapping[str, Any] = Field(default_factory=dict)
    population: PopulationComparison | None = Field(
        default=None, validation_alias="likeness", serialization_alias="likeness"
    )
    since: PreviousRunComparison | None = None
    cause: Cause | None = None
    simulated: bool | None = None
    ended: str | None = None

    @property
    def figures(self) -> tuple[Measured, ...]:
        """Those of the unit's condition, beside good ones of its type; none where no procedure knows them."""
        return self.population.figures if self.population else ()

    def __getitem__(self, name: str) -> Measured:
        """A value by its full name (`bandwidth_3db, +50 ± 5 %`), of this version or an earlier one.

        Raises:
            KeyError: there is none; names those there are.
        """
        found = next((value for value in self.values if present_name(value.name) == present_name(name)), None)
        if found is None:
            raise KeyError(f"no value '{name}'; there are: {', '.join(value.name for value in self.values)}")
        return found

    def _repr_html_(self) -> str:
        rows = [(v.name, _value_text(v), v.unit, v.limits, v.verdict or "") for v in self.values]
        caption = f"{self.run}: {self.procedure}, {self.verdict or 'no limits were given'}"
        return table_html(("quantity", "value", "unit", "limits", "verdict"), rows, caption)

    def to_pandas(self) -> Any:
        """The values as a pandas DataFrame, indexed by name."""
        import pandas as pd

        return pd.DataFrame([asdict(value) for value in self.values]).set_index("name")

    def plot(self, name: str = "") -> Any:
        """A matplotlib figure of one curve, the first when none is named. Raises `KeyError` where there is none."""
        found = next((curve for curve in self.curves if not name or curve.name == name), None)
        if found is None:
            raise KeyError(f"no curve '{name}'; there are: {', '.join(curve.name for curve in self.curves) or 'none'}")
        return found.plot()

    def as_json(self) -> str:
        """The document, indented, no NaN or infinity in it."""
        return self.model_dump_json(indent=1, by_alias=True) + "\n"


def _value_text(value: Measured) -> str:
    if value.value is None:
        return "not determined"
    sign = "" if value.relation == "=" else f"{value.relation} "
    expanded = f" ± {value.expanded:.2g}" if value.expanded else ""
    return f"{sign}{value.value:.6g}{expanded}"


def write_results(results: Results, folder: Path) -> None:
    """Write `results.json` into a run folder.

    Raises:
        StorageError: it cannot be written.
    """
    path = folder / RESULTS_FILE
    with storing(path, kept="; the samples are kept"):
        write_whole(path, results.as_json())


def read_results(path: Path) -> Results:
    """Results from a file.

    Raises:
        FileError: it cannot be read, or is not what this program writes; names the field.
    """
    with reading(path):
        content = read_untrusted_json(path.parent, path.name)
    version = content.get("schema") if isinstance(content, Mapping) else None
    if version != SCHEMA:
        raise FileError(f"{path}: field 'schema' is {version!r:.40}; this program reads '{SCHEMA}'")
    try:
        return Results.model_validate(content)
    except ValidationError as error:
        raise FileError(f"{path}: {first_fault(error)}") from None


def schema() -> dict[str, Any]:
    """The JSON Schema of `results.json`."""
    return {"$id": SCHEMA, **Results.model_json_schema(by_alias=True)}
