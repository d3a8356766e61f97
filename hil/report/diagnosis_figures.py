"""Drawings of a diagnosis: before and after, where the two part in time and frequency, what is left."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from hil.arrays import ROUNDING
from hil.diagnosis.diagnosis import Spectrum, Strip
from hil.diagnosis.evidence.locate import StageShare, Where
from hil.language.words import _, marked
from hil.record.recording import Array, split_heading
from hil.report.figure import (
    AMBER,
    BLUE,
    FAINT,
    FITTED,
    GREEN,
    INK,
    MEASURED,
    MOST_DRAWN,
    RED,
    SOFT,
    Picture,
    drawn,
    legend_on_top,
    plain_log,
    thinned,
)  # fmt: skip
from hil.report.name import short_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_BLOCKS = 240
_ZOOM_SHARE = 0.1
_ZOOM_LEAST = 200  # samples
_WIDE = 4.0  # noise standard deviations that a residual axis shows at least
_EVERYWHERE = 0.85  # of a recording: beyond this share, shading says nothing
_AFTER = FITTED
_BEFORE = {**FITTED, "color": RED, "ls": "--"}
_PALE = "#eb9b62"  # the nominal model where lines lie too close for dashes; lighter than the other in grey, too
_BEFORE_NAME, _AFTER_NAME = marked("nominal model"), marked("corrected model")


def before_and_after(strip: Strip, output: str, where: Where | None, *, corrected: bool) -> Picture:
    """Recording, nominal and corrected simulation, and below what each leaves, in units of the noise."""
    intervals = _intervals(strip, where)

    def draw(figure: Figure) -> None:
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1.0))
        _overlay(above, strip, output, corrected=corrected)
        _residuals(below, strip, corrected=corrected)
        _shade((above, below), intervals)
        below.set_xlabel(_("time [s]"))

    shaded = " " + _("Shaded: where the nominal model parts from the recording.") if intervals else ""
    caption = (
        _(
            "{name}, whole recording. Below: recording minus simulation, in standard deviations of the noise; "
            "the grey band is ±2."
        ).format(name=short_name(strip.name))
        + shaded
    )
    return drawn("overlay", 3.7, draw, caption)


def close_up(strip: Strip, command: str, output: str, *, corrected: bool) -> Picture | None:
    """The stretch in which the nominal model is farthest off; none when the recording is short anyway."""
    first, stop = worst_interval(strip)
    if stop - first >= len(strip.time_s):
        return None
    part = _cut(strip, first, stop)

    def draw(figure: Figure) -> None:
        above, middle, below = figure.subplots(3, 1, sharex=True, height_ratios=(2.4, 1.0, 0.8))
        _overlay(above, part, output, corrected=corrected)
        _residuals(middle, part, corrected=corrected)
        below.plot(part.time_s, part.command, color=INK, lw=1.0, drawstyle="steps-post")
        below.set_ylabel(command.replace(" [", "\n["))
        below.set_xlabel(_("time [s]"))
        below.margins(x=0.0)

    caption = _("{name}, the stretch in which the nominal model is farthest off, and its command.").format(
        name=short_name(strip.name)
    )
    return drawn("close-up", 4.2, draw, caption)


def worst_interval(strip: Strip) -> tuple[int, int]:
    """First sample and end of the tenth of a recording that holds most of the nominal misfit."""
    n = len(strip.time_s)
    length = min(n, max(_ZOOM_LEAST, round(_ZOOM_SHARE * n)))
    power = np.concatenate(([0.0], np.cumsum(strip.off(strip.nominal) ** 2)))
    first = int(np.argmax(power[length:] - power[: n - length + 1]))
    return first, first + length


def time_strips(strips: Sequence[Strip], where: Where | None, *, corrected: bool) -> Picture:
    """How far off each recording is along its time, before and after."""
    shown = strips[:MOST_DRAWN]

    def draw(figure: Figure) -> None:
        rows = figure.subplots(len(shown), 1, squeeze=False)[:, 0]
        for axes, strip in zip(rows, shown, strict=True):
            time_s, before, after = _levels(strip)
            axes.fill_between(time_s, before, 1.0, step="mid", color=FAINT, lw=0.0)
            axes.plot(time_s, before, drawstyle="steps-mid", label=_(_BEFORE_NAME), **_BEFORE)
            if corrected:
                axes.plot(time_s, after, drawstyle="steps-mid", label=_(_AFTER_NAME), **_AFTER)
            axes.axhline(1.0, color=SOFT, lw=0.7, label=_("noise alone"))
            axes.set_yscale("log")
            top = max(float(before.max()), float(after.max()), 3.0)
            axes.set_ylim(0.5, 1.6 * top)
            plain_log(axes.yaxis)
            axes.set_title(short_name(strip.name), fontweight="normal", pad=3.0, loc="right", color=SOFT)
            axes.margins(x=0.0)
            _shade((axes,), _intervals(strip, where))
        legend_on_top(rows[0])
        rows[-1].set_xlabel(_("time [s]"))
        figure.supylabel(_("rms difference / noise"), fontsize=8.5)

    more = (
        " " + _("{n} more recordings are not drawn.").format(n=len(strips) - len(shown))
        if len(strips) > len(shown)
        else ""
    )
    caption = _("In time: rms difference in short blocks, over the noise; 1 is what noise alone gives.") + more
    return drawn("time-strips", 0.6 + 1.05 * len(shown), draw, caption)


def residual_spectrum(name: str, spectrum: Spectrum, where: Where | None, unit: str, *, corrected: bool) -> Picture:
    """Amplitudes of the residuals before and after, with the harmonics of the command."""

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        f, before, counts = _envelope(spectrum.frequency_hz, spectrum.nominal)
        after = _envelope(spectrum.frequency_hz, spectrum.corrected)[1]
        axes.plot(f, before, label=_(_BEFORE_NAME), **_BEFORE)
        if corrected:
            axes.plot(f, after, label=_(_AFTER_NAME), **_AFTER)
        axes.plot(f, spectrum.noise * _largest_of(counts), color=SOFT, lw=0.9, label=_("noise alone"))
        axes.set_xscale("log")
        axes.set_yscale("log")
        positive = np.concatenate((before, after))
        positive = positive[positive > 0.0]
        if positive.size and spectrum.noise > 0.0:
            axes.set_ylim(0.3 * spectrum.noise, 4.0 * max(float(positive.max()), spectrum.noise))
        axes.set_xlim(float(f[0]), float(f[-1]))
        _lines(axes, spectrum)
        if where is not None and where.frequency_hz[1] > 0.0:
            axes.axvspan(max(where.frequency_hz[0], f[0]), where.frequency_hz[1], color=FAINT, lw=0.0, zorder=0)
        plain_log(axes.xaxis)
        plain_log(axes.yaxis)
        axes.set_xlabel(_("frequency [Hz]"))
        axes.set_ylabel(_("amplitude of the difference") + f" [{unit}]")
        axes.grid(which="major")
        legend_on_top(axes)

    lines = _("Marked: the command's own lines, their odd and their even harmonics.") + " " if spectrum.lines_hz else ""
    band = _("Shaded: the band that holds nine tenths of the difference.") if where is not None else ""
    title = _("In frequency")  # outside the f-string: Babel reads into one from Python 3.12 on alone
    return drawn(name, 3.1, draw, f"{title}: {short_name(spectrum.name)}. {lines}{band}".strip())


def _lines(axes: Axes, spectrum: Spectrum) -> None:
    top = axes.get_ylim()[1]
    kinds = (
        (_("command"), spectrum.lines_hz, "|", INK, True), (_("odd harmonics"), spectrum.odd_hz, "v", GREEN, True),
        (_("even harmonics"), spectrum.even_hz, "v", AMBER, False),
    )  # fmt: skip
    for label, lines_hz, marker, color, filled in kinds:
        low, high = axes.get_xlim()
        inside = [f for f in lines_hz if low <= f <= high]
        if inside:
            face = color if filled else "white"
            axes.plot(inside, np.full(len(inside), 0.7 * top), ls="", marker=marker, ms=6, color=color,
                      markerfacecolor=face, markeredgewidth=1.1, label=label)  # fmt: skip


def region_bars(before: Mapping[str, float], after: Mapping[str, float] | None) -> Picture:
    """Where the difference gathers: its energy in each region over the time spent there."""
    names = sorted(before, key=lambda name: before[name])

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        place = np.arange(len(names), dtype=np.float64)
        height = 0.36 if after else 0.6
        above = place + (height / 2 if after else 0.0)
        axes.barh(above, [before[n] for n in names], height, color=RED, label=_(_BEFORE_NAME))
        if after:
            axes.barh(place - height / 2, [after.get(n, 0.0) for n in names], height, color="white", edgecolor=BLUE,
                      hatch="////", lw=0.8, label=_("what the corrected model leaves"))  # fmt: skip
        axes.axvline(1.0, color=INK, lw=0.9)
        axes.set_yticks(place, [_(name) for name in names])
        axes.set_xlabel(_("share of the difference's energy over share of time; 1 is nothing special"))
        axes.grid(axis="y", visible=False)
        axes.tick_params(axis="y", length=0)
        legend_on_top(axes)

    return drawn(
        "regions", 0.8 + 0.28 * len(names), draw, _("In operating region: beyond 1, the difference gathers there.")
    )


def stage_curves(stages: Sequence[StageShare]) -> Picture:
    """The disturbance that would explain what is left, over what passes at its place, by direction of motion."""

    def draw(figure: Figure) -> None:
        for axes, s in zip(figure.subplots(1, len(stages), squeeze=False)[0], stages, strict=True):
            unit = f" [{s.unit}]" if s.unit and s.unit != "1" else ""
            axes.axhline(0.0, color=SOFT, lw=0.7)
            axes.plot(s.level, s.rising, marker="^", label=_("rising"), color=BLUE)
            axes.plot(s.level, s.falling, marker="v", ls="--", label=_("falling"), color=RED, markerfacecolor="white")
            axes.set_title(f"{s.hook} ({s.stage}): {100 * s.share:.0f} %")
            axes.set_xlabel(_("value there") + unit)
            axes.set_ylabel(_("added there") + unit)
        legend_on_top(figure.axes[0])

    caption = _(
        "The disturbance at this place that would explain most of it, without a law. It is drawn over what passes "
        "there and the direction of motion. Per cent: how much it would explain."
    )
    return drawn("left-over", 2.7, draw, caption)


def _overlay(axes: Axes, strip: Strip, output: str, *, corrected: bool) -> None:
    name, unit = split_heading(output) if "[" in output else (output, "")
    axes.plot(*thinned(strip.time_s, strip.measured), label=_("recording"), **MEASURED)
    axes.plot(*thinned(strip.time_s, strip.nominal), label=_(_BEFORE_NAME), **_BEFORE)
    if corrected:
        axes.plot(*thinned(strip.time_s, strip.corrected), label=_(_AFTER_NAME), **_AFTER)
    axes.set_ylabel(f"{name} [{unit}]" if unit else name)
    axes.margins(x=0.0)
    legend_on_top(axes)


def _residuals(axes: Axes, strip: Strip, *, corrected: bool) -> None:
    noise = noise_of(strip)
    before, after = (strip.measured - strip.nominal) / noise, (strip.measured - strip.corrected) / noise
    axes.axhspan(-2.0, 2.0, color=FAINT, lw=0.0, zorder=0)
    axes.plot(*thinned(strip.time_s, before), color=_PALE, lw=0.8)
    if corrected:
        axes.plot(*thinned(strip.time_s, after), **{**_AFTER, "lw": 0.8})
    axes.margins(x=0.0)
    reach = max(_WIDE, 1.05 * float(np.abs(strip.off(strip.nominal)).max()) / noise)
    axes.set_ylim(-reach, reach)
    axes.set_ylabel(_("difference /\nnoise"))


def noise_of(strip: Strip) -> float:
    """The noise, or what the corrected model leaves where none was measured, so that there is a unit."""
    if strip.noise_std > 0.0 and np.isfinite(strip.noise_std):
        return strip.noise_std
    left = float(np.std(strip.off(strip.corrected)))
    return left if left > 0.0 else 1.0


def _levels(strip: Strip) -> tuple[Array, Array, Array]:
    """(time, before, after): rms of the difference over the noise, in blocks."""
    n = len(strip.time_s)
    edges = np.unique(np.linspace(0, n, min(_BLOCKS, n) + 1).astype(np.int64))
    counts = np.diff(edges)
    noise = noise_of(strip)
    levels = [
        np.sqrt(np.add.reduceat((strip.off(y) / noise) ** 2, edges[:-1]) / counts)
        for y in (strip.nominal, strip.corrected)
    ]
    return strip.time_s[(edges[:-1] + edges[1:] - 1) // 2], levels[0], levels[1]


def _envelope(frequency_hz: Array, amplitude: Array) -> tuple[Array, Array, Array]:
    """(frequency, largest amplitude, number of lines) of 500 narrow bands, evenly spread over the logarithm."""
    bands = np.geomspace(frequency_hz[0], frequency_hz[-1] * (1 + ROUNDING), 501)
    starts = np.unique(np.searchsorted(frequency_hz, bands[:-1]))
    starts = starts[starts < len(frequency_hz)]
    largest = np.maximum.reduceat(amplitude, starts)
    stops = np.append(starts[1:], len(frequency_hz)) - 1
    return np.sqrt(frequency_hz[starts] * frequency_hz[stops]), largest, (stops - starts + 1).astype(np.float64)


def _largest_of(counts: Array) -> Array:
    """The largest of so many amplitudes of white noise, expected, over their rms: they follow Rayleigh's law."""
    return np.sqrt(np.maximum(np.log(counts) + np.euler_gamma, 1.0))


def _intervals(strip: Strip, where: Where | None) -> tuple[tuple[float, float], ...]:
    """Where the two part in time; nothing when it is nearly everywhere."""
    if where is None or where.recording != strip.name:
        return ()
    covered = sum(stop - start for start, stop in where.time_s)
    return where.time_s if covered < _EVERYWHERE * float(strip.time_s[-1] - strip.time_s[0]) else ()


def _shade(rows: Sequence[Axes], intervals: Sequence[tuple[float, float]]) -> None:
    for axes in rows:
        for start_s, stop_s in intervals:
            axes.axvspan(start_s, stop_s, color="#e8ecf1", lw=0.0, zorder=0)


def _cut(strip: Strip, first: int, stop: int) -> Strip:
    part = slice(first, stop)
    return Strip(
        strip.name, strip.time_s[part], strip.command[part], strip.measured[part], strip.nominal[part],
        strip.corrected[part], strip.noise_std,
    )  # fmt: skip
