"""What the commands on the archive share: how a search is typed, and runs that could not be entered."""

from __future__ import annotations

from datetime import datetime

import typer

from hil.errors import SettingError

_VERDICTS = ("pass", "fail", "cannot tell")


def verdict_of(text: str) -> str:
    """A verdict that there is.

    Raises:
        SettingError: there is none of that name.
    """
    if text and text not in _VERDICTS:
        raise SettingError(f"--verdict {text}: not known; there are: {', '.join(_VERDICTS)}")
    return text


def date_of(text: str) -> datetime | None:
    """A local date, or a local time; with an offset it is that of the offset.

    Raises:
        SettingError: no date.
    """
    if not text:
        return None
    try:
        return datetime.fromisoformat(text).astimezone()
    except ValueError:
        raise SettingError(f"--since {text}: a date was expected, as 2026-11-25 or 2026-11-25T14:30") from None


def not_entered(note: str) -> None:
    """Say why runs that wait could not be entered now."""
    typer.echo(f"hil: {note}", err=True)
