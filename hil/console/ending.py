"""How a run ended, for a page: who stopped it, when, what is known of its outputs and where each stands."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hil.bench.stop.press import Press
from hil.language.words import _
from hil.record.measurement import AS_PLANNED
from hil.record.run_folder.header import End, Header, read_end, read_header
from hil.report.number import number
from hil.safety.outputs import ending_words

_PRESSED = "Halted: "


def ending_of(folder: Path) -> dict[str, Any]:
    """`word` of a run that somebody stopped, `sentence` of each that did not end as planned; and `stands`, by output.

    Raises:
        FileError: not a run folder.
    """
    end = read_end(folder)
    if end is None:
        return {"word": "", "sentence": "", "stands": {}}
    outputs = end.meta.get("outputs") or {}
    stands = {name: one.get("at") for name, one in outputs.items() if isinstance(one, dict)}
    text = ending_words(end.outcome, outputs) if end.outcome not in AS_PLANNED else ""
    if not text.startswith(_PRESSED):
        return {"word": "", "sentence": text, "stands": stands}
    return {"word": _("Stopped"), "sentence": _sentence(read_header(folder), end, text), "stands": stands}


def ending_before(press: Press) -> dict[str, Any]:
    """The same of a run that a press of stop ended while it was starting."""
    who = press.account or _("an operator")
    text = _("Stopped by {who} at {time}, before it drove.").format(
        who=who, time=f"{press.at_utc.astimezone():%H:%M:%S}"
    )
    return {"word": _("Stopped"), "sentence": text, "stands": {}}


def _sentence(header: Header, end: End, ended: str) -> str:
    """`Stopped by MK at 18:12:03, after 12.4 s; outputs are safe (read back).`"""
    who = str(end.meta.get("stopped_by") or _("an operator"))
    after_s = (end.stopped_utc - header.started_utc).total_seconds()
    outputs = ended.removeprefix(_PRESSED).partition("; ")[2]
    text = _("Stopped by {who} at {time}, after {seconds} s.").format(
        who=who, time=f"{end.stopped_utc.astimezone():%H:%M:%S}", seconds=number(round(after_s, 1), 6)
    )
    return f"{text[:-1]}; {outputs}." if outputs else text
