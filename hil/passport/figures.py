"""Curves of the runs as drawings for paper, letters as outlines, so that no font is missing anywhere."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from hil.findings.results import Curve, Results
from hil.language.words import _, marked
from hil.report.figure import DASHES, SERIES, WIDTH_IN, along, legend_above, thinned
from hil.report.name import capital, quantity_words
from hil.report.number import label_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MOST_PICTURES, _MOST_LINES = 6, 8
_KINDS = (marked("steps"), marked("responses"), marked("large sines"), marked("flow curve"), marked("drift"))
_ABSCISSAE = (marked("time"), marked("frequency"), marked("command"))
_BESIDE = ("overlays", "model")


def pictures(results: Iterable[Results]) -> list[tuple[str, bytes]]:
    """(caption, SVG) of the main curves: those of one kind laid over each other, a run at a time."""
    found = [
        (f"{capital(_(caption))}: {_(quantity_words(run.procedure))}", curves)
        for run in results
        for caption, curves in _kinds(run.curves)
    ]
    return [(caption, _drawn(curves)) for caption, curves in found[:_MOST_PICTURES]]


def _kinds(curves: Sequence[Curve]) -> Iterator[tuple[str, list[Curve]]]:
    """Curves with one stem and the same columns; what stands beside a curve (a fit, raw periods) is left out."""
    main = [c for c in curves if len(c.columns) > 1 and c.rows and not any(part in _BESIDE for part in _parts(c))]
    for stem, members in groupby(sorted(main, key=lambda c: _parts(c)[0]), key=lambda c: _parts(c)[0]):
        kept = list(members)
        same = [c for c in kept if c.columns == kept[0].columns]
        yield stem.replace("_", " "), same[:_MOST_LINES] if len(same) <= _MOST_LINES else _spread(same)


def _spread(curves: Sequence[Curve]) -> list[Curve]:
    picked = np.linspace(0, len(curves) - 1, _MOST_LINES).round().astype(int)
    return [curves[i] for i in dict.fromkeys(picked.tolist())]


def _parts(curve: Curve) -> list[str]:
    return curve.name.split(", ")


def _drawn(curves: Sequence[Curve]) -> bytes:
    from matplotlib.figure import Figure

    from hil.report.figure import drawn_alike
    from hil.report.tick_labels import with_decimal_sign

    units = list(dict.fromkeys(column.unit for column in curves[0].shown))[:3]
    style = {"svg.fonttype": "path", "svg.hashsalt": curves[0].name, "font.size": 8, "axes.spines.top": False,
             "axes.spines.right": False, "axes.grid": True, "grid.alpha": 0.3, "legend.frameon": False,
             "figure.constrained_layout.use": False, "xtick.minor.visible": False}  # fmt: skip
    file = io.BytesIO()
    with drawn_alike(style):
        figure = Figure(figsize=(WIDTH_IN, 0.7 + 1.7 * len(units)))
        _fill(figure, curves, units)
        with_decimal_sign(figure)
        figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None})
    return file.getvalue()


def _fill(figure: Figure, curves: Sequence[Curve], units: Sequence[str]) -> None:
    grid = figure.subplots(len(units), 1, sharex=True, squeeze=False)[:, 0]
    for axes, unit in zip(grid, units, strict=True):
        _lines(axes, curves, unit)
        axes.set_ylabel(unit)
        if axes is grid[0] or len(axes.get_lines()) > len(curves):
            legend_above(axes, 3)
    along(grid[-1], curves[0].columns[0])
    height_in = figure.get_figheight()  # margins by hand: laying out by search takes longer than drawing
    figure.subplots_adjust(left=0.08, right=0.985, bottom=0.42 / height_in, top=1.0 - 0.4 / height_in, hspace=0.3)


def _lines(axes: Axes, curves: Sequence[Curve], unit: str) -> None:
    """A colour for each curve and a dash for each of its columns; of one curve a colour for each column."""
    columns = [c for c in curves[0].shown if c.unit == unit]
    for i, curve in enumerate(curves):
        for k, column in enumerate(columns):
            place = label_text(", ".join(_parts(curve)[1:]))
            label = ", ".join(filter(None, (_(column.name) if len(columns) > 1 else "", place))) or _(column.name)
            look = (i, k) if len(curves) > 1 else (k, 0)
            x, y = (curve.array(name) for name in (curve.columns[0].name, column.name))
            axes.plot(*thinned(x, y), color=SERIES[look[0] % len(SERIES)], ls=DASHES[look[1] % len(DASHES)], lw=0.8,
                      label=label)  # fmt: skip
