"""Results as files for other tools: CSV and spreadsheet."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from hil.errors import InputError, storing
from hil.extras import lacking
from hil.findings.results import Curve, FittedFunction, Results
from hil.record.csv_text import csv_text
from hil.record.durable import write_named

if TYPE_CHECKING:
    from openpyxl.worksheet.worksheet import Worksheet

VALUE_HEADS = ("name", "relation", "value", "std", "unit", "low", "high", "verdict", "meaning", "simulated")
FUNCTION_HEADS = ("name", "coefficient", "value", "std", "unit of the gain")
_SHEET_NAME = 31  # characters that a spreadsheet allows

Cell = str | float | bool | None
Row = Sequence[Cell]


def values_csv(results: Results) -> str:
    """The measured values, a row each."""
    return csv_text(VALUE_HEADS, _value_rows(results))


def curve_csv(curve: Curve, *, simulated: bool | None) -> str:
    """A curve, columns headed `name [unit]` as in a recording, and whether it is of a simulated valve."""
    return csv_text((*_heads(curve), VALUE_HEADS[-1]), ((*row, simulated) for row in curve.rows))


def write_csv(results: Results, path: Path) -> tuple[Path, ...]:
    """Write the values to a file and each curve beside it as STEM_NAME.csv; returns what was written.

    Raises:
        StorageError: a file cannot be written.
    """
    texts = {path: values_csv(results)}
    for name, curve in _by_file_name(results.curves).items():
        texts[path.with_name(f"{path.stem}_{name}.csv")] = curve_csv(curve, simulated=results.simulated)
    for target, text in texts.items():
        with storing(target):
            write_named(target, text)
    return tuple(texts)


def write_xlsx(results: Results, path: Path) -> None:
    """Write a spreadsheet: a sheet of values, one of transfer functions, one for each curve.

    Raises:
        InputError: openpyxl is not installed.
        StorageError: the file cannot be written.
    """
    try:
        from openpyxl import Workbook
    except ModuleNotFoundError as error:
        raise InputError(f"a spreadsheet needs {lacking('openpyxl')}") from error
    book = Workbook()
    book.remove(book.worksheets[0])
    _fill(book.create_sheet("values"), VALUE_HEADS, _value_rows(results))
    if results.transfer_functions:
        _fill(book.create_sheet("transfer functions"), FUNCTION_HEADS, coefficient_rows(results.transfer_functions))
    for name, curve in _by_file_name(results.curves).items():
        _fill(book.create_sheet(_sheet_name(name, book.sheetnames)), _heads(curve), curve.rows)
    content = BytesIO()
    book.save(content)
    with storing(path):
        write_named(path, content.getvalue())


def coefficient_rows(functions: Iterable[FittedFunction]) -> Iterator[Row]:
    """Every coefficient of transfer functions with its standard uncertainty, the dead time last of each."""
    for one in functions:
        stds = {name: _root(one.covariance[i][i]) for i, name in enumerate(one.coefficients)}
        for letter, coefficients in (("b", one.numerator), ("a", one.denominator)):
            for power, value in zip(range(len(coefficients) - 1, -1, -1), coefficients, strict=True):
                name = f"{letter}{power}"
                yield one.name, name, value, stds.get(name), one.unit
        yield one.name, "dead_time_s", one.dead_time_s, stds.get("dead_time_s"), one.unit


def _root(variance: float | None) -> float | None:
    return None if variance is None else max(variance, 0.0) ** 0.5


def _value_rows(results: Results) -> Iterator[Row]:
    for value in results.values:
        yield *(getattr(value, head) for head in VALUE_HEADS[:-1]), results.simulated


def _heads(curve: Curve) -> list[str]:
    return [f"{column.name} [{column.unit}]" for column in curve.columns]


def _fill(sheet: Worksheet, heads: Sequence[str], rows: Iterable[Row]) -> None:
    sheet.append(list(heads))
    for row in rows:
        sheet.append(list(row))
    sheet.freeze_panes = "A2"


def _by_file_name(curves: Iterable[Curve]) -> dict[str, Curve]:
    """Curves by a name that a file may have, no two alike."""
    named: dict[str, Curve] = {}
    for curve in curves:
        plain = re.sub(r"[^A-Za-z0-9+.-]+", "-", curve.name.replace("→", "to").replace("±", "pm")).strip("-")
        name, number = plain, 2
        while name.lower() in {taken.lower() for taken in named}:
            name, number = f"{plain}-{number}", number + 1
        named[name] = curve
    return named


def _sheet_name(name: str, taken: Sequence[str]) -> str:
    short, number = name[:_SHEET_NAME], 2
    while short in taken:
        tail = f"~{number}"
        short, number = name[: _SHEET_NAME - len(tail)] + tail, number + 1
    return short
