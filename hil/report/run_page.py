"""The report of a run: verdict, results, figures, conditions, instruments, and where it all came from."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable, Mapping
from datetime import datetime
from itertools import groupby
from pathlib import Path
from typing import Any

from hil.record.header import read_end
from hil.record.measurement import COVERAGE_FACTOR, Findings, Measured
from hil.record.recording import Channel, Recording
from hil.report.curves import sections
from hil.report.name import quantity_words, split_unit
from hil.report.number import limits_text, number, rounded, unit_text, with_minus, with_uncertainty
from hil.report.page import write_page
from hil.report.section import Table

_MOST_EVENTS = 40


def write_run_report(recording: Recording, findings: Findings, path: Path) -> None:
    """Write the page of a run.

    Raises:
        StorageError: it cannot be written.
    """
    meta = recording.meta
    procedure = _capital(quantity_words(str(meta.get("procedure") or "run")))
    write_page(
        "run.html", path,
        kicker="Test report",
        title=f"{procedure}: {_valve_name(meta)}",
        verdict=_verdict(findings, meta),
        summary=_summary(recording),
        groups=_groups(findings.measured),
        judged=findings.verdict is not None,
        sections=sections(recording, findings),
        notes=[with_minus(note) for note in findings.notes],
        deviations=[with_minus(deviation) for deviation in findings.deviations],
        conditions=_conditions(meta),
        settings=_facts(meta.get("settings", {})),
        instruments=[_instrument(instrument) for instrument in meta.get("instruments", ())],
        channels=_channels(recording.channels.values()),
        identity=_identity(recording),
        events=_events(meta.get("events", ())),
        bench_file=meta.get("bench_file", ""),
    )  # fmt: skip


def _valve_name(meta: Mapping[str, Any]) -> str:
    valve = meta.get("valve") or {}
    return str(valve.get("name") or meta.get("bench") or "recording")


_WORDS = {
    "pass": ("good", "Pass", "Every limit is met for certain."),
    "fail": ("bad", "Fail", "At least one limit is missed."),
    "cannot tell": ("open", "Cannot tell", "No limit is missed for certain, but not all of them are met for certain."),
    None: ("", "Measured", "No limits were given; the results are stated as measured."),
}


def _verdict(findings: Findings, meta: Mapping[str, Any]) -> dict[str, Any]:
    tone, word, sentence = _WORDS[findings.verdict]
    details = [_missed(m) for m in findings.measured if m.verdict in ("fail", "cannot tell")]
    if missing := meta.get("incomplete"):
        details.append(f"The recording is incomplete: {missing}.")
    outcome = str(meta.get("outcome", "completed"))
    if outcome not in ("completed", "written"):
        details.append(f"The run did not end as planned: {outcome}.")
    return {"tone": tone, "word": word, "sentence": sentence, "details": details}


def _missed(m: Measured) -> str:
    sign = "" if m.relation == "=" else f"{m.relation} "
    value = "not determined" if m.value is None else sign + with_uncertainty(m.value, _expanded(m), m.unit)
    place = f" at {_place(m)}" if _place(m) else ""
    limit = f"limit {limits_text(m.low, m.high)} {unit_text(m.unit)}".strip()
    return f"{_capital(m.verdict or '')}: {quantity_words(m.quantity)}{place} is {value}, {limit}."


def _summary(recording: Recording) -> list[tuple[str, str]]:
    meta = recording.meta
    valve = meta.get("valve") or {}
    rows = [
        ("Valve", ", ".join(str(valve[key]) for key in ("name", "serial") if valve.get(key))),
        ("Bench", str(meta.get("bench") or "")),
        ("Date", _date(meta.get("started_utc"))),
        ("Recorded", f"{number(recording.duration_s)} s, {len(recording)} samples"),
    ]
    return [(label, value) for label, value in rows if value]


def _date(text: Any) -> str:
    try:
        return f"{datetime.fromisoformat(str(text)):%Y-%m-%d %H:%M:%S} UTC"
    except ValueError:
        return ""


def _groups(measured: Iterable[Measured]) -> list[dict[str, Any]]:
    """Quantities in the order declared; one that was measured at several places has a line of its own above them."""
    found = []
    for quantity, members in groupby(_together(measured), key=lambda m: m.quantity):
        rows = list(members)
        group = {"name": _capital(quantity_words(quantity)), "meaning": rows[0].meaning, "several": len(rows) > 1}
        found.append({**group, "rows": [_row(m, _place(m)) for m in rows]})
    return found


def _together(measured: Iterable[Measured]) -> list[Measured]:
    rows = list(measured)
    order = {quantity: i for i, quantity in reversed(list(enumerate(m.quantity for m in rows)))}
    return sorted(rows, key=lambda m: order[m.quantity])


def _place(m: Measured) -> str:
    return with_minus(m.name.partition(", ")[2])


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _expanded(m: Measured) -> float | None:
    return None if m.std is None else COVERAGE_FACTOR * m.std


def _row(m: Measured, place: str) -> dict[str, Any]:
    value, uncertainty = rounded(m.value, _expanded(m))
    sign = "" if m.relation == "=" or m.value is None else f"{m.relation} "
    return {
        "place": place,
        "value": "not determined" if m.value is None else sign + value,
        "uncertainty": uncertainty,
        "unit": unit_text(m.unit),
        "limits": limits_text(m.low, m.high),
        "verdict": m.verdict,
    }


def _facts(values: Mapping[str, Any]) -> list[tuple[str, str]]:
    return [_fact(name, value) for name, value in values.items() if value not in (None, "", [], {})]


def _fact(name: str, value: Any) -> tuple[str, str]:
    """(`Fluid temperature`, `40 °C`) from `fluid_temperature_c`."""
    label, unit = split_unit(name)
    if unit and isinstance(value, int | float) and not isinstance(value, bool):
        return _capital(label), f"{number(value, 6)} {unit}"
    if unit and isinstance(value, Mapping):
        return _capital(label), "; ".join(f"{key} {_text(v)} {unit}" for key, v in value.items())
    return _capital(name.replace("_", " ")), _text(value)


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | float):
        return str(value) if isinstance(value, int) else number(value, 6)
    if isinstance(value, Mapping):
        facts = (_fact(str(name), v) for name, v in value.items() if v not in (None, ""))
        return "; ".join(f"{label.lower()} {text}" for label, text in facts)
    if isinstance(value, list | tuple):
        return ", ".join(_text(v) for v in value)
    return "—" if value is None else str(value)


def _conditions(meta: Mapping[str, Any]) -> list[tuple[str, str]]:
    valve = {name: value for name, value in (meta.get("valve") or {}).items() if name not in ("name", "serial")}
    rows = [*_facts(meta.get("conditions") or {}), *_facts(valve)]
    return rows or [("Conditions", "none stated")]


def _instrument(instrument: Any) -> str:
    if not isinstance(instrument, Mapping):
        return str(instrument)
    others = "; ".join(f"{label.lower()} {value}" for label, value in _facts({**instrument, "name": ""}))
    return ": ".join(text for text in (str(instrument.get("name", "")), others) if text)


def _channels(channels: Iterable[Channel]) -> Table:
    heads = (
        "Channel",
        "Unit",
        "Instrument",
        "Calibration: value per raw unit",
        "Offset",
        "U (k = 2)",
        "Date",
        "Source",
    )
    return Table("", heads, tuple(_channel(channel) for channel in channels), text_columns=(2, 3, 7))


def _channel(channel: Channel) -> tuple[str, ...]:
    line = channel.calibration
    if not line:
        return (channel.name, channel.unit, channel.source, "none", "", "", "", "")
    unit, raw = unit_text(channel.unit), line.get("raw_unit", "raw unit")
    uncertainty = line.get("uncertainty")
    return (
        channel.name, channel.unit, channel.source,
        f"{number(line.get('slope'), 6)} {unit}/{raw}".replace(" /", " 1/"),
        f"{number(line.get('offset'), 6)} {unit}".rstrip(),
        "not stated" if uncertainty is None else f"{number(uncertainty)} {unit}".rstrip(),
        str(line.get("date") or "not stated"), str(line.get("source") or ""),
    )  # fmt: skip


def _identity(recording: Recording) -> list[tuple[str, str]]:
    meta = recording.meta
    sampling = meta.get("sampling") or {}
    rows = [
        ("Run folder", recording.name),
        ("Started", str(meta.get("started_utc") or "")),
        ("Stopped", str(meta.get("stopped_utc") or "")),
        ("Ended", str(meta.get("outcome") or "")),
        ("Program", str(meta.get("program") or "")),
        *_seals(recording.name),
        *_asked(meta),
        ("Rate of the stamps", f"{number(1.0 / recording.interval_s, 6)} Hz" if len(recording) > 1 else ""),
        *((f"Device: {label.lower()}", value) for label, value in _facts(sampling)),
    ]
    return [(label, value) for label, value in rows if value]


def _seals(name: str) -> list[tuple[str, str]]:
    """Checksums under which a run folder was closed; nothing for a recording that is none."""
    folder = Path(name)
    end = read_end(folder) if folder.is_dir() else None
    if end is None:
        return []
    return [("CRC-32 of the samples", end.crc32), *((f"SHA-256 of {file}", seal) for file, seal in end.sha256.items())]


def _asked(meta: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Sample rate and seed as the bench file states them."""
    try:
        bench = tomllib.loads(meta.get("bench_file") or "")
    except tomllib.TOMLDecodeError:
        return []
    rate_hz, seed = bench.get("sample_rate_hz"), (bench.get("simulation") or {}).get("seed")
    rows = [("Sample rate asked", "" if rate_hz is None else f"{number(rate_hz, 6)} Hz"),
            ("Seed of the simulation", "" if seed is None else str(seed))]  # fmt: skip
    return [(label, value) for label, value in rows if value]


def _events(events: Iterable[Mapping[str, Any]]) -> Table | None:
    kept = list(events)
    if not kept:
        return None
    rows = tuple((_seconds(event.get("time_s")), str(event["event"]), _text(event.get("details"))) for event in kept)
    left_out = len(rows) - _MOST_EVENTS
    caption = f"The first {_MOST_EVENTS}; {left_out} more are in events.jsonl." if left_out > 0 else ""
    return Table(caption, ("Time [s]", "Event", "Details"), rows[:_MOST_EVENTS], text_columns=(1, 2))


def _seconds(time_s: Any) -> str:
    return f"{time_s:.3f}" if isinstance(time_s, int | float) and math.isfinite(time_s) else "before the first sample"
