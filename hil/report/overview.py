"""The recording as a whole: every channel over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.language.words import _
from hil.record.recording import Channel, Recording
from hil.report.figure import SERIES, drawn, thinned
from hil.report.section import Section

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_ROWS = 6


def overview(recording: Recording) -> list[Section]:
    """Command and response first, then the other channels, one strip for each unit."""
    roles = recording.meta.get("roles") or {}
    named = [recording.channels[name] for name in roles.values() if name in recording.channels]
    others = [channel for channel in recording.channels.values() if channel not in named]
    strips = _by_unit([*named, *others])
    if not strips or len(recording) < 2:
        return []

    def draw(figure: Figure) -> None:
        rows = figure.subplots(len(strips), 1, sharex=True, squeeze=False)[:, 0]
        for axes, channels in zip(rows, strips, strict=True):
            for k, channel in enumerate(channels):
                line = thinned(recording.time_s, channel.values)
                axes.plot(*line, color=SERIES[k % len(SERIES)], lw=0.8, zorder=3.0 - 0.1 * k, label=channel.name)
            axes.set_ylabel(channels[0].unit)
            axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=6)
            axes.margins(x=0.0)
        rows[-1].set_xlabel(_("time [s]"))

    caption = _("Every channel as recorded; where samples lie closer than the drawing can show, their span is drawn.")
    return [Section(_("Recording"), figures=(drawn("overview", 0.5 + 1.15 * len(strips), draw, caption),))]


def _by_unit(channels: list[Channel]) -> list[list[Channel]]:
    strips: dict[str, list[Channel]] = {}
    for channel in channels:
        strips.setdefault(channel.unit, []).append(channel)
    return list(strips.values())[:_MOST_ROWS]
