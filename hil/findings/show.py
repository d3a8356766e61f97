"""Results for a notebook: a table of the values, a picture of a curve."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hil.record.measurement import Measured
from hil.record.show import table_html

if TYPE_CHECKING:
    from hil.findings.results import Curve, Results


def results_html(results: Results) -> str:
    """The values with their expanded uncertainty, limits and verdicts."""
    rows = [(value.name, _value(value), value.unit, _limits(value), value.verdict or "") for value in results.values]
    caption = f"{results.run}: {results.procedure}, {results.verdict or 'no limits were given'}"
    return table_html(("quantity", "value", "unit", "limits", "verdict"), rows, caption)


def curve_figure(curve: Curve) -> Any:
    """Every column over the first one; a frequency is drawn on a logarithmic axis."""
    from matplotlib.figure import Figure

    first, *others = curve.columns
    units = list(dict.fromkeys(column.unit for column in others if not column.name.endswith("std")))
    figure = Figure(figsize=(8.0, 1.2 + 2.0 * len(units)), layout="constrained")
    axes = figure.subplots(len(units), 1, sharex=True, squeeze=False)[:, 0]
    across = curve.column(first.name)
    for axis, unit in zip(axes, units, strict=True):
        for column in others:
            if column.unit == unit and not column.name.endswith("std"):
                axis.plot(across, curve.column(column.name), label=column.name)
        axis.set_ylabel(unit)
        axis.legend()
    if first.unit == "Hz":
        axes[-1].set_xscale("log")
    axes[-1].set_xlabel(f"{first.name} [{first.unit}]")
    axes[0].set_title(curve.name)
    return figure


def _value(value: Measured) -> str:
    if value.value is None:
        return "not determined"
    sign = "" if value.relation == "=" else f"{value.relation} "
    expanded = f" ± {value.expanded:.2g}" if value.expanded else ""
    return f"{sign}{value.value:.6g}{expanded}"


def _limits(value: Measured) -> str:
    if value.low is None and value.high is None:
        return ""
    return f"{'' if value.low is None else f'{value.low:g}'} … {'' if value.high is None else f'{value.high:g}'}"
