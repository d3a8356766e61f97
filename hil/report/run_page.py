"""The report of a run: verdict, results, figures, conditions, instruments, and where it all came from."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from hil.language.words import _
from hil.record.measurement import Findings
from hil.record.recording import Recording
from hil.record.run_folder.header import stated
from hil.record.simulated import is_simulated
from hil.report.curves import sections
from hil.report.facts import facts_of
from hil.report.local_time import stated_text
from hil.report.name import capital, quantity_words
from hil.report.number import note_text, number
from hil.report.page import page, write_page
from hil.report.provenance import channel_table, conditions_of, event_table, identity_of, instrument_line
from hil.report.results import result_groups, verdict_box


@page
def write_run_report(
    recording: Recording, findings: Findings, path: Path, units: Mapping[str, str] = MappingProxyType({})
) -> None:
    """Write the page of a run; `units` are those of its settings, by their names.

    Raises:
        StorageError: it cannot be written.
    """
    meta = recording.meta
    procedure = capital(_(quantity_words(str(meta.get("procedure") or "run"))))
    write_page(
        "run.html", path,
        simulated=is_simulated(meta),
        kicker=_("Test report"),
        title=f"{procedure}: {_valve_name(meta)}",
        verdict=verdict_box(findings, meta),
        summary=_summary(recording),
        groups=result_groups(findings.measured),
        judged=findings.verdict is not None,
        sections=sections(recording, findings),
        notes=list(map(note_text, findings.notes)),
        deviations=list(map(note_text, findings.deviations)),
        conditions=conditions_of(recording),
        settings=facts_of(meta.get("settings", {}), units),
        instruments=[instrument_line(instrument) for instrument in meta.get("instruments", ())],
        channels=channel_table(recording.channels.values()),
        identity=identity_of(recording),
        events=event_table(meta.get("events", ())),
        bench_file=meta.get("bench_file", ""),
    )  # fmt: skip


def _valve_name(meta: Mapping[str, Any]) -> str:
    return stated(meta, "valve", "name") or stated(meta, "bench") or "recording"


def _summary(recording: Recording) -> list[tuple[str, str]]:
    meta = recording.meta
    rows = [
        (_("Valve"), stated(meta, "valve", "name")),
        (_("Serial"), stated(meta, "valve", "serial")),
        (_("Bench"), stated(meta, "bench")),
        (_("Operator"), stated(meta, "operator")),
        *((capital(_(str(name))), str(text)) for name, text in (meta.get("notes") or {}).items()),
        (_("Date"), stated_text(meta.get("started_utc"))),
        (_("Recorded"), _("{seconds} s, {n} samples").format(seconds=number(recording.duration_s), n=len(recording))),
    ]
    return [(label, value) for label, value in rows if value]
