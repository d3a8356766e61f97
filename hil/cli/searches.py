"""What the commands on the archive share: what is looked for, and an index that has every run in it."""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING

import typer

from hil.errors import SettingError

if TYPE_CHECKING:
    from hil.archive.archive import Search
    from hil.archive.place import Place

_VERDICTS = ("pass", "fail", "cannot tell")


def search_of(serial: str, procedure: str, since: str, verdict: str) -> Search:
    """Which runs are looked for.

    Raises:
        SettingError: a date that is none, or a verdict that does not exist.
    """
    from hil.archive.archive import Search

    if verdict and verdict not in _VERDICTS:
        raise SettingError(f"--verdict {verdict}: not known; there are: {', '.join(_VERDICTS)}")
    return Search(serial, procedure.replace("-", "_"), _date(since), verdict)


def up_to_date(place: Place) -> None:
    """Enter the runs that wait; say in one line when that is not possible now."""
    from hil.archive.pending import catch_up
    from hil.errors import ArchiveError

    try:
        catch_up(place)
    except ArchiveError as error:
        typer.echo(f"hil: {error}", err=True)


def _date(text: str) -> datetime | None:
    """A local date, or a local time; with an offset it is that of the offset."""
    if not text:
        return None
    try:
        return datetime.fromisoformat(text).astimezone()
    except ValueError:
        raise SettingError(f"--since {text}: a date was expected, as 2026-11-25 or 2026-11-25T14:30") from None
