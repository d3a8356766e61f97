"""Times are kept in UTC and shown where the reader is, with the offset."""

from __future__ import annotations

from datetime import datetime


def local_text(moment: datetime, timespec: str = "seconds") -> str:
    """`2026-11-25 14:35:46 +01:00`."""
    text = moment.astimezone().isoformat(sep=" ", timespec=timespec)
    return f"{text[:-6]} {text[-6:]}"


def stated_text(stated: object) -> str:
    """The same of a moment as a header states it; empty where that is none."""
    try:
        return local_text(datetime.fromisoformat(str(stated)))
    except ValueError:
        return ""
