"""The one style of every drawing, and drawings as SVG inside a page: text stays text, bytes repeat."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from hil.arrays import ROUNDING
from hil.language.words import _
from hil.record.recording import Array
from hil.report.field import Curve, label_of, needed, unit_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

    from hil.findings.results import ColumnOf

# Okabe and Ito's colours, in an order in which neighbours also differ in grey; lines differ in their dashes too.
INK, SOFT, GRID, FAINT = "#1b1f24", "#59626d", "#e3e6ea", "#eef0f3"
BLUE, RED, GREEN, AMBER, SKY, PINK = "#0072b2", "#d55e00", "#009e73", "#e69f00", "#56b4e9", "#a8578a"
SERIES = (BLUE, RED, GREEN, PINK, AMBER, SKY, INK)
DASHES = ("-", "--", ":", "-.")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")

# What is drawn alike on every page: samples, what was fitted to them and leaves what, the command, a level to read at.
MEASURED: Mapping[str, Any] = {"color": "#8b949e", "lw": 1.8}
FITTED: Mapping[str, Any] = {"color": BLUE, "lw": 1.0}
LEFT: Mapping[str, Any] = {"color": INK, "lw": 0.7}
COMMAND: Mapping[str, Any] = {"color": INK, "lw": 0.8, "ls": "--"}
BAND: Mapping[str, Any] = {"alpha": 0.15, "lw": 0.0}  # of an uncertainty
LEVEL: Mapping[str, Any] = {"color": SOFT, "lw": 0.8, "ls": ":"}

WIDTH_IN = 8.4
POINTS = 400  # of a drawn function
MOST_DRAWN = 12  # curves of one kind that a page draws
_FEW = 4  # drawings that stand two beside each other; more of them three, and lower
_COLUMNS = 900  # of a drawing of the page's width: more samples are drawn as the span of each column

_TICKS = {"color": SOFT, "labelcolor": INK, "labelsize": 8}
_STYLE = {
    "svg.fonttype": "none", "text.parse_math": False, "font.family": "DejaVu Sans", "font.size": 8.5,
    "axes.titlesize": "medium", "axes.titleweight": "bold", "axes.titlelocation": "left", "axes.titley": 1.0,
    "axes.labelcolor": INK, "axes.edgecolor": SOFT,
    "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True, "axes.axisbelow": True,
    "axes.formatter.useoffset": False, "grid.color": GRID, "grid.linewidth": 0.6, "text.color": INK,
    "lines.linewidth": 1.3, "lines.markersize": 3.6, "errorbar.capsize": 1.6,
    "legend.frameon": False, "legend.fontsize": 8, "legend.handlelength": 2.4, "legend.borderaxespad": 0.2,
    "savefig.format": "svg",
} | {f"{axis}tick.{key}": value for axis in "xy" for key, value in _TICKS.items()}  # fmt: skip
_ABOUT = {"left": 0.05, "right": 0.99, "bottom": 0.08, "top": 0.94, "wspace": 0.08, "hspace": 0.2}
_SIDE_PT, _EDGE_PT, _BETWEEN = 3.0, 4.32, 0.02  # beside and above every drawing; share of the page between columns
_FONT = "'Helvetica Neue',Helvetica,Arial,'Liberation Sans',sans-serif"


@dataclass(frozen=True, slots=True)
class Picture:
    """A drawing with its caption. `svg` is markup of our own, with every text in it escaped."""

    svg: str
    caption: str = ""


@contextmanager
def drawn_alike(style: Mapping[str, Any]) -> Iterator[None]:
    """What is drawn inside looks alike everywhere: a `matplotlibrc` of the working folder may ask for LaTeX.

    Args:
        style: what is unlike matplotlib's own defaults.
    """
    import matplotlib as mpl

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(style)  # type: ignore[arg-type]
        yield


def drawn(name: str, height_in: float, draw: Callable[[Figure], None], caption: str = "") -> Picture:
    """A picture of the page's width.

    Args:
        name: unlike any other on the page.
        height_in: of the picture, in inches.
        draw: fills the empty figure.
        caption: below the picture, and for those who cannot see it.
    """
    from matplotlib.figure import Figure

    from hil.report.tick_labels import with_decimal_sign

    style = {**_STYLE, "svg.hashsalt": name}
    file = io.StringIO()
    with drawn_alike(style), warnings.catch_warnings():
        # A letter that the measuring font lacks is drawn by the reader's font; a crowded drawing is still a drawing.
        warnings.simplefilter("ignore", UserWarning)
        figure = Figure(figsize=(WIDTH_IN, height_in), dpi=72.0)  # as the page has it
        draw(figure)
        with_decimal_sign(figure)
        lay_out(figure)
        figure.savefig(file, transparent=True, metadata={"Date": None, "Creator": None})
    return Picture(_inline(file.getvalue(), name, caption), caption)


def lay_out(figure: Figure) -> None:
    """Room for every text, found once, with the paddings of matplotlib's constrained layout.

    That one looks at every tick, spine and line of every drawing some thirty times. Here the texts around the axes are
    measured, and the widest gap between two columns or rows stands for all of them.
    """
    from matplotlib.backends.backend_svg import RendererSVG

    figure.subplots_adjust(**_ABOUT)  # how many ticks there are, and what is wider than its axes, depends on it
    width, height = (72.0 * inches for inches in figure.get_size_inches().tolist())
    renderer = RendererSVG(width, height, io.StringIO())  # type: ignore[no-untyped-call]
    for axes in figure.axes:
        _keep_ticks(axes.xaxis)
        _keep_ticks(axes.yaxis)
    shown = [(axes, at) for axes in figure.axes if axes.get_visible() and (at := axes.get_subplotspec())]
    if not shown:
        return
    rows, columns, *_ = shown[0][1].get_geometry()
    across, down = np.zeros((rows, columns + 1)), np.zeros((rows + 1, columns))
    for axes, at in shown:
        inner, texts = axes.get_window_extent(renderer), [*axes.texts, *filter(None, [axes.get_legend()])]
        outer = axes.get_tightbbox(renderer, bbox_extra_artists=texts, for_layout_only=True) or inner
        row, column = at.rowspan.start, at.colspan.start
        across[row, column : column + 2] += inner.x0 - outer.x0, outer.x1 - inner.x1
        down[row : row + 2, column] += outer.y1 - inner.y1, inner.y0 - outer.y0
    legends = sum(legend.get_window_extent(renderer).height + 2.0 * _EDGE_PT for legend in figure.legends)
    left, right = across[:, 0].max() + _SIDE_PT, across[:, -1].max() + _SIDE_PT
    top, bottom = down[0].max() + _EDGE_PT + legends, down[-1].max() + _EDGE_PT
    beside = across[:, 1:-1].max(initial=0.0) + 2.0 * max(_SIDE_PT, _BETWEEN * width / columns)
    below = down[1:-1].max(initial=0.0) + 2.0 * _EDGE_PT
    figure.subplots_adjust(
        left=left / width, right=1.0 - right / width, bottom=bottom / height, top=1.0 - top / height,
        wspace=beside * columns / (width - left - right - beside * (columns - 1)),
        hspace=below * rows / (height - top - bottom - below * (rows - 1)),
    )  # fmt: skip


def _keep_ticks(axis: Axis) -> None:
    """Find the ticks in view once: a locator is asked ten times, and a tick beyond the view is made, not drawn."""
    from matplotlib.ticker import FixedLocator

    low, high = np.sort(axis.get_view_interval())
    edge = ROUNDING * (high - low)
    for found, keep in (
        (axis.get_majorticklocs(), axis.set_major_locator), (axis.get_minorticklocs(), axis.set_minor_locator),
    ):  # fmt: skip
        keep(FixedLocator(found[(found >= low - edge) & (found <= high + edge)]))


def small_multiples(
    name: str,
    curves: Sequence[Curve],
    draw_one: Callable[[Axes, Curve], None],
    x: tuple[str, str],
    y: tuple[str, str],
    caption: str,
) -> Picture:
    """A drawing of each curve, beside and below each other, with one legend over all of them.

    Args:
        name: unlike any other on the page.
        curves: that are drawn; the caption says how many more there are than a page draws.
        draw_one: draws one, whose label stands over it.
        x: what its x axis says, below the lowest of each column, and the key of its unit.
        y: likewise of the y axis, at the left.
        caption: below the picture.
    """
    shown = curves[:MOST_DRAWN]
    if len(curves) > MOST_DRAWN:
        caption += " " + _("{n} more are not drawn.").format(n=len(curves) - MOST_DRAWN)
    columns = min(2 if len(shown) <= _FEW else 3, len(shown))
    rows = -(-len(shown) // columns)

    def draw(figure: Figure) -> None:
        grid = figure.subplots(rows, columns, squeeze=False).ravel()
        for axes, curve in zip(grid, shown, strict=False):
            titled(axes, label_of(curve))
            draw_one(axes, curve)
        for axes in grid[::columns]:
            axes.set_ylabel(y[0] + unit_of(curves[0], y[1]))
        for axes in grid[max(0, len(shown) - columns) : len(shown)]:
            axes.set_xlabel(x[0] + unit_of(curves[0], x[1]))
        for axes in grid[len(shown) :]:
            axes.set_visible(False)
        legend_on_top(grid[0])

    return drawn(name, 0.5 + (2.3 if len(shown) <= _FEW else 1.75) * rows, draw, caption)


def thinned(x: Array, y: Array, columns: int = _COLUMNS) -> tuple[Array, Array]:
    """A line with no more points than can be seen: the least and the largest value of every column."""
    if len(x) <= 3 * columns:
        return x, y
    edges = np.linspace(0, len(x), columns + 1).astype(np.int64)
    picked = np.empty((columns, 2), np.int64)
    for i, (first, stop) in enumerate(pairwise(edges)):
        part = y[first:stop]
        picked[i] = sorted((first + int(part.argmin()), first + int(part.argmax())))
    indices = np.unique(picked)
    return x[indices], y[indices]


def line(axes: Axes, curve: Curve, x: str, y: str, style: Mapping[str, Any], label: str = "") -> None:
    """One array of a curve over another."""
    axes.plot(*thinned(needed(curve, x), needed(curve, y)), label=label, **style)


def titled(axes: Axes, title: str) -> None:
    """One of several drawings beside each other: a quiet title at its right, and its curves from edge to edge."""
    axes.set_title(title, fontweight="normal", loc="right", pad=3.0)
    axes.margins(x=0.0)


def plain_log(axis: Axis) -> None:
    """A logarithmic axis with 0.1, 1, 10 on it instead of powers of ten, where the span allows."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = axis.get_view_interval()
    steps = (1.0, 2.0, 5.0) if np.log10(high / low) < 2.5 else (1.0,)
    axis.set_major_locator(LogLocator(subs=steps, numticks=30))
    axis.set_major_formatter(FuncFormatter(lambda value, _place: f"{value:g}"))
    axis.set_minor_locator(LogLocator(subs="all", numticks=99))
    axis.set_minor_formatter(NullFormatter())


def along(axes: Axes, column: ColumnOf) -> None:
    """What a drawing goes along: the name and unit of a column, frequencies on a logarithmic axis."""
    axes.set_xlabel(f"{_(column.name)} [{column.unit}]")
    if column.unit == "Hz":
        axes.set_xscale("log")
        plain_log(axes.xaxis)


def legend_above(axes: Axes, columns: int = 4) -> None:
    """The legend on one line over one of several drawings beside each other, where it hides nothing."""
    handles = axes.get_legend_handles_labels()[0]
    if handles:
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.01), ncols=min(columns, len(handles)), borderpad=0.0,
                    columnspacing=1.4, handletextpad=0.5)  # fmt: skip


def legend_on_top(axes: Axes) -> None:
    """The legend of one drawing on one line over the whole picture, which keeps room for it."""
    handles, labels = axes.get_legend_handles_labels()
    figure = axes.get_figure()
    if handles and figure is not None:
        figure.legend(handles, labels, loc="outside upper left", ncols=len(handles), borderpad=0.0, columnspacing=1.4,
                      handletextpad=0.5)  # fmt: skip


def _inline(svg: str, name: str, alt: str) -> str:
    """Markup that stands inside a page: no prolog, no namespaces, identifiers unlike those of other pictures."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>\s*", "", svg, count=1, flags=re.DOTALL)
    svg = re.sub(r"<style[^>]*>.*?</style>\s*", "", svg, count=1, flags=re.DOTALL)
    svg = re.sub(r'\sxmlns(:xlink)?="[^"]*"', "", svg).replace("xlink:href", "href")
    svg = re.sub(r'id="([^"]*)"', rf'id="{name}-\1"', svg)
    svg = re.sub(r'(href="#|url\(#)', rf"\1{name}-", svg)
    svg = re.sub(r"'DejaVu Sans'[^;\"]*?(?=[;\"])", _FONT, svg)
    svg = re.sub(r"(?<= )d=\"[^\"]*\"", _shorter, svg)
    width, height = re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', svg).groups()  # type: ignore[union-attr]
    start = f'<svg role="img" aria-label="{_escaped(alt)}" viewBox="0 0 {width} {height}">'
    return start + svg[svg.index(">") + 1 :].strip()


def _shorter(path: re.Match[str]) -> str:
    """Coordinates down to a hundredth of a point."""
    return re.sub(r"\.0(?:0\d*)?(?!\d)|(?<=\.\d)0\d*|(?<=\.\d\d)\d+", "", path[0])


def _escaped(text: str) -> str:
    from markupsafe import escape

    return str(escape(text))
