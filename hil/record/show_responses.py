"""A frequency response for a notebook: a table, a Bode diagram, and the tables of pandas and xarray."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hil.record.show import needed, table_html

if TYPE_CHECKING:
    from hil.record.response_table import ResponseTable

_DB = 20.0


def response_html(table: ResponseTable) -> str:
    """Its lines."""
    gain, phase = np.abs(table.response), np.degrees(np.unwrap(np.angle(table.response)))
    rows = [(f"{f:.4g}", f"{g:.4g}", f"{p:.1f}") for f, g, p in zip(table.frequency_hz, gain, phase, strict=True)]
    return table_html(("frequency [Hz]", f"gain [{table.unit}]", "phase [deg]"), rows, table.name)


def response_figure(tables: Sequence[ResponseTable]) -> Any:
    """Gain in dB of its unit, and phase, over the frequency."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    for table in tables:
        above.plot(
            table.frequency_hz,
            _DB * np.log10(np.abs(table.response)),
            ".-",
            label=table.name.rsplit("/", 1)[-1],
            linewidth=1.0,
        )
        below.plot(table.frequency_hz, np.degrees(np.unwrap(np.angle(table.response))), ".-", linewidth=1.0)
    units = ", ".join(dict.fromkeys(table.unit for table in tables))
    above.set_ylabel(f"gain [dB of {units}]" if units != "1" else "gain [dB]")
    above.legend(fontsize="small")
    below.set_ylabel("phase [deg]")
    below.set_xlabel("frequency [Hz]")
    below.set_xscale("log")
    return figure


def response_frame(table: ResponseTable) -> Any:
    """A pandas DataFrame."""
    pandas = needed("pandas", "to_pandas")
    columns = {f"{name} [{unit}]": values for name, (values, unit) in _columns(table).items()}
    return pandas.DataFrame(columns, index=pandas.Index(table.frequency_hz, name="frequency [Hz]"))


def response_dataset(table: ResponseTable) -> Any:
    """An xarray Dataset."""
    xarray = needed("xarray", "to_xarray")
    variables = {name: ("frequency", values, {"units": unit}) for name, (values, unit) in _columns(table).items()}
    return xarray.Dataset(variables, {"frequency": ("frequency", table.frequency_hz, {"units": "Hz"})},
                          {"name": table.name})  # fmt: skip


def _columns(table: ResponseTable) -> dict[str, tuple[Any, str]]:
    gain = np.abs(table.response)
    found = {"gain": (gain, table.unit), "phase": (np.degrees(np.unwrap(np.angle(table.response))), "deg")}
    if table.gain_std is not None:
        found["gain std"] = (gain * table.gain_std, table.unit)
    if table.phase_std_rad is not None:
        found["phase std"] = (np.degrees(table.phase_std_rad), "deg")
    return found
