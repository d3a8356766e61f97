"""A recording for a notebook: a table of its channels, a picture, and the tables of pandas and xarray."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from hil.errors import InputError

if TYPE_CHECKING:
    from hil.record.recording import Recording

_MOST_POINTS = 20_000


def table_html(heads: Sequence[str], rows: Sequence[Sequence[str]], caption: str) -> str:
    """An HTML table; every cell is text and is escaped."""
    head = "".join(f"<th>{escape(text)}</th>" for text in heads)
    body = "".join(f"<tr>{''.join(f'<td>{escape(text)}</td>' for text in row)}</tr>" for row in rows)
    return f"<table><caption>{escape(caption)}</caption><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def recording_html(recording: Recording) -> str:
    """Its channels with their range."""
    rows = []
    for channel in recording.channels.values():
        low, high = float(np.nanmin(channel.values)), float(np.nanmax(channel.values))
        rows.append((channel.name, channel.unit, f"{low:.4g} … {high:.4g}", channel.source))
    caption = f"{recording.name}: {len(recording)} samples, {recording.duration_s:g} s"
    return table_html(("channel", "unit", "range", "source"), rows, caption)


def recording_figure(recording: Recording, names: tuple[str, ...]) -> Any:
    """A matplotlib figure, one axis for each unit."""
    from matplotlib.figure import Figure

    chosen = [recording.channel(name) for name in names or recording.channels]
    units = list(dict.fromkeys(channel.unit for channel in chosen))
    figure = Figure(figsize=(8.0, 1.2 + 2.0 * len(units)), layout="constrained")
    axes = figure.subplots(len(units), 1, sharex=True, squeeze=False)[:, 0]
    every = max(1, len(recording) // _MOST_POINTS)
    for axis, unit in zip(axes, units, strict=True):
        for channel in chosen:
            if channel.unit == unit:
                axis.plot(recording.time_s[::every], channel.values[::every], label=channel.name, linewidth=1.0)
        axis.set_ylabel(unit)
        axis.legend(loc="upper right")
    axes[-1].set_xlabel("time [s]")
    return figure


def recording_frame(recording: Recording) -> Any:
    """A pandas DataFrame: columns `name [unit]`, indexed by `time [s]`."""
    pandas = needed("pandas", "to_pandas")
    columns = {channel.heading: channel.values for channel in recording.channels.values()}
    return pandas.DataFrame(columns, index=pandas.Index(recording.time_s, name="time [s]"))


def recording_dataset(recording: Recording) -> Any:
    """An xarray Dataset: a variable for each channel with its unit, over the coordinate `time`."""
    xarray = needed("xarray", "to_xarray")
    variables = {c.name: ("time", c.values, {"units": c.unit}) for c in recording.channels.values()}
    return xarray.Dataset(variables, {"time": ("time", recording.time_s, {"units": "s"})}, {"name": recording.name})


def needed(package: str, what: str) -> Any:
    """A package that this program does without otherwise.

    Raises:
        InputError: it is not installed.
    """
    import importlib

    try:
        return importlib.import_module(package)
    except ModuleNotFoundError as error:
        raise InputError(f"{what} needs {package}: pip install {package}") from error
