"""Page one and its annex as data: what the page says, in words and rounded numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hil.language.words import _, spoken
from hil.passport.template_words import template_words
from hil.passport.unit import Unit, UnitRun
from hil.record.measurement import COVERAGE_FACTOR, Measured
from hil.report.local_time import local_text
from hil.report.name import capital, quantity_words, value_words
from hil.report.number import limits_text, note_text, rounded, unit_text, with_minus, with_unit
from hil.report.provenance import stated_or_measured
from hil.report.results import value_text, verdict_box, verdict_words
from hil.version import PROGRAM

_ON_PAGE_ONE, _DEVIATIONS_ON_PAGE_ONE, _LONGEST = 16, 5, 160


@dataclass(frozen=True, slots=True)
class Signer:
    """Who signs, as page one says it."""

    name: str
    fingerprint: str


@dataclass(frozen=True, slots=True)
class Trail:
    """The audit trail when a passport is issued: its last line, its hash, and how many of the runs it holds."""

    line: int = 0
    sha256: str = ""
    holds: int = 0


def certificate_of(
    unit: Unit, signer: Signer, model_says: str, *, names: bool, trail: Trail = Trail()
) -> dict[str, Any]:
    """Everything that page one says, and the tables of the annex."""
    found = unit.findings
    boxes = [verdict_box(run.findings, run.recording.meta) for run in unit.runs]
    whole = verdict_words(found.verdict, finished=unit.finished)
    details = list(dict.fromkeys(str(detail) for box in boxes for detail in box["details"]))
    judged = sorted((m for m in found.measured if m.verdict), key=lambda m: m.verdict == "pass")
    others = [m for m in found.measured if not m.verdict]
    return {
        "across": _("SIMULATED") if unit.simulated else "",
        "title": _("Valve passport: {valve}, {serial}").format(valve=unit.valve, serial=unit.serial),
        "date": [unit.dates[1].year, unit.dates[1].month, unit.dates[1].day],
        **whole,
        "details": [with_minus(text) for text in details[:4]],
        "beside": list(dict.fromkeys(str(text) for box in boxes for text in box["beside"])),  # good units
        "facts": [*_facts(unit, names), *_origin(unit, trail)], "conditions": _conditions(unit),
        "limits": [_limit_row(m) for m in judged[:_ON_PAGE_ONE]],
        "more_limits": [_limit_row(m) for m in judged[_ON_PAGE_ONE:]],
        "values": [_value_row(m) for m in others],
        "instruments": _instruments(unit.runs),
        "deviations": [_shortened(text) for text in found.deviations[:_DEVIATIONS_ON_PAGE_ONE]],
        "all_deviations": [note_text(text) for text in found.deviations],
        "notes": [note_text(text) for text in dict.fromkeys(found.notes)],
        "model": model_says, "language": spoken(), "labels": template_words(),
        "signer": signer.name, "fingerprint": signer.fingerprint,
    }  # fmt: skip


def _facts(unit: Unit, names: bool) -> list[tuple[str, str]]:
    first, last = (local_text(run.started, "minutes") for run in (unit.runs[0], unit.runs[-1]))
    metas = [run.recording.meta for run in unit.runs]
    operators = _each(meta.get("operator") for meta in metas)
    notes = {str(k): str(v) for meta in metas for k, v in (meta.get("notes") or {}).items()}
    return [
        (_("Valve"), unit.valve),
        (_("Serial"), unit.serial),
        (_("Date"), f"{first}" if first == last else _("{first} to {last}").format(first=first, last=last)),
        (_("Operator"), operators if names else _("left out")),
        (_("Bench"), _each(meta.get("bench") for meta in metas)),
        (_("Tests"), _each(_(quantity_words(str(meta.get("procedure") or "run"))) for meta in metas)),
        *((capital(_(name)), text) for name, text in notes.items()),
    ]


def _each(values: Iterable[object]) -> str:
    """What runs state, each once."""
    return ", ".join(dict.fromkeys(_or_not_stated(value) for value in values))


def _or_not_stated(value: object) -> str:
    return str(value or _("not stated"))


def _origin(unit: Unit, trail: Trail) -> list[tuple[str, str]]:
    """Which program found the values, and whether the audit trail holds the runs as they are here."""
    rows = [(_("Program"), _programs(unit)), (_("Audit trail"), _trail(unit, trail))]
    late = dict.fromkeys(name for run in unit.runs for name in run.late_limits)
    if late:
        rows.append((_("Limits given after the run"), ", ".join(capital(_(quantity_words(name))) for name in late)))
    return rows


def _programs(unit: Unit) -> str:
    recorded = _each(run.recording.meta.get("program") for run in unit.runs)
    evaluated = _each(run.evaluated_by or _("an earlier version, unsealed") for run in unit.runs)
    text = recorded if recorded == evaluated else _("recorded: {one}; evaluated: {other}").format(
        one=recorded, other=evaluated
    )  # fmt: skip
    anew = any(run.moved for run in unit.runs)
    return _("{programs}; values evaluated anew: {program}").format(programs=text, program=PROGRAM) if anew else text


def _trail(unit: Unit, trail: Trail) -> str:
    if not trail.holds:
        return _("does not hold these runs")
    head = _("line {number}, {sha256} …").format(number=trail.line, sha256=trail.sha256[:16])
    if trail.holds == len(unit.runs):
        return _("holds these runs; its head: {head}").format(head=head)
    return _("holds {n} of {all} runs; its head: {head}").format(n=trail.holds, all=len(unit.runs), head=head)


def _conditions(unit: Unit) -> list[tuple[str, str]]:
    """Of every run; a label that has several values in them has all."""
    found: dict[str, list[str]] = {}
    for run in unit.runs:
        for label, text in stated_or_measured(run.recording):
            if text not in found.setdefault(label, []):
                found[label].append(text)
    return [(label, "; ".join(texts)) for label, texts in found.items()] or [(_("Conditions"), _("none stated"))]


def _limit_row(m: Measured) -> list[str]:
    return [*_value_row(m), limits_text(m.low, m.high), accepted_within(m), _(str(m.verdict))]


def _value_row(m: Measured) -> list[str]:
    return [name_words(m.name), value_text(m), unit_text(m.unit)]


def accepted_within(m: Measured) -> str:
    """The limits drawn in by the guard band, the expanded uncertainty; empty where that is not known."""
    if m.std is None:
        return _("not known")
    guard = COVERAGE_FACTOR * m.std
    low = None if m.low is None else m.low + guard
    high = None if m.high is None else m.high - guard
    if low is not None and high is not None and low > high:
        return _("nowhere")
    text = [None if edge is None else rounded(edge, guard)[0] for edge in (low, high)]
    if text[0] is None:
        return f"≤ {text[1]}"
    return f"≥ {text[0]}" if text[1] is None else f"{text[0]} … {text[1]}"


def name_words(name: str) -> str:
    """The name of a measured value, for a page."""
    return capital(value_words(name))


def _instruments(runs: Sequence[UnitRun]) -> list[list[str]]:
    rows = [row for run in runs for row in (*_devices(run), *_channels(run))]
    return [list(row) for row in dict.fromkeys(map(tuple, rows))]


def _devices(run: UnitRun) -> list[list[str]]:
    return [
        [str(one.get("name") or ""),
         *(_or_not_stated(one.get(key)) for key in ("serial", "calibrated", "due", "uncertainty"))]
        for one in run.recording.meta.get("instruments", ()) if isinstance(one, Mapping)
    ]  # fmt: skip


def _channels(run: UnitRun) -> list[list[str]]:
    found = []
    for channel in run.recording.channels.values():
        line = channel.calibration
        if line:
            width = line.get("uncertainty")
            found.append([
                f"{channel.name}: {channel.source}",
                *(_or_not_stated(line.get(key)) for key in ("source", "date", "due")),
                _("not stated") if width is None else with_unit(width, channel.unit, 4),
            ])  # fmt: skip
    return found


def _shortened(text: str) -> str:
    whole = note_text(text)
    return whole if len(whole) <= _LONGEST else whole[:_LONGEST].rsplit(" ", 1)[0] + " … " + _("(whole in the annex)")
