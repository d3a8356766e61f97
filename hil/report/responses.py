"""Frequency responses: Bode diagrams by bias and amplitude, distortion, sine fits, transfer functions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hil.language.words import _, marked
from hil.record.measurement import COVERAGE_FACTOR
from hil.report.field import Curve, array, label_of, needed, unit_of
from hil.report.figure import (
    AMBER,
    BAND,
    BLUE,
    DASHES,
    FITTED,
    INK,
    LEVEL,
    MARKERS,
    MEASURED,
    MOST_DRAWN,
    RED,
    SERIES,
    SOFT,
    Picture,
    drawn,
    legend_above,
    legend_on_top,
    plain_log,
    thinned,
    titled,
)
from hil.report.number import fixed, number, with_uncertainty
from hil.report.section import Listing, Section, Table
from hil.signals.interval import COVERED

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NEEDED = ("frequency_hz", "magnitude_db", "phase_deg")
_SIDE_BY_SIDE = 2
_DISTORTED_PERCENT = 5.0
_BELOW_NOISE_DB = 15.0
_SMALL = 200  # columns of a drawing a third as wide as the page


def responses_section(curves: Sequence[Curve]) -> Section:
    """Everything about the responses of a run."""
    figures = [*_bodes(curves), *_distortions(curves), *_overlays(curves)]
    models = [(label_of(c), model) for c in curves for model in (c.get("model"), c.get("alternative")) if model]
    texts = [f"{label}: {model['text']}" for label, model in models if model.get("text")]
    return Section(
        _("Frequency response"),
        figures=tuple(figures),
        tables=_models(curves),
        listings=(Listing(_("Coefficients with 95 % intervals, poles and zeros"), "\n\n".join(texts)),)
        if texts
        else (),
    )


def _bodes(curves: Sequence[Curve]) -> list[Picture]:
    """Amplitude ratio and phase, the amplitudes about one bias together."""
    groups = _by_bias(curves)
    pairs = [groups[i : i + _SIDE_BY_SIDE] for i in range(0, len(groups), _SIDE_BY_SIDE)]
    caption = _(
        "Bode diagram. Points: measured, bars: ±U (k = 2). Lines: fitted transfer function with its 95 % band. "
        "0 dB is the gain at the reference frequency. Dotted: −3 dB and −90°."
    )
    return [bode(f"bode-{k}", pair, caption) for k, pair in enumerate(pairs)]


def _by_bias(curves: Sequence[Curve]) -> list[list[Curve]]:
    groups: dict[object, list[Curve]] = {}
    for curve in curves:
        groups.setdefault(curve.get("bias"), []).append(curve)
    return list(groups.values())


def bode(
    name: str, groups: Sequence[Sequence[Curve]], caption: str, levels: tuple[float, ...] = (-3.0, -90.0)
) -> Picture:
    """Amplitude ratio and phase of groups of responses beside each other; dotted lines at levels of either."""
    distorted = any(array(c, "thd_percent") is not None for group in groups for c in group)
    ratios = (2.0, 1.6, 0.8) if distorted else (2.0, 1.6)

    f = np.concatenate([needed(curve, "frequency_hz") for group in groups for curve in group])
    span_hz = 0.9 * float(f.min()), 1.1 * float(f.max())

    def draw(figure: Figure) -> None:
        rows = figure.subplots(len(ratios), len(groups), sharex=True, sharey="row", squeeze=False, height_ratios=ratios)
        for column, group in enumerate(groups):
            for k, curve in enumerate(group):
                _response(rows[0][column], curve, "magnitude_db", "magnitude_std_db", k)
                _response(rows[1][column], curve, "phase_deg", "phase_std_deg", k)
            if distorted:
                _thd(rows[2][column], group)
            _frame(list(rows[:, column]), levels, span_hz)
        rows[0][0].set_ylabel(_("amplitude ratio [dB]"))
        rows[1][0].set_ylabel(_("phase [°]"))
        if distorted:
            rows[2][0].set_ylabel(_("THD [%]"))
            rows[2][0].set_ylim(bottom=0.0)  # which ends the scaling of the row: after all that is drawn

    if distorted:
        caption += " " + _("Below: harmonics 2 to 5 over the fundamental; dotted: {percent} %.").format(
            percent=number(_DISTORTED_PERCENT)
        )
    return drawn(name, 1.2 + 1.0 * sum(ratios), draw, caption)


def _response(axes: Axes, curve: Curve, key: str, std_key: str, k: int) -> None:
    color, marker = SERIES[k % len(SERIES)], MARKERS[k % len(MARKERS)]
    std = array(curve, std_key)
    bars = None if std is None else COVERAGE_FACTOR * np.nan_to_num(std, posinf=0.0)
    axes.errorbar(needed(curve, "frequency_hz"), needed(curve, key), bars, ls="", marker=marker, color=color,
                  label=label_of(curve))  # fmt: skip
    model = curve.get("model")
    if model:
        _model_line(axes, model, key, std_key, color, k)


def _model_line(axes: Axes, model: Curve, key: str, std_key: str, color: str, k: int) -> None:
    f, y, std = needed(model, "frequency_hz"), needed(model, key), array(model, std_key)
    axes.plot(f, y, color=color, ls=DASHES[k % len(DASHES)], lw=1.0)
    if std is not None:
        axes.fill_between(f, y - COVERED * std, y + COVERED * std, color=color, **BAND)


def _thd(axes: Axes, group: Sequence[Curve]) -> None:
    for k, curve in enumerate(group):
        thd = array(curve, "thd_percent")
        if thd is not None:
            axes.plot(needed(curve, "frequency_hz"), thd, color=SERIES[k % len(SERIES)],
                      marker=MARKERS[k % len(MARKERS)])  # fmt: skip
    axes.axhline(_DISTORTED_PERCENT, **LEVEL)


def _frame(column: Sequence[Axes], levels: Sequence[float], span_hz: tuple[float, float]) -> None:
    from matplotlib.ticker import MaxNLocator

    for axes, level in zip(column, levels, strict=False):
        axes.axhline(level, **LEVEL)
    for axes in column:
        axes.set_xscale("log")
        axes.set_xlim(*span_hz)
        plain_log(axes.xaxis)
    column[1].yaxis.set_major_locator(MaxNLocator(steps=[1, 1.5, 3, 4.5, 9, 10]))
    column[-1].set_xlabel(_("frequency [Hz]"))
    legend_above(column[0], 3)


def _distortions(curves: Sequence[Curve]) -> list[Picture]:
    """Response, noise, and odd and even distortion on one scale."""
    shown = [c for c in curves if array(c, "odd_db") is not None or array(c, "noise_db") is not None]
    pairs = [shown[i : i + _SIDE_BY_SIDE] for i in range(0, len(shown), _SIDE_BY_SIDE)]
    return [_distortion(f"distortion-{k}", pair) for k, pair in enumerate(pairs)]


_LEVELS = (
    ("magnitude_db", marked("response"), INK, "-", "o"), ("odd_db", marked("odd distortion"), RED, "--", "v"),
    ("even_db", marked("even distortion"), AMBER, "-.", "^"), ("noise_db", marked("noise"), BLUE, ":", ""),
)  # fmt: skip


def _distortion(name: str, curves: Sequence[Curve]) -> Picture:
    def draw(figure: Figure) -> None:
        for axes, curve in zip(figure.subplots(1, len(curves), sharey=True, squeeze=False)[0], curves, strict=True):
            for key, label, color, dash, marker in _LEVELS:
                level = array(curve, key)
                if level is not None:
                    axes.plot(needed(curve, "frequency_hz"), level, color=color, ls=dash, marker=marker,
                              label=_(label))  # fmt: skip
            axes.set_xscale("log")
            plain_log(axes.xaxis)
            axes.set_xlabel(_("frequency [Hz]"))
            axes.annotate(label_of(curve), (1.0, 1.0), xycoords="axes fraction", ha="right", va="top", color=SOFT)
        figure.axes[0].set_ylabel(_("level [dB]"))
        figure.axes[0].set_ylim(bottom=_least_level(curves))
        legend_on_top(figure.axes[0])

    caption = _(
        "Best linear approximation, noise of the mean over the periods, odd and even distortion. All are on the scale "
        "of the amplitude ratio."
    )
    return drawn(name, 3.0, draw, caption)


def _least_level(curves: Sequence[Curve]) -> float | None:
    """A little below the noise: what lies lower is zero, and would squeeze everything else together."""
    noises = [float(np.nanmin(noise)) for c in curves if (noise := array(c, "noise_db")) is not None]
    return min(noises) - _BELOW_NOISE_DB if noises else None


def _overlays(curves: Sequence[Curve]) -> list[Picture]:
    """Sine fits over the samples that they were fitted to."""
    rows = [c for c in curves if c.get("overlays")][:MOST_DRAWN]
    if not rows:
        return []
    columns = max(len(c["overlays"]) for c in rows)

    def draw(figure: Figure) -> None:
        grid = figure.subplots(len(rows), columns, squeeze=False)
        for line, curve in zip(grid, rows, strict=True):
            for axes in line[len(curve["overlays"]) :]:
                axes.set_visible(False)
            for axes, overlay in zip(line, curve["overlays"], strict=False):
                _overlay(axes, overlay)
            label = label_of(curve).replace(",\N{NO-BREAK SPACE}", ",\n")  # a row is no higher than half of a long one
            line[0].set_ylabel(f"{label}{unit_of(curve, 'response_unit')}".replace(" [", "\n["))
        for axes in grid[-1]:
            axes.set_xlabel(_("time [s]"))
        legend_on_top(grid[0][0])

    caption = _("Sine fits: samples, and the sine with its harmonics that was fitted to them.")
    return [drawn("sine-fits", 0.6 + 0.95 * len(rows), draw, caption)]


def _overlay(axes: Axes, overlay: Curve) -> None:
    time_s = needed(overlay, "time_s")
    axes.plot(*thinned(time_s, needed(overlay, "measured"), _SMALL), **MEASURED, label=_("measured"))
    axes.plot(*thinned(time_s, needed(overlay, "fitted"), _SMALL), **FITTED, label=_("fitted"))
    titled(axes, f"{number(float(overlay['frequency_hz']))} Hz")
    axes.locator_params(nbins=4)


def _models(curves: Sequence[Curve]) -> tuple[Table, ...]:
    remarks = (("model", ""), ("alternative", marked(", no zero in the right half plane")))
    rows = [
        (label_of(curve) + _(remark), str(model.get("formula", "")), _fit(model), _dead_time(model))
        for curve in curves
        for key, remark in remarks
        if (model := curve.get(key))
    ]
    heads = (_("Response"), _("Transfer function"), _("Fit [%]"), _("Dead time [s]"))
    return (Table(_("Fitted transfer functions"), heads, tuple(rows), text_columns=(1,)),) if rows else ()


def _fit(model: Curve) -> str:
    value = model.get("fit_percent")
    return "—" if value is None else fixed(float(value), 2)


def _dead_time(model: Curve) -> str:
    value, std = model.get("dead_time_s"), model.get("dead_time_std_s")
    return "—" if value is None else with_uncertainty(float(value), None if std is None else COVERED * std)
