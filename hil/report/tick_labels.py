"""Numbers on the axes of a drawing with the decimal sign of the page's language."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure
from matplotlib.ticker import Formatter

from hil.language.figures import localised
from hil.language.words import ENGLISH, spoken


class Localised(Formatter):
    """Another formatter's labels with the decimal sign."""

    def __init__(self, shown: Formatter) -> None:
        self._shown = shown

    def set_axis(self, axis: Any) -> None:
        """Both look at the same axis."""
        super().set_axis(axis)
        self._shown.set_axis(axis)

    def __call__(self, x: float, pos: int | None = None) -> str:
        """One label."""
        return localised(self._shown(x, pos))

    def format_ticks(self, values: list[float]) -> list[str]:
        """All labels of an axis at once: they share their digits."""
        return [localised(text) for text in self._shown.format_ticks(values)]

    def get_offset(self) -> str:
        """What stands once at the end of the axis."""
        return localised(self._shown.get_offset())


def with_decimal_sign(figure: Figure) -> None:
    """Write the numbers on all axes as the language that is spoken writes them."""
    if spoken() == ENGLISH:
        return
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(Localised(axis.get_major_formatter()))
