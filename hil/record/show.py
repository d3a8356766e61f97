"""For a notebook: an HTML table, a picture with an axis for each unit, and the tables of pandas and xarray."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from hil.errors import InputError
from hil.extras import lacking


def table_html(heads: Sequence[str], rows: Sequence[Sequence[str]], caption: str) -> str:
    """An HTML table; every cell is text and is escaped."""
    head = "".join(f"<th>{escape(text)}</th>" for text in heads)
    body = "".join(f"<tr>{''.join(f'<td>{escape(text)}</td>' for text in row)}</tr>" for row in rows)
    return f"<table><caption>{escape(caption)}</caption><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def figure_by_unit(lines: Sequence[tuple[str, str, Any]], heading: str, across: Any) -> Any:
    """A matplotlib figure of lines (name, unit, values) over what the heading says, an axis for each unit."""
    from matplotlib.figure import Figure

    units = list(dict.fromkeys(unit for _, unit, _ in lines))
    figure = Figure(figsize=(8.0, 1.2 + 2.0 * len(units)), layout="constrained")
    axes = figure.subplots(len(units), 1, sharex=True, squeeze=False)[:, 0]
    for name, unit, values in lines:
        axes[units.index(unit)].plot(across, values, label=name, linewidth=1.0)
    for axis, unit in zip(axes, units, strict=True):
        axis.set_ylabel(unit)
        axis.legend()
    axes[-1].set_xlabel(heading)
    return figure


def data_frame(columns: Mapping[str, Any], heading: str, over: Any) -> Any:
    """A pandas DataFrame, indexed by what the heading says."""
    import pandas as pd

    return pd.DataFrame(columns, index=pd.Index(over, name=heading))


def dataset(variables: Mapping[str, tuple[Any, str]], over: tuple[str, Any, str], name: str) -> Any:
    """An xarray Dataset of variables (values, unit) over a coordinate. Raises `InputError` without xarray."""
    try:
        import xarray
    except ModuleNotFoundError as error:
        raise InputError(f"to_xarray needs {lacking('xarray')}") from error
    coordinate, at, unit = over
    made = {key: (coordinate, values, {"units": of}) for key, (values, of) in variables.items()}
    return xarray.Dataset(made, {coordinate: (coordinate, at, {"units": unit})}, {"name": name})
