"""Under what conditions a run was made, with what, and how it can be told from any other."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from hil.errors import FileError
from hil.language.words import _
from hil.record.conditions import Condition, measured_conditions
from hil.record.recording import Channel, Recording
from hil.record.run_folder.header import read_end, stated
from hil.report.facts import fact_of, facts_of, text_of
from hil.report.name import within
from hil.report.number import fixed, number, rounded, unit_text, with_unit
from hil.report.section import Table
from hil.untrusted import parse_toml

_MOST_EVENTS = 40


def conditions_of(recording: Recording) -> list[tuple[str, str]]:
    """Conditions of the test, and what is known of the valve beside its name."""
    valve = {name: v for name, v in (recording.meta.get("valve") or {}).items() if name not in ("name", "serial")}
    if not valve.get("integrates"):  # as most valves do not
        valve.pop("integrates", None)
    command = recording.channels.get(str((recording.meta.get("roles") or {}).get("command")))
    if command is not None and isinstance(point := valve.get("operating_point"), int | float):
        valve["operating_point"] = with_unit(point, command.unit, 6)
    return [*stated_or_measured(recording), *facts_of(valve)] or [(_("Conditions"), _("none stated"))]


def stated_or_measured(recording: Recording) -> list[tuple[str, str]]:
    """Conditions of the test: measured where a channel measured them, else as stated."""
    stated = {name: v for name, v in (recording.meta.get("conditions") or {}).items() if name != "ranges"}
    measured = measured_conditions(recording)
    rows = {name: fact for name, v in stated.items() for fact in facts_of({name: v})}
    for name, condition in measured.items():
        label, was = rows.get(name, (fact_of(name, condition.mean)[0], ""))
        rows[name] = (label, _measured_text(condition, was))
    return list(rows.values())


def _measured_text(condition: Condition, stated: str) -> str:
    """`first 99.9, mean 99.8, last 99.8 bar, measured (stated: 100 bar)`, to a tenth of the scatter."""
    first, mean, last = (rounded(v, condition.std)[0] for v in (condition.first, condition.mean, condition.last))
    text = _("measured: first {first}, mean {mean}, last {last} {unit}").format(
        first=first, mean=mean, last=last, unit=condition.unit
    )
    return text + (" (" + _("stated: {value}").format(value=stated) + ")" if stated else "")


def instrument_line(instrument: Any) -> str:
    """An instrument in one line."""
    if not isinstance(instrument, Mapping):
        return str(instrument)
    others = "; ".join(f"{within(label)} {value}" for label, value in facts_of({**instrument, "name": ""}))
    return ": ".join(text for text in (str(instrument.get("name", "")), others) if text)


def channel_table(channels: Iterable[Channel]) -> Table:
    """Channels with their instrument and calibration."""
    heads = (
        _("Channel"),
        _("Unit"),
        _("Instrument"),
        _("Calibration: value per raw unit"),
        _("Offset"),
        _("U (k = 2)"),
        _("Date"),
        _("Source"),
    )
    return Table("", heads, tuple(_channel(channel) for channel in channels), text_columns=(2, 3, 7))


def _channel(channel: Channel) -> tuple[str, ...]:
    line, unit = channel.calibration, unit_text(channel.unit)
    if not line:
        return (channel.name, unit, channel.source, _("none"), "", "", "", "")
    raw = line.get("raw_unit", _("raw unit"))
    uncertainty = line.get("uncertainty")
    return (
        channel.name, unit, channel.source,
        f"{number(line.get('slope'), 6)} {unit}/{raw}".replace(" /", " 1/"),
        f"{number(line.get('offset'), 6)} {unit}".rstrip(),
        _("not stated") if uncertainty is None else f"{number(uncertainty)} {unit}".rstrip(),
        str(line.get("date") or _("not stated")), stated(line, "source"),
    )  # fmt: skip


def identity_of(recording: Recording) -> list[tuple[str, str]]:
    """Folder, times, checksums, rates and promises of the device."""
    meta = recording.meta
    sampling = meta.get("sampling") or {}
    rows = [
        (_("Run folder"), recording.name),
        (_("Started"), stated(meta, "started_utc")),
        (_("Stopped"), stated(meta, "stopped_utc")),
        (_("Ended"), stated(meta, "outcome")),
        (_("Stopped by"), stated(meta, "stopped_by")),
        (_("Program"), stated(meta, "program")),
        *_seals(recording.name),
        *_sampling_asked(meta),
        (_("Rate of the stamps"), f"{number(1.0 / recording.interval_s, 6)} Hz" if len(recording) > 1 else ""),
        *((_("Device: {label}").format(label=within(label)), value) for label, value in facts_of(sampling)),
    ]
    return [(label, value) for label, value in rows if value]


def _seals(name: str) -> list[tuple[str, str]]:
    """Checksums under which a run folder was closed; nothing for a recording that is none."""
    folder = Path(name)
    end = read_end(folder) if folder.is_dir() else None
    if end is None:
        return []
    return [
        (_("CRC-32 of the samples"), end.crc32),
        *((_("SHA-256 of {file}").format(file=file), seal) for file, seal in end.sha256.items()),
    ]


def _sampling_asked(meta: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Sample rate and seed as the bench file states them."""
    try:
        bench = parse_toml(stated(meta, "bench_file"), "bench_file")
    except FileError:
        return []
    rate_hz, seed = bench.get("sample_rate_hz"), (bench.get("simulation") or {}).get("seed")
    rows = [(_("Sample rate asked"), "" if rate_hz is None else f"{number(rate_hz, 6)} Hz"),
            (_("Seed of the simulation"), "" if seed is None else str(seed))]  # fmt: skip
    return [(label, value) for label, value in rows if value]


def event_table(events: Iterable[Mapping[str, Any]]) -> Table | None:
    """Events of the run; None when there were none."""
    kept = list(events)
    if not kept:
        return None
    rows = tuple((_seconds(event.get("time_s")), str(event["event"]), text_of(event.get("details"))) for event in kept)
    left_out = len(rows) - _MOST_EVENTS
    caption = (
        _("The first {n}; {more} more are in events.jsonl.").format(n=_MOST_EVENTS, more=left_out)
        if left_out > 0
        else ""
    )
    return Table(caption, (_("Time [s]"), _("Event"), _("Details")), rows[:_MOST_EVENTS], text_columns=(1, 2))


def _seconds(time_s: Any) -> str:
    return (
        fixed(time_s, 3) if isinstance(time_s, int | float) and math.isfinite(time_s) else _("before the first sample")
    )
