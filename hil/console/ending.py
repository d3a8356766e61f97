"""How a run ended, for a page: who stopped it, when, and where each output stands."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hil.language.words import _
from hil.record.header import End, Header, read_end, read_header
from hil.report.number import number

_PRESSED = "Halted: "


def ending_of(folder: Path) -> dict[str, Any]:
    """`word` and `sentence` of a run that somebody stopped, empty for every other; and `stands`, by output.

    Raises:
        FileError: not a run folder.
    """
    end = read_end(folder)
    if end is None:
        return {"word": "", "sentence": "", "stands": {}}
    outputs = end.meta.get("outputs") or {}
    stands = {name: one.get("at") for name, one in outputs.items() if isinstance(one, dict)}
    if not end.outcome.startswith(_PRESSED):
        return {"word": "", "sentence": "", "stands": stands}
    return {"word": _("Stopped"), "sentence": _sentence(read_header(folder), end), "stands": stands}


def _sentence(header: Header, end: End) -> str:
    """`Stopped by MK at 18:12:03, after 12.4 s; outputs are safe (read back).`"""
    who = str(header.meta.get("operator") or _("an operator"))
    after_s = (end.stopped_utc - header.started_utc).total_seconds()
    outputs = end.outcome.removeprefix(_PRESSED).partition("; ")[2]
    said = _("Stopped by {who} at {time}, after {seconds} s.").format(
        who=who, time=f"{end.stopped_utc.astimezone():%H:%M:%S}", seconds=number(round(after_s, 1), 6)
    )
    return f"{said[:-1]}; {_(outputs)}." if outputs else said
