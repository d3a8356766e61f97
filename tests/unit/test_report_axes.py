"""Whatever a page draws of frequency responses lies within its axes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from hil.report import responses
from hil.report.figure import Picture, lay_out, legend_on_top


def curve(bias: float, amplitude: float, thd: float, top_hz: float, level_db: float) -> dict[str, object]:
    f = np.geomspace(0.1, top_hz, 12)
    return {
        "label": f"{bias:+g} ± {amplitude:g} %", "bias": bias, "frequency_hz": f, "magnitude_db": level_db - f,
        "phase_deg": -20.0 * f, "thd_percent": np.full(12, thd), "odd_db": np.full(12, level_db - 10.0),
        "noise_db": np.full(12, -60.0),
    }  # fmt: skip


CURVES = (curve(50, 5, 2.0, 5.0, 0.0), curve(50, 20, 19.0, 5.0, 1.0), curve(-50, 5, 30.0, 50.0, 40.0))


def drawings(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    made = []

    def drawn(name: str, height: float, draw: Callable[[Figure], None], caption: str = "", alt: str = "") -> Picture:
        figure = Figure(figsize=(7.0, height))
        draw(figure)
        made.append(figure)
        return Picture(name, caption)

    monkeypatch.setattr(responses, "drawn", drawn)
    responses.responses_section(CURVES)
    return made


def test_every_point_of_a_bode_diagram_and_of_distortions_is_seen(monkeypatch):
    figures = drawings(monkeypatch)
    assert len(figures) == 3
    for figure in figures:
        for axes in figure.axes:
            (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
            for line in axes.lines:
                x, y = np.asarray(line.get_xdata(), float), np.asarray(line.get_ydata(), float)
                assert np.all((y >= low) & (y <= high)), f"{axes.get_ylabel()}: {y.min():g} … {y.max():g}"
                if len(x) > 2:
                    assert np.all((x >= left) & (x <= right)), axes.get_xlabel()


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (3, 1), (2, 3)])
def test_every_text_has_room_of_its_own(rows, columns):
    figure = Figure(figsize=(8.4, 1.0 + 1.5 * rows), dpi=72.0)
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in grid:
        axes.plot([0.0, 1e4], [-0.001, 12345.6], label="measured")
        axes.set(xlabel="time [s]", ylabel="flow\n[l/min]", title="+50 ± 20 %")
    legend_on_top(grid[0])
    lay_out(figure)
    renderer = FigureCanvasAgg(figure).get_renderer()
    boxes = [one.get_tightbbox(renderer) for one in (*grid, *figure.legends)]
    for k, box in enumerate(boxes):
        assert box.x0 >= 0.0 and box.x1 <= figure.bbox.x1 and box.y0 >= 0.0 and box.y1 <= figure.bbox.y1 + 1.0
        assert not any(box.overlaps(other) for other in boxes[:k])
